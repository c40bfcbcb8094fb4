"""What the node `slip_estimator` does: slip, speed, soil and pose from the sensors.

A behaviour runs in a ROS 2 process or in lock step, see `traction_evaluation.replay.lockstep`.
"""

import copy
import math
from dataclasses import fields

import numpy as np

from traction_controller.estimation.gnss import GnssTrack
from traction_controller.estimation.immobilisation import Immobilisation, Level, WarningLimits
from traction_controller.estimation.kalman import method_named
from traction_controller.estimation.odometry import UNOBSERVED, PathOdometry, axle_yaw_rate
from traction_controller.estimation.plausibility import Plausibility
from traction_controller.estimation.radius_calibration import GroundSource, RadiusCalibration
from traction_controller.estimation.rolling_radius import FirmGround
from traction_controller.estimation.slip_filter import EstimatorNoise, SlipFilter, Source
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle
from traction_node import diagnostic
from traction_node.behaviour import Behaviour
from traction_node.joints import JointOrder
from traction_node.parameter import NodeParameter
from traction_node.stamp import between

_NOISE = EstimatorNoise()
_LIMITS = WarningLimits()
_GROUND = FirmGround()
# Where the entries of x, y and yaw are in a covariance of six by six.
_PLANAR = np.ix_([0, 1, 5], [0, 1, 5])


def _rear_axle(vehicle):
    """Names of the wheels of the last axle, left to right."""
    return min(vehicle.axles, key=lambda axle: axle.x).wheel_names


class SlipEstimatorBehaviour(Behaviour):
    """Publishes a slip estimate for every reading of the wheels."""

    NAME = 'slip_estimator'
    LIFECYCLE = True
    PARAMETERS = (
        NodeParameter(
            'vehicle',
            default='tractor_4wd',
            description='preset or path of a vehicle YAML',
            read_only=True,
        ),
        NodeParameter(
            'soil',
            default='sandy_loam_chrono',
            description='nominal soil: preset or file.yaml:name',
            read_only=True,
        ),
        NodeParameter(
            'min_speed',
            default=0.3,
            description='speed of rim or vehicle below which slip is not valid',
            unit='m/s',
            minimum=0.05,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_timeout',
            default=0.5,
            description='silence after which slip rests on torque alone',
            unit='s',
            minimum=0.05,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'radar_variance',
            default=0.0025,
            description='variance of a radar reading that does not state one',
            unit='m²/s²',
            minimum=1e-6,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'stuck_time',
            default=0.15,
            description=(
                'time for which a tachometer or a radar may tell the same to the last bit '
                'while others change by 2 %, longer in proportion for less; 0: for ever'
            ),
            unit='s',
            minimum=0.0,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'terrain_rate',
            default=10.0,
            description='rate of terrain_estimate',
            unit='Hz',
            minimum=1.0,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'odometry_rate',
            default=50.0,
            description='rate of odometry',
            unit='Hz',
            minimum=1.0,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'method',
            default='ukf',
            description=(
                'Kalman filter: ukf (best), ekf (half the time) or scheduled_gain '
                '(computed beforehand)'
            ),
            read_only=True,
        ),
        NodeParameter(
            'tachometer_pulses',
            default=0.0,
            description='pulses per turn that the tachometers count; 0: ideal',
            minimum=0.0,
            maximum=1e6,
            read_only=True,
        ),
        NodeParameter(
            'radar_latency',
            default=0.0,
            description='time by which the stamps of radar are late',
            unit='s',
            minimum=0.0,
            maximum=0.5,
            read_only=True,
        ),
        NodeParameter(
            'radar_min_speed',
            default=0.0,
            description='speed below which the radar is blind',
            unit='m/s',
            minimum=0.0,
            maximum=2.0,
            read_only=True,
        ),
        NodeParameter(
            'gnss_latency',
            default=0.0,
            description='time by which the stamps of gnss and gnss_velocity are late',
            unit='s',
            minimum=0.0,
            maximum=0.5,
            read_only=True,
        ),
        NodeParameter(
            'calibrate_radius',
            default=False,
            description='find the rolling radii while wheels pull little',
            read_only=True,
        ),
        NodeParameter(
            'calibration_effort',
            default=_GROUND.largest_effort,
            description='thrust over load up to which a wheel pulls little',
            minimum=1e-3,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'track_width',
            default=0.0,
            description=(
                'distance between the outer wheels of the rear axle, which must not '
                'steer; 0: yaw is not estimated'
            ),
            unit='m',
            minimum=0.0,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'warning_horizon',
            default=_LIMITS.horizon,
            description='time to standstill at which immobilisation is warned of',
            unit='s',
            minimum=0.1,
            maximum=60.0,
            read_only=True,
        ),
        NodeParameter(
            'warning_slip',
            default=_LIMITS.slip,
            description='share of power lost in slip at which immobilisation is warned of',
            minimum=0.05,
            maximum=1.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_acceleration',
            default=_NOISE.acceleration,
            description='random walk of the drawbar, as acceleration',
            unit='m/s²/√s',
            minimum=1e-4,
            maximum=100.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_speed',
            default=_NOISE.speed,
            description='random walk of the speed beyond the model',
            unit='m/s/√s',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_soil',
            default=_NOISE.soil,
            description="random walk of the logarithms of the soil's parameters",
            unit='1/√s',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_strength',
            default=_NOISE.strength,
            description='deviation of ln(tau_max) where soil changes',
            minimum=1e-3,
            maximum=3.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_shear_modulus',
            default=_NOISE.shear_modulus,
            description='deviation of ln(K) where soil changes',
            minimum=1e-3,
            maximum=3.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_sinkage_modulus',
            default=_NOISE.sinkage_modulus,
            description='deviation of the logarithm of the sinkage modulus where soil changes',
            minimum=1e-3,
            maximum=3.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_nominal',
            default=_NOISE.nominal,
            description='share of these that the nominal soil is off',
            minimum=1e-3,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_gross_traction',
            default=_NOISE.gross_traction,
            description='deviation of gross traction from its curve, as share of the static load',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_slip',
            default=_NOISE.slip,
            description='deviation of the slip at which a thrust is reached',
            minimum=1e-4,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_wheel_speed',
            default=_NOISE.wheel_speed,
            description='deviation of an ideal tachometer',
            unit='rad/s',
            minimum=1e-5,
            maximum=10.0,
            read_only=True,
        ),
        NodeParameter(
            'noise_wheel_acceleration',
            default=_NOISE.wheel_acceleration,
            description='random walk of the wheel speed between pulses, as a share of it',
            unit='1/√s',
            minimum=1e-3,
            maximum=100.0,
            read_only=True,
        ),
    )

    def check_parameters(self, p):
        """Refuse definitions that cannot be loaded."""
        vehicle = load_vehicle(p.vehicle)
        load_soil(p.soil)
        method_named(p.method)
        if p.track_width and len(_rear_axle(vehicle)) < 2:
            raise ValueError(
                f'track_width {p.track_width} m needs a rear axle of two wheels, but {p.vehicle} '
                'has only one there: give 0'
            )

    def configure(self):
        """Build the estimator and its messages."""
        p = self.host.p
        vehicle = load_vehicle(p.vehicle)
        noise = {f.name: getattr(p, f'noise_{f.name}') for f in fields(EstimatorNoise)}
        self._estimation = SlipFilter(
            vehicle,
            load_soil(p.soil),
            EstimatorNoise(**noise),
            p.min_speed,
            p.radar_timeout,
            p.radar_variance,
            method=p.method,
            tachometer_pulses=p.tachometer_pulses,
            radar_latency=p.radar_latency,
            gnss_latency=p.gnss_latency,
            radar_min_speed=p.radar_min_speed,
        )
        self._calibration = RadiusCalibration(
            vehicle, FirmGround(largest_effort=p.calibration_effort)
        )
        self._plausibility = Plausibility(vehicle, p.min_speed, p.tachometer_pulses, p.stuck_time)
        self._nominal_radius = self._estimation.rolling_radius
        self._track = GnssTrack(latency=p.gnss_latency, min_speed=p.min_speed)
        self._immobilisation = Immobilisation(
            self._nominal_radius,
            float(vehicle.static_loads().sum()),
            WarningLimits(horizon=p.warning_horizon, slip=p.warning_slip, min_speed=p.min_speed),
        )
        names = list(vehicle.wheel_names)
        rear = _rear_axle(vehicle)
        self._left, self._right = names.index(rear[0]), names.index(rear[-1])
        self._speeds = JointOrder(names, 'wheel_states velocity')
        self._torques = JointOrder(names, 'wheel_states effort')
        self._publish_slip = self.host.publisher('slip_estimate').publish
        self._slip = self.host.message('slip_estimate')
        self._slip.wheel_names = names
        self._slip.header.frame_id = 'base_link'
        self._publish_terrain = self.host.publisher('terrain_estimate').publish
        self._terrain = self.host.message('terrain_estimate')
        self._terrain.wheel_names = names
        self._terrain.header.frame_id = 'base_link'
        self._publish_odometry = self.host.publisher('odometry').publish
        self._odometry_message = self.host.message('odometry')
        self._odometry_message.header.frame_id = 'odom'
        self._odometry_message.child_frame_id = 'base_link'
        self._pose_covariance = UNOBSERVED * np.eye(6)
        self._odometry = PathOdometry()
        self._start_over()
        self.host.subscription('wheel_states', self._on_wheel_states)
        self.host.subscription('radar', self._on_radar)
        self.host.subscription('gnss_velocity', self._on_gnss_velocity)
        self.host.subscription('gnss', self._on_gnss)

    def _start_over(self):
        """Estimate anew; the distance travelled so far and calibrated radii stay.

        Where that happens on the move, slip is not valid until a speed over ground comes or the
        vehicle stands: without them, slip would be taken for speed.
        """
        self._estimation.reset()
        self._plausibility.reset()
        self._on_the_move = False
        self._calibration.restart()
        self._track.reset()
        self._immobilisation.reset()
        self._yaw = 0.0, math.inf
        self._jumped = False
        self._travelled_t = None
        self._epoch = None
        # Of wheel_states, believed or not.
        self._newest = 0.0
        self._terrain_due = 0.0
        self._odometry_due = 0.0
        self._refused = {}
        self._disbelieved = set()

    def activate(self):
        """Begin with nothing known: the vehicle may have moved meanwhile."""
        self._start_over()
        self.host.set_diagnostic(diagnostic.WARN, 'waiting for wheel_states')

    def _time(self, stamp):
        """Seconds since the first reading; a clock that was set back starts everything over."""
        if self._epoch is not None:
            t = between(self._epoch, stamp)
            if t > self._newest - SlipFilter.LONGEST_GAP:
                self._newest = max(self._newest, t)
                return t
            self.host.get_logger().warning(
                f'time jumped back by {self._newest - t:.3f} s: estimating anew'
            )
            self._start_over()
            self._on_the_move = True
        # A copy: the message may be reused.
        self._epoch = copy.copy(stamp)
        return 0.0

    def _on_wheel_states(self, message):
        if not self.host.active:
            return
        estimation = self._estimation
        try:
            omega = self._speeds.values(message.name, message.velocity)
            torque = self._torques.values(message.name, message.effort)
            t = self._time(message.header.stamp)
            v = estimation.v if estimation.v_valid else math.nan
            self._plausibility.wheels(t, omega, torque, v)
            if estimation.t is not None and t - estimation.t > estimation.LONGEST_GAP:
                self._on_the_move = True
            estimation.wheel_states(t, omega, torque)
        except ValueError as error:
            self._refuse('wheel_states', error)
            return
        self._refused.pop('wheel_states', None)
        # A reading that came late has changed the estimate, not the time.
        if t >= estimation.t:
            self._calibration.wheels(t, omega, estimation.gross_traction)
            self._track.wheels(t, float(estimation.rim_speed.mean()))
            self._travel(t)
            self._watch(t, np.array(omega), np.array(torque))

        if (
            estimation.source is not Source.WHEEL
            or np.abs(estimation.rim_speed).max() < self.host.p.min_speed
        ):
            self._on_the_move = False
        slip = self._slip
        slip.header.stamp = message.header.stamp
        slip.slip = estimation.slip.tolist()
        slip.slip_variance = estimation.slip_variance.tolist()
        slip.valid = [not self._on_the_move and valid for valid in estimation.valid.tolist()]
        slip.wheel_based_speed = estimation.rim_speed.tolist()
        slip.ground_based_speed = estimation.v
        slip.ground_based_speed_variance = estimation.v_variance
        slip.ground_based_speed_valid = estimation.v_valid and not self._on_the_move
        slip.source = int(estimation.source)
        slip.gross_traction = estimation.gross_traction.tolist()
        slip.slip_stiffness = estimation.slip_stiffness.tolist()
        slip.rolling_radius = estimation.rolling_radius.tolist()
        slip.rolling_radius_variance = self._calibration.radius_variance.tolist()
        slip.immobilisation = int(self._immobilisation.level)
        slip.immobilisation_reason = self._immobilisation.reason.value
        slip.time_to_immobilisation = self._immobilisation.time_left
        self._publish_slip(slip)
        if t >= self._terrain_due:
            self._terrain_due = t + 1.0 / self.host.p.terrain_rate - 1e-6
            self._send_terrain(message.header.stamp)
            self._report_health()
        if t >= self._odometry_due:
            self._odometry_due = t + 1.0 / self.host.p.odometry_rate - 1e-6
            self._send_odometry(message.header.stamp)

    def _travel(self, t):
        """Move the pose on."""
        estimation = self._estimation
        before, self._travelled_t = self._travelled_t, t
        if before is None or t - before > estimation.LONGEST_GAP:
            return
        valid = estimation.valid
        slip = float(estimation.slip[valid].mean()) if valid.any() else 0.0
        deviation = 0.0
        if estimation.source is Source.WHEEL:
            # A measured speed does not rest on the radii.
            variance = self._calibration.radius_variance / estimation.rolling_radius**2
            deviation = math.sqrt(variance.mean())
        if self.host.p.track_width:
            rims = estimation.rim_speed
            self._yaw = axle_yaw_rate(
                rims[self._left], rims[self._right], slip, self.host.p.track_width
            )
        self._odometry.advance(
            t - before, estimation.v, estimation.v_variance, slip, deviation, *self._yaw
        )

    def _watch(self, t, omega, torque):
        """Look for signs that the vehicle gets stuck."""
        estimation, watch = self._estimation, self._immobilisation
        before = watch.level
        # It knows nominal radii: rim speeds and forces of the calibrated ones are given so.
        scale = estimation.rolling_radius / self._nominal_radius
        watch.step(
            t,
            estimation.v,
            omega * scale,
            torque / scale,
            estimation.mobilisation,
            estimation.sinkage,
        )
        if watch.level is not before:
            self._report_health()

    def _calibrate(self):
        """Compute with the radii as they are known now."""
        if self.host.p.calibrate_radius:
            radius = self._calibration.radius
            if not np.array_equal(radius, self._estimation.rolling_radius):
                self._estimation.set_rolling_radius(radius)

    def _on_radar(self, message):
        latency = self.host.p.radar_latency
        self._on_speed('radar', self._estimation.radar, GroundSource.RADAR, latency, message)

    def _on_gnss_velocity(self, message):
        latency = self.host.p.gnss_latency
        self._on_speed(
            'gnss_velocity', self._estimation.gnss, GroundSource.VELOCITY, latency, message
        )

    def _on_gnss(self, message):
        # As of a speed.
        if not self.host.active or self._epoch is None:
            return
        track, estimation = self._track, self._estimation
        position = message.pose.pose.position
        t = between(self._epoch, message.header.stamp)
        believed = True
        try:
            self._jumped = not track.fix(t, [position.x, position.y, position.z])
            if math.isfinite(track.reading_variance):
                # The estimate takes the latency away again.
                believed = estimation.gnss(
                    track.speed_t + track.latency, track.reading, track.reading_variance
                )
        except (ValueError, OverflowError) as error:
            self._refuse('gnss', error)
            return
        self._refused.pop('gnss', None)
        self._believe('gnss', believed)
        if self.host.p.calibrate_radius:
            self._calibration.fix(track)
            self._calibrate()

    def _believe(self, topic, believed):
        if believed:
            self._disbelieved.discard(topic)
        else:
            self._disbelieved.add(topic)

    def _on_speed(self, topic, take_in, source, latency, message):
        # Before the first wheel_states there is nothing that the speed could belong to.
        if not self.host.active or self._epoch is None:
            return
        twist = message.twist
        t = between(self._epoch, message.header.stamp)
        plausible = self._plausibility.speed(topic, t, twist.twist.linear.x)
        try:
            believed = plausible and take_in(t, twist.twist.linear.x, twist.covariance[0])
        except ValueError as error:
            self._refuse(topic, error)
            return
        self._refused.pop(topic, None)
        v = twist.twist.linear.x
        if topic == 'radar' and abs(v) < self.host.p.radar_min_speed:
            self._believe(topic, True)
            return
        self._believe(topic, believed)
        if self.host.p.calibrate_radius:
            self._calibration.speed(source, t - latency, v)
            self._calibrate()

    def _send_terrain(self, stamp):
        terrain, estimation = self._terrain, self._estimation
        terrain.header.stamp = stamp
        terrain.max_shear_stress = estimation.max_shear_stress.tolist()
        terrain.max_shear_stress_variance = estimation.max_shear_stress_variance.tolist()
        terrain.shear_deformation_modulus = estimation.shear_deformation_modulus.tolist()
        terrain.shear_deformation_modulus_variance = (
            estimation.shear_deformation_modulus_variance.tolist()
        )
        terrain.gross_traction = estimation.gross_traction.tolist()
        terrain.slip_stiffness = estimation.slip_stiffness.tolist()
        terrain.sinkage = estimation.sinkage.tolist()
        terrain.sinkage_variance = estimation.sinkage_variance.tolist()
        terrain.valid = estimation.strength_known.tolist()
        terrain.external_resistance = estimation.external_resistance
        terrain.external_resistance_variance = estimation.external_resistance_variance
        self._publish_terrain(terrain)

    def _send_odometry(self, stamp):
        message, odometry = self._odometry_message, self._odometry
        message.header.stamp = stamp
        pose, twist = message.pose, message.twist
        pose.pose.position.x = odometry.x
        pose.pose.position.y = odometry.y
        pose.pose.orientation.z = math.sin(0.5 * odometry.yaw)
        pose.pose.orientation.w = math.cos(0.5 * odometry.yaw)
        self._pose_covariance[_PLANAR] = odometry.covariance
        pose.covariance = self._pose_covariance.ravel()
        yaw_rate, yaw_variance = self._yaw
        twist.twist.linear.x = self._estimation.v
        twist.twist.angular.z = yaw_rate
        twist.covariance[0] = self._estimation.v_variance
        twist.covariance[35] = min(yaw_variance, UNOBSERVED)
        self._publish_odometry(message)

    def _refuse(self, what, error):
        self._refused[what] = str(error)
        self._report_health()

    def _report_health(self):
        estimation, watch = self._estimation, self._immobilisation
        if self._refused:
            level, said = diagnostic.ERROR, 'refused: ' + '; '.join(self._refused.values())
        elif watch.level is Level.IMMOBILISED:
            level, said = diagnostic.ERROR, f'immobilised: {watch.reason.value}'
        elif watch.level is Level.WARNING:
            level, said = diagnostic.WARN, f'immobilisation is near: {watch.reason.value}'
        elif self._jumped:
            level, said = diagnostic.WARN, 'gnss has jumped: refused'
        elif self._disbelieved:
            topics = ' and '.join(sorted(self._disbelieved))
            level, said = diagnostic.WARN, f'{topics} against wheels and torque: not believed'
        elif estimation.source is Source.WHEEL:
            level, said = diagnostic.WARN, 'radar silent: slip rests on shaft torque'
        else:
            level, said = diagnostic.OK, 'estimating'
        self.host.set_diagnostic(
            level,
            said,
            ground_speed=estimation.v,
            ground_speed_deviation=math.sqrt(estimation.v_variance),
            gnss_refused=self._track.refused,
            radius_state=self._calibration.state.value if self.host.p.calibrate_radius else 'off',
            time_to_immobilisation=watch.time_left,
        )


def main():
    """Run the node."""
    from traction_node.run import run

    return run(SlipEstimatorBehaviour)
