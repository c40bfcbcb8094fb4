"""Plausibility of tachometers and radar: readings that no wheel and no ground can cause.

A wheel cannot turn up or down faster than its torque and the ground's grip make it, and a wheel
that drives is not slower than the ground. What is measured is never the same to the last bit while
all else changes. Anything beyond that may be slip, and is left to the estimator.
"""

import math
from collections.abc import Sequence

from traction_model.slip import MIN_SPEED
from traction_model.vehicle.vehicle import Vehicle


class ImplausibleError(ValueError):
    """A reading that no vehicle can cause; the text says which and why."""


class _Constancy:
    """Time for which a value is the same to the last bit, weighted by the change of others since.

    A bus has steps of 1 mm/s, which a slow change needs time to cross.
    """

    # Share that others are off up to which time does not count, and at which it does in full.
    _MIN_CHANGE = 0.003
    _CHANGE = 0.02

    def __init__(self) -> None:
        self._value = math.nan
        self._others: Sequence[float] = ()
        self._t = 0.0
        self.readings = 0
        self.time = 0.0

    def take(
        self, t: float, value: float, others: Sequence[float], scales: Sequence[float]
    ) -> None:
        """Take a reading and those of others; their changes count from `scales` up."""
        if value != self._value:
            self._value, self._others = value, others
            self._t, self.readings, self.time = t, 1, 0.0
            return
        self.readings += 1
        change = max(
            abs(now - then) / max(abs(then), scale)
            for now, then, scale in zip(others, self._others, scales, strict=True)
        )
        if change > self._MIN_CHANGE:
            self.time += (t - self._t) * min(change / self._CHANGE, 1.0)
        self._t = t


class Plausibility:
    """Checks readings of tachometers and of speed over ground against each other.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    min_speed : float
        Speed of rim or vehicle up to which it counts as standing, m/s, above 0.
    tachometer_pulses : float
        Pulses per turn that the tachometers count; 0 for ideal ones.
    stuck_time : float
        Time for which a reading may be the same to the last bit while others change, s; 0 for
        ever. It is for changes of 2 %; for smaller ones it is longer in proportion.
        Tachometers that count pulses repeat themselves and are not checked for that.
    """

    # Grip of the ground beyond which nothing is expected, as a share of static load.
    _MAX_GRIP = 1.0
    # Torque beyond which no engine is, as a multiple of static load times radius, and speed of rim
    # or ground, m/s: what lies beyond is no measurement.
    _MAX_TORQUE = 10.0
    _MAX_SPEED = 1000.0
    # Change of speed of a wheel that is always taken, rad/s, and least time that it may have had:
    # stamps of a bus are those of arrival.
    _SMALL_CHANGE = 0.5
    _MIN_TIME = 0.005
    # Pull over static load from which on a wheel counts as driving.
    _DRIVING = 0.05
    # A driving wheel's rim over the ground's speed, at the least: less is not even a wheel on the
    # inside of a narrow bend with a wrong radius.
    _MIN_RATIO = 0.5
    # Ground's speed over that of the fastest driving rim, at the most.
    _MAX_RATIO = 1.3
    # How near a reading has to come to the last that was believed, as a share, and for how long
    # all have to be plausible until they are believed again, s.
    _NEAR = 0.3
    _TRIAL = 0.2
    # Age up to which a speed over ground tells whether the vehicle stands, s.
    _RECENT = 0.5
    # Speed from which on a change counts as a share of it, m/s.
    _SLOW = 1.0
    # Readings that have to be the same, at the least; some buses repeat five times what they
    # measure ten times a second.
    _STUCK_READINGS = 8
    _ALL_STUCK_READINGS = 6
    # Share of `stuck_time` that is enough for all tachometers at once.
    _ALL_STUCK = 0.1

    def __init__(
        self,
        vehicle: Vehicle,
        min_speed: float = MIN_SPEED,
        tachometer_pulses: float = 0.0,
        stuck_time: float = 0.15,
    ) -> None:
        self._names = vehicle.wheel_names
        self._radii = [float(wheel.radius) for wheel in vehicle.wheels]
        self._inertias = [float(wheel.inertia) for wheel in vehicle.wheels]
        self._loads = [float(load) for load in vehicle.static_loads()]
        self._min_speed = min_speed
        self._scales = [
            *(self._SLOW / radius for radius in self._radii),
            *(
                self._DRIVING * load * radius
                for load, radius in zip(self._loads, self._radii, strict=True)
            ),
        ]
        self._pulse = 2.0 * math.pi / tachometer_pulses if tachometer_pulses else 0.0
        self._stuck_time = stuck_time if stuck_time > 0.0 else math.inf
        self.reset()

    def reset(self) -> None:
        """Forget all readings."""
        self._t: float | None = None
        self._omega: list[float] = []
        self._believed: list[float] = []
        self._torque: list[float] = []
        self._cause = ''
        self._implausible_t = -math.inf
        self._wheels = [_Constancy() for _ in self._names]
        self._speeds: dict[str, _Constancy] = {}
        self._ground = 0.0
        self._ground_t = -math.inf

    def wheels(
        self, t: float, omega: Sequence[float], torque: Sequence[float], v: float = math.nan
    ) -> None:
        """Check a reading of the wheels; to be called with every one.

        Once a reading is implausible, those that follow are refused until they are near the
        last that was believed, or the vehicle stands.

        Parameters
        ----------
        t : float
            Time of measurement, s. A reading older than the last is not checked, but refused
            while others are.
        omega : sequence of float
            Wheel speeds, rad/s, forward positive.
        torque : sequence of float
            Shaft torques, N·m, forward positive.
        v : float
            Speed over ground that is expected, m/s; NaN where it is not known.

        Raises
        ------
        ImplausibleError
            Naming the wheel and the reason.
        """
        if self._t is not None and t <= self._t:
            if self._cause:
                raise ImplausibleError(self._cause)
            return
        cause = self._cause_of(t, omega, torque, v)
        self._t, self._omega, self._torque = t, list(omega), list(torque)
        if cause:
            self._cause, self._implausible_t = cause, t
        elif self._cause:
            if not self._back(t, omega):
                self._implausible_t = t
            elif t - self._implausible_t >= self._TRIAL:
                self._cause = ''
        if self._cause:
            raise ImplausibleError(self._cause)
        self._believed = self._omega

    def _cause_of(
        self, t: float, omega: Sequence[float], torque: Sequence[float], v: float
    ) -> str:
        everything = (*omega, *torque)
        for j, name in enumerate(self._names):
            radius, grip = self._radii[j], self._MAX_GRIP * self._loads[j]
            if abs(torque[j]) > self._MAX_TORQUE * self._loads[j] * radius:
                return f"torque of wheel '{name}' is beyond any engine"
            if abs(radius * omega[j]) > self._MAX_SPEED:
                return f"speed of wheel '{name}' is beyond any vehicle"
            if self._t is not None:
                most = (abs(torque[j]) + grip * radius) / self._inertias[j]
                most *= max(t - self._t, self._MIN_TIME)
                if abs(omega[j] - self._omega[j]) > most + self._SMALL_CHANGE + self._pulse:
                    return f"speed of wheel '{name}' jumps beyond what torque and ground can do"
            rim = radius * omega[j]
            pull = torque[j] / radius
            if (
                v * pull > 0.0
                and abs(pull) > self._DRIVING * self._loads[j]
                and math.copysign(1.0, v) * rim < self._MIN_RATIO * abs(v) - self._min_speed
            ):
                return f"wheel '{name}' drives, yet is slower than the ground"
            constancy = self._wheels[j]
            constancy.take(t, omega[j], everything, self._scales)
            if (
                not self._pulse
                and abs(rim) >= self._min_speed
                and constancy.time >= self._stuck_time
                and constancy.readings >= self._STUCK_READINGS
            ):
                return f"speed of wheel '{name}' is stuck"
        if (
            not self._pulse
            and max(abs(r * w) for r, w in zip(self._radii, omega, strict=True)) >= self._min_speed
            and all(
                constancy.readings >= self._ALL_STUCK_READINGS
                and constancy.time >= self._ALL_STUCK * self._stuck_time
                for constancy in self._wheels
            )
        ):
            return 'speeds of all wheels are stuck'
        return ''

    def _back(self, t: float, omega: Sequence[float]) -> bool:
        """True where a reading is what it was before the implausible ones, or of a standstill."""
        rims = [abs(radius * w) for radius, w in zip(self._radii, omega, strict=True)]
        moving = t - self._ground_t <= self._RECENT and abs(self._ground) >= self._min_speed
        if max(rims) < self._min_speed and not moving:
            return True
        return bool(self._believed) and all(
            abs(w - before) <= self._NEAR * abs(before) for w, before in
            zip(omega, self._believed, strict=True)
        )  # fmt: skip

    def speed(self, sensor: str, t: float, v: float) -> bool:
        """Check a reading of the speed over ground; to be called with every one.

        Parameters
        ----------
        sensor : str
            Its name.
        t : float
            Time of measurement, s.
        v : float
            Speed, m/s, forward positive.

        Returns
        -------
        bool
            False where it is not to be believed: faster than all wheels while they drive, or
            than any vehicle, or stuck.
        """
        if not math.isfinite(v) or self._t is None:
            return True
        if abs(v) > self._MAX_SPEED:
            return False
        constancy = self._speeds.setdefault(sensor, _Constancy())
        constancy.take(t, v, tuple(self._omega), self._scales[: len(self._omega)])
        stuck = (
            abs(v) >= self._min_speed
            and constancy.time >= self._stuck_time
            and constancy.readings >= self._STUCK_READINGS
        )
        pull = math.copysign(1.0, v) * sum(
            torque / radius for torque, radius in zip(self._torque, self._radii, strict=True)
        )
        fastest = max(abs(r * w) for r, w in zip(self._radii, self._omega, strict=True))
        driven = pull > self._DRIVING * sum(self._loads)
        if stuck or (driven and abs(v) > self._MAX_RATIO * fastest + self._min_speed):
            return False
        self._ground, self._ground_t = v, t
        return True
