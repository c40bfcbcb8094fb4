"""Estimator of a vehicle: slip, speed, soil, pose and immobilisation from sensor readings.

Node, replay and evaluation use the same class. It checks every reading for plausibility and passes
it to the slip filter, the track of a satellite receiver, the calibration of rolling radii, the
odometry and the warning of immobilisation. It resets the estimate when time jumps.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_controller.estimation.gnss import GnssTrack
from traction_controller.estimation.immobilisation import Immobilisation, Level, WarningLimits
from traction_controller.estimation.inertial import InertialUnit
from traction_controller.estimation.kalman import method_named
from traction_controller.estimation.odometry import PathOdometry, axle_yaw_rate
from traction_controller.estimation.plausibility import Plausibility
from traction_controller.estimation.radius_calibration import GroundSource, RadiusCalibration
from traction_controller.estimation.rolling_radius import FirmGround
from traction_controller.estimation.slip_filter import EstimatorNoise, SlipFilter, Source
from traction_controller.estimation.tachometer import Tachometers
from traction_controller.estimation.timeline import Timeline
from traction_model.soil.soil import Soil, load_soil
from traction_model.vehicle.vehicle import Vehicle, load_vehicle
from traction_node.positive import check_positive

Array = NDArray[np.float64]


class Health(IntEnum):
    """Health of the estimate, numbered as in diagnostic_msgs/msg/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2


class VehicleEstimator:
    """Estimator of slip, speed, soil, pose and immobilisation of one vehicle.

    Use `from_parameters` to construct it. An unusable reading is rejected: the method returns
    False and `refused` has the reason.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    soil : Soil
        Nominal soil: initial value of the estimated soil.
    noise : EstimatorNoise
        Process and measurement noise of the filter.
    min_speed : float
        Speed of rim or vehicle below which slip is not valid, m/s, above 0.
    radar_timeout : float
        Time without measured speed after which slip is estimated from torque alone, s, above 0.
    radar_variance : float
        Default variance of a measured speed, m^2/s^2, above 0.
    stuck_time : float
        Time for which a reading may stay the same while others change, s; 0 disables the check.
        See `Plausibility`.
    terrain_rate, odometry_rate : float
        Rates of publication of soil and pose, Hz, above 0.
    method : {'ukf', 'ekf', 'scheduled_gain'}
        Kalman filter.
    tachometer_pulses : float
        Pulses per turn that the tachometers count; 0: found from the readings.
    radar_latency, gnss_latency : float
        Delay of stamps after the time of measurement, s, 0 to 0.5.
    radar_min_speed : float
        Smallest speed that the radar measures, m/s, at least 0.
    calibrate_radius : bool
        True to calibrate rolling radii at low gross traction.
    calibration_effort : float
        Largest gross traction over load of a wheel for calibration, dimensionless, above 0.
    track_width : float
        Distance between the outer wheels of the rear axle, which must not steer, m; 0: no
        estimation of yaw.
    warning_horizon : float
        Time to standstill at which the warning of immobilisation is given, s, above 0.
    warning_slip : float
        Share of power lost in slip at which the warning is given, dimensionless, above 0.

    Attributes
    ----------
    slip_filter : SlipFilter
        Slip, speed and soil.
    odometry : PathOdometry
        Distance and pose; `reset` keeps them.
    gnss_track : GnssTrack
        Speed and heading from positions.
    tachometers : Tachometers
        Pulses of the tachometers, as given or found.
    inertial : InertialUnit
        Newest readings of `imu`.
    immobilisation : Immobilisation
        Warning of immobilisation.
    calibration : RadiusCalibration
        Rolling radii, m; `reset` keeps them.
    yaw_rate, yaw_rate_variance : float
        rad/s, counter-clockwise positive, and rad^2/s^2; the variance is infinite while yaw is
        not observed.
    refused : dict of str to str
        Reason of the rejection of the newest reading of a source, by the name of its topic.
    disbelieved : dict of str to str
        Sources of speed whose newest reading is not believed, with the reason.
    gnss_jumped : bool
        True if the newest position was rejected as a jump.
    time_jump : float
        Jump of time with the newest reading of the wheels, which reset the estimate, s, positive
        forward; 0 without a jump.
    terrain_due, odometry_due : bool
        True if soil and pose are due for publication with the newest reading of the wheels.
    health_due : bool
        True if `health` is due for publication with the newest reading, as it may have changed.

    Raises
    ------
    ValueError
        If a value is out of its range.
    """

    # Time for which a reading with a strange stamp is told, s.
    _STRANGE_TIME = 1.0
    # Gross traction over weight, and slip, whose signs are clear.
    _CLEAR_TRACTION, _CLEAR_SLIP = 0.05, 0.05
    # Rim speed below which wheels rest, m/s.
    _AT_REST = 0.02
    # Age of a commanded torque up to which it is used, s, and largest one over weight times radius
    # that counts as none.
    _COMMAND_AGE, _NO_COMMAND = 0.5, 0.005

    def __init__(
        self,
        vehicle: Vehicle,
        soil: Soil,
        *,
        noise: EstimatorNoise,
        min_speed: float,
        radar_timeout: float,
        radar_variance: float,
        stuck_time: float,
        terrain_rate: float,
        odometry_rate: float,
        method: str,
        tachometer_pulses: float,
        radar_latency: float,
        gnss_latency: float,
        radar_min_speed: float,
        calibrate_radius: bool,
        calibration_effort: float,
        track_width: float,
        warning_horizon: float,
        warning_slip: float,
    ) -> None:
        check_positive(terrain_rate=terrain_rate, odometry_rate=odometry_rate)
        _check_track_width(track_width, vehicle)
        self.vehicle = vehicle
        self.slip_filter = SlipFilter(
            vehicle,
            soil,
            noise,
            min_speed,
            radar_timeout,
            radar_variance,
            method=method,
            radar_latency=radar_latency,
            gnss_latency=gnss_latency,
            radar_min_speed=radar_min_speed,
        )
        self.calibration = RadiusCalibration(
            vehicle, FirmGround(largest_effort=calibration_effort)
        )
        self.gnss_track = GnssTrack(latency=gnss_latency, min_speed=min_speed)
        self._nominal_radius = self.slip_filter.rolling_radius
        self._weight = float(vehicle.static_loads().sum())
        self.immobilisation = Immobilisation(
            self._nominal_radius,
            self._weight,
            WarningLimits(horizon=warning_horizon, slip=warning_slip, min_speed=min_speed),
        )
        self.odometry = PathOdometry()
        self.tachometers = Tachometers(len(vehicle.wheels), tachometer_pulses)
        self.inertial = InertialUnit()
        self._plausibility = Plausibility(vehicle, min_speed, stuck_time)
        self._timeline = Timeline(SlipFilter.LONGEST_GAP)
        self._min_speed = min_speed
        self._radar_min_speed = radar_min_speed
        self._radar_latency, self._gnss_latency = radar_latency, gnss_latency
        self._calibrate_radius = calibrate_radius
        self._track_width = track_width
        self._terrain_period, self._odometry_period = 1.0 / terrain_rate, 1.0 / odometry_rate
        names = vehicle.wheel_names
        rear = rear_axle_wheels(vehicle)
        self._left, self._right = names.index(rear[0]), names.index(rear[-1])
        self.reset()

    @classmethod
    def from_parameters(cls, p: Any) -> 'VehicleEstimator':
        """Construct an estimator from the parameters of the node `slip_estimator`.

        Parameters
        ----------
        p : namespace
            One attribute for each of the node's parameters, in their units.

        Returns
        -------
        VehicleEstimator
            Estimator in its initial state.

        Raises
        ------
        ValueError
            If a parameter is invalid, or a definition cannot be loaded.
        """
        return cls(
            load_vehicle(p.vehicle),
            load_soil(p.soil),
            noise=EstimatorNoise(
                **{f.name: getattr(p, f'noise_{f.name}') for f in fields(EstimatorNoise)}
            ),
            **{name: getattr(p, name) for name in _PARAMETERS},
        )

    @staticmethod
    def check_parameters(p: Any) -> None:
        """Check parameters without construction of an estimator.

        Parameters
        ----------
        p : namespace
            As for `from_parameters`.

        Raises
        ------
        ValueError
            As for `from_parameters`.
        """
        vehicle = load_vehicle(p.vehicle)
        load_soil(p.soil)
        method_named(p.method)
        _check_track_width(p.track_width, vehicle, p.vehicle)

    def reset(self) -> None:
        """Reset the estimate; distance, pose and calibrated radii are kept."""
        self.slip_filter.reset()
        self.tachometers.reset()
        self.inertial.reset()
        self._plausibility.reset()
        # After a reset in motion, slip is not valid until a speed over ground is measured or the
        # vehicle stands: rim speed alone does not separate slip from speed.
        self._on_the_move = False
        self.calibration.restart()
        self.gnss_track.reset()
        self.immobilisation.reset()
        self.yaw_rate, self.yaw_rate_variance = 0.0, math.inf
        self.gnss_jumped = False
        self.time_jump = 0.0
        self._timeline.reset()
        self._strange_t = -math.inf
        self._travelled_t: float | None = None
        # Sum of the commanded forces at the rims, N, and time, s.
        self._commanded, self._commanded_t = 0.0, -math.inf
        self._terrain_t = self._odometry_t = -math.inf
        self.terrain_due = self.odometry_due = self.health_due = False
        self.refused: dict[str, str] = {}
        self.disbelieved: dict[str, str] = {}

    @property
    def t(self) -> float | None:
        """Time of the newest accepted reading of the wheels, s; None before the first."""
        return self.slip_filter.t

    @property
    def slip(self) -> Array:
        """Slip of every wheel, -1 to 1, shape (n,)."""
        return self.slip_filter.slip

    @property
    def slip_variance(self) -> Array:
        """Variance of `slip`, dimensionless, shape (n,)."""
        return self.slip_filter.slip_variance

    @property
    def valid(self) -> NDArray[np.bool_]:
        """True if a slip can be used, shape (n,)."""
        return self.slip_filter.valid & (not self._on_the_move)

    @property
    def rim_speed(self) -> Array:
        """r*omega of every wheel, m/s, shape (n,)."""
        return self.slip_filter.rim_speed

    @property
    def v(self) -> float:
        """Speed over ground, m/s, forward positive."""
        return self.slip_filter.v

    @property
    def v_variance(self) -> float:
        """Variance of `v`, m^2/s^2."""
        return self.slip_filter.v_variance

    @property
    def v_valid(self) -> bool:
        """True if `v` can be used."""
        return self.slip_filter.v_valid and not self._on_the_move

    @property
    def source(self) -> Source:
        """Present source of `v`."""
        return self.slip_filter.source

    @property
    def gross_traction(self) -> Array:
        """Moment of the soil over the rolling radius, N, forward positive, shape (n,)."""
        return self.slip_filter.gross_traction

    @property
    def slip_stiffness(self) -> Array:
        """Slope of gross traction over slip at the present slip, N, shape (n,)."""
        return self.slip_filter.slip_stiffness

    @property
    def health(self) -> tuple[Health, str]:
        """Health of the estimate, with a text."""
        watch = self.immobilisation
        if self.refused:
            return Health.ERROR, 'refused: ' + '; '.join(self.refused.values())
        if self.time_jump:
            way = 'forward' if self.time_jump > 0.0 else 'back'
            return (
                Health.WARN,
                f'time jumped {way} by {abs(self.time_jump):.3f} s: estimating anew',
            )
        if self._timeline.newest is None:
            return Health.WARN, 'waiting for wheel_states'
        if watch.level is Level.IMMOBILISED:
            return Health.ERROR, f'immobilised: {watch.reason.value}'
        if watch.level is Level.WARNING:
            return Health.WARN, f'immobilisation is near: {watch.reason.value}'
        if self.gnss_jumped:
            return Health.WARN, 'gnss has jumped: refused'
        if self.disbelieved:
            said = '; '.join(f'{name} {why}' for name, why in sorted(self.disbelieved.items()))
            return Health.WARN, f'{said}: not believed'
        if self.source is Source.WHEEL:
            return Health.WARN, 'radar silent: slip rests on shaft torque'
        if self.slip_filter.soil_rejected:
            what = (
                'shaft torque has the other sign than slip'
                if self._torque_opposes()
                else ('shaft torque and soil contradict the measured speed')
            )
            return Health.WARN, f'{what}: slip rests on speed alone'
        return Health.OK, 'estimating'

    @property
    def radius_state(self) -> str:
        """State of the calibration of rolling radii as text; 'off' if it is disabled."""
        return self.calibration.state.value if self._calibrate_radius else 'off'

    def _torque_opposes(self) -> bool:
        """True if wheels are faster than the ground although the torque brakes, or the reverse."""
        traction = float(self.gross_traction.sum())
        slip = float(self.slip.mean()) * math.copysign(1.0, self.v)
        return (
            abs(traction) > self._CLEAR_TRACTION * self._weight
            and abs(slip) > self._CLEAR_SLIP
            and traction * slip < 0.0
        )

    def refuse(self, source: str, reason: str) -> None:
        """Record the rejection of a reading, for `health`.

        Parameters
        ----------
        source : str
            Name of its topic.
        reason : str
            Reason.
        """
        self.refused[source] = reason
        self.health_due = True

    def note_publishers(self, source: str, count: int) -> None:
        """Note the number of publishers of a topic: more than one is told in `health`.

        Parameters
        ----------
        source : str
            Name of the topic.
        count : int
            Number of its publishers.
        """
        key = f'{source} publishers'
        if count > 1:
            self.refused[key] = f'{count} publishers of {source}'
        else:
            self.refused.pop(key, None)

    def wheel_states(self, t: float, omega: ArrayLike, torque: ArrayLike) -> bool:
        """Update with a reading of all tachometers and shaft torques.

        Parameters
        ----------
        t : float
            Time of measurement, s, from an origin common to all sensors. Readings with a time
            half a second or more off the newest are rejected. If only such ones come for a tenth
            of a second, there was a gap or the clock was set: the estimate is reset.
        omega : array_like, shape (n,)
            Wheel speeds, rad/s, forward positive.
        torque : array_like, shape (n,)
            Shaft torques, N·m, forward positive.

        Returns
        -------
        bool
            False if the reading was rejected: not finite, wrong number of values, implausible, or
            too late. `refused` has the reason.
        """
        self.time_jump = 0.0
        self.terrain_due = self.odometry_due = self.health_due = False
        try:
            speeds = self.slip_filter.checked('wheel speed', omega)
            torques = self.slip_filter.checked('shaft torque', torque)
            if not self._on_timeline(t):
                return False
            self._update_filter(t, speeds, torques)
        except ValueError as error:
            self.refuse('wheel_states', str(error))
            return False
        self.refused.pop('wheel_states', None)
        # A late reading changes the estimate, but not the time.
        if self.t is not None and t >= self.t:
            self.calibration.wheels(t, speeds, self.gross_traction)
            self.gnss_track.wheels(t, float(self.rim_speed.mean()))
            self._travel(t)
            self._watch(t, speeds, torques)
        standing = np.abs(self.rim_speed).max() < self._min_speed
        if self.source is not Source.WHEEL or standing:
            self._on_the_move = False
        # Tolerance of a microsecond for the resolution of stamps.
        if t >= self._terrain_t:
            self._terrain_t = t + self._terrain_period - 1e-6
            self.terrain_due = self.health_due = True
        if t >= self._odometry_t:
            self._odometry_t = t + self._odometry_period - 1e-6
            self.odometry_due = True
        return True

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Update with a radar reading.

        Parameters
        ----------
        t : float
            Stamp, s: `radar_latency` after the time of measurement.
        v : float
            Speed over ground, m/s, forward positive.
        variance : float
            Variance, m^2/s^2; 0 means `radar_variance`.

        Returns
        -------
        bool
            False if it was implausible (`refused` has the reason), outside the gate
            (`disbelieved`), below `radar_min_speed`, or before the first reading of the wheels.
        """
        return self._speed('radar', t, v, variance)

    def gnss_velocity(self, t: float, v: float, variance: float) -> bool:
        """Update with a speed over ground from a satellite receiver.

        Parameters
        ----------
        t : float
            Stamp, s: `gnss_latency` after the time of measurement.
        v : float
            Speed along the vehicle, m/s, forward positive.
        variance : float
            Variance, m^2/s^2; 0 means `radar_variance`.

        Returns
        -------
        bool
            False if it was implausible, outside the gate, or before the first reading of the
            wheels.
        """
        return self._speed('gnss_velocity', t, v, variance)

    def imu(
        self, t: float, acceleration: float, variance: float, yaw_rate: float, pitch_rate: float
    ) -> bool:
        """Update with a reading of an inertial measurement unit.

        Its bias and mounting are found at standstill, grade and slow changes from speeds.

        Parameters
        ----------
        t : float
            Time of measurement, s.
        acceleration : float
            Specific force along the vehicle, m/s^2, forward positive.
        variance : float
            Its variance, m^2/s^4; 0: not known, see `InertialUnit`.
        yaw_rate, pitch_rate : float
            Rates of yaw, counter-clockwise positive, and of pitch, nose down positive, rad/s.

        Returns
        -------
        bool
            False if it was rejected (`refused` has the reason), or before the first reading of
            the wheels.
        """
        self.health_due = False
        newest = self._timeline.newest
        if newest is None:
            return False
        try:
            if abs(t - newest) > SlipFilter.LONGEST_GAP:
                raise ValueError(f'imu reading is {t - newest:+.3f} s off the wheels in time')
            self.inertial.add(t, acceleration, variance, yaw_rate, pitch_rate)
        except ValueError as error:
            if 'wheel_states' not in self.refused:
                self.refuse('imu', str(error))
            return False
        self.refused.pop('imu', None)
        return True

    def gnss(self, t: float, position: ArrayLike) -> bool:
        """Update with a position from a satellite receiver.

        Parameters
        ----------
        t : float
            Stamp, s: `gnss_latency` after the time of measurement.
        position : array_like, shape (2,) or (3,)
            East, north and, if known, up, m, in any fixed frame.

        Returns
        -------
        bool
            False if it was rejected, is a jump, has no valid information on speed, or came before
            the first reading of the wheels.
        """
        self.health_due = False
        if self._timeline.newest is None:
            return False
        track = self.gnss_track
        accepted = True
        try:
            self.gnss_jumped = not track.fix(t, position)
            if math.isfinite(track.reading_variance):
                # The filter subtracts the latency.
                accepted = self.slip_filter.gnss(
                    track.speed_t + track.latency, track.reading, track.reading_variance
                )
        except (ValueError, OverflowError) as error:
            self.refuse('gnss', str(error))
            return False
        self.refused.pop('gnss', None)
        self._note_acceptance('gnss', accepted)
        self._calibrate(lambda: self.calibration.fix(track))
        return accepted and not self.gnss_jumped

    def commanded_torque(self, torque: Sequence[float]) -> None:
        """Set the torques commanded to the drives; only `immobilisation` uses them.

        Parameters
        ----------
        torque : sequence of float, shape (n,)
            Torque of every wheel, N·m, forward positive.
        """
        force = np.abs(np.asarray(torque, dtype=float)) / self._nominal_radius
        self._commanded = float(force.sum())
        self._commanded_t = -math.inf if self.t is None else self.t

    def _on_timeline(self, t: float) -> bool:
        """True if a reading is on the timeline of the others; resets if that has jumped."""
        if not math.isfinite(t):
            raise ValueError(f'time of measurement is not finite: {t}')
        try:
            jump = self._timeline.add(t)
        except ValueError as error:
            self._strange_t = self._timeline.newest or 0.0
            if _CLOCK not in self.refused:
                self.refuse(_CLOCK, str(error))
            return False
        if jump:
            self.reset()
            self._timeline.add(t)
            self.time_jump = jump
            self._on_the_move = self.health_due = True
        elif t - self._strange_t > self._STRANGE_TIME:
            self.refused.pop(_CLOCK, None)
        return True

    def _update_filter(self, t: float, omega: Array, torque: Array) -> None:
        slip_filter = self.slip_filter
        v = slip_filter.v if slip_filter.v_valid else math.nan
        tachometers = self.tachometers
        tachometers.update(t, omega)
        self._plausibility.wheels(t, omega.tolist(), torque.tolist(), v, tachometers.step.tolist())
        motion = self.inertial.take(t)
        slip_filter.wheel_states(
            t, omega, torque, tachometers.pulse, tachometers.counted, motion
        )  # fmt: skip
        # Signal of standstill: no wheel has moved.
        self.inertial.note_rest(t, bool(np.abs(self.rim_speed).max() < self._AT_REST))

    def _travel(self, t: float) -> None:
        """Advance odometry."""
        before, self._travelled_t = self._travelled_t, t
        if before is None or t - before > SlipFilter.LONGEST_GAP:
            return
        # By the validity in the filter: after a reset in motion this is still the best estimate of
        # the slip that the speed compensates.
        valid = self.slip_filter.valid
        slip = float(self.slip[valid].mean()) if valid.any() else 0.0
        deviation = 0.0
        if self.source is Source.WHEEL:
            # A measured speed does not depend on the radii.
            variance = self.calibration.radius_variance / self.slip_filter.rolling_radius**2
            deviation = math.sqrt(variance.mean())
        if self.inertial.alive(t):
            self.yaw_rate = self.inertial.yaw_rate
            self.yaw_rate_variance = self.inertial.yaw_rate_variance
        elif self._track_width:
            rims = self.rim_speed
            self.yaw_rate, self.yaw_rate_variance = axle_yaw_rate(
                rims[self._left], rims[self._right], slip, self._track_width
            )
        self.odometry.advance(
            t - before, self.v, self.v_variance, slip, deviation,
            self.yaw_rate, self.yaw_rate_variance,
        )  # fmt: skip

    def _watch(self, t: float, omega: Array, torque: Array) -> None:
        """Update the warning of immobilisation."""
        watch = self.immobilisation
        before = watch.level
        # It uses nominal radii, so omega and torque are scaled to give the same rim speed and
        # force.
        scale = self.slip_filter.rolling_radius / self._nominal_radius
        watch.step(
            t, self.v, omega * scale, torque / scale, self.slip_filter.mobilisation,
            self.slip_filter.sinkage,
            asked=t - self._commanded_t > self._COMMAND_AGE
            or self._commanded > self._NO_COMMAND * self._weight,
        )  # fmt: skip
        if watch.level is not before:
            self.health_due = True

    def _speed(self, source: str, t: float, v: float, variance: float) -> bool:
        self.health_due = False
        # Before the first reading of the wheels a speed cannot be assigned to one.
        if self._timeline.newest is None:
            return False
        radar = source == 'radar'
        update = self.slip_filter.radar if radar else self.slip_filter.gnss
        why = self._plausibility.speed(source, t, v)
        try:
            accepted = not why and update(t, v, variance)
        except ValueError as error:
            if 'wheel_states' not in self.refused:
                self.refuse(source, str(error))
            return False
        self.refused.pop(source, None)
        if radar and abs(v) < self._radar_min_speed:
            # No reading: neither accepted nor rejected.
            self._note_acceptance(source, True)
            return False
        self._note_acceptance(source, accepted, why)
        ground = GroundSource.RADAR if radar else GroundSource.VELOCITY
        measured = t - (self._radar_latency if radar else self._gnss_latency)
        self._calibrate(lambda: self.calibration.speed(ground, measured, v))
        return accepted

    def _note_acceptance(self, source: str, accepted: bool, why: str = '') -> None:
        if accepted:
            self.disbelieved.pop(source, None)
        else:
            self.disbelieved[source] = why or 'against wheels and torque'

    def _calibrate(self, compare: Callable[[], None]) -> None:
        """Update the calibration with a distance over ground, and apply its radii."""
        if not self._calibrate_radius:
            return
        compare()
        radius = self.calibration.radius
        if not np.array_equal(radius, self.slip_filter.rolling_radius):
            self.slip_filter.set_rolling_radius(radius)


def rear_axle_wheels(vehicle: Vehicle) -> Sequence[str]:
    """Names of the wheels of the last axle.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.

    Returns
    -------
    sequence of str
        From left to right.
    """
    return min(vehicle.axles, key=lambda axle: axle.x).wheel_names


def _check_track_width(track_width: float, vehicle: Vehicle, name: str = 'the vehicle') -> None:
    if not (math.isfinite(track_width) and track_width >= 0):
        raise ValueError(f'track_width must be at least 0 m, got {track_width}')
    if track_width and len(rear_axle_wheels(vehicle)) < 2:
        raise ValueError(
            f'track_width {track_width} m needs a rear axle of two wheels, but {name} '
            'has only one there: give 0'
        )


# Source of a rejection by time.
_CLOCK = 'wheel_states clock'

# Node parameters that are passed to the constructor unchanged.
_PARAMETERS = (
    'min_speed', 'radar_timeout', 'radar_variance', 'stuck_time', 'terrain_rate', 'odometry_rate',
    'method', 'tachometer_pulses', 'radar_latency', 'gnss_latency', 'radar_min_speed',
    'calibrate_radius', 'calibration_effort', 'track_width', 'warning_horizon', 'warning_slip',
)  # fmt: skip
