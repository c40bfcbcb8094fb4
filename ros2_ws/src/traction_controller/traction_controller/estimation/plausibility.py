"""Plausibility of readings of tachometers and of speed over ground.

Physical limits: torque and grip bound the acceleration of a wheel, and a driving wheel is not
slower than the ground. A measured value that stays the same to the last bit while others change is
stuck. All other deviations may be slip; the estimator handles them.
"""

import math
from collections.abc import Sequence

from traction_model.slip import MIN_SPEED
from traction_model.vehicle.vehicle import Vehicle


class ImplausibleError(ValueError):
    """Physically impossible reading; the text names sensor and reason."""


class _Constancy:
    """Time since the last change of a value, weighted by the change of others since then.

    The weight allows for the resolution of a bus, 1 mm/s: a slow change needs time to cross a
    step.
    """

    # Relative change of the others below which time does not count, and above which it counts
    # fully.
    _MIN_CHANGE = 0.003
    _CHANGE = 0.02

    # Share of the longest time without a change that stays after each change.
    _HELD = 0.9
    # The same time after a standstill, s, when the next pulse may be far.
    _FIRST_HELD = 0.5

    def __init__(self) -> None:
        self._value = math.nan
        self._others: Sequence[float] = ()
        self._t = self._since = 0.0
        self._usual = 0.0
        self.readings = 0
        self.time = 0.0

    def take(
        self,
        t: float,
        value: float,
        others: Sequence[float],
        scales: Sequence[float],
        step: float = 0.0,
    ) -> None:
        """Add a reading and those of others, whose changes are relative to at least `scales`.

        A value with a resolution of `step` cannot follow changes of less than two steps.
        """
        if value != self._value:
            held = self._t - self._since if self._value else self._FIRST_HELD
            self._usual = max(self._HELD * self._usual, held)
            self._value, self._others = value, others
            self._t = self._since = t
            self.readings, self.time = 1, 0.0
            return
        self.readings += 1
        change = max(
            abs(now - then) / max(abs(then), scale)
            for now, then, scale in zip(others, self._others, scales, strict=True)
        )
        # Tachometers that measure the period of pulses hold a value until the next pulse.
        held = t - self._since > 2.0 * self._usual
        if held and change > self._MIN_CHANGE and change * abs(value) > 2.0 * step:
            self.time += (t - self._t) * min(change / self._CHANGE, 1.0)
        self._t = t


class Plausibility:
    """Check of tachometers and speed over ground against physical limits and each other.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle, SI units.
    min_speed : float
        Speed of rim or vehicle below which it counts as standing, m/s, above 0.
    stuck_time : float
        Time for which a reading may be the same to the last bit while others change by 2 %, s; 0
        disables the check. For smaller changes the time is longer in proportion.
    """

    # Largest grip of the ground, over static load.
    _MAX_GRIP = 1.0
    # Largest possible torque, over static load times radius, and largest speed of rim or ground,
    # m/s.
    _MAX_TORQUE = 10.0
    _MAX_SPEED = 1000.0
    # Change of wheel speed that is always accepted, rad/s, and shortest and longest interval
    # assumed for a change, s: a bus stamps the time of arrival, and no wheel speeds up for long.
    _SMALL_CHANGE = 0.5
    _MIN_TIME, _MAX_TIME = 0.005, 0.03
    # Mean change from reading to reading: weight of the newest, its largest value, rad/s, and
    # largest accepted multiple of the mean.
    _SCATTER_SHARE, _MAX_SCATTER, _SCATTER = 0.02, 5.0, 3.0
    # Time constant of the mean speed of a wheel with counted pulses, s.
    _SMOOTHING = 0.1
    # Pull over static load above which a wheel counts as driving.
    _DRIVING = 0.05
    # Smallest rim over ground speed of a driving wheel. Narrow bends and wrong radii stay above
    # it.
    _MIN_RATIO = 0.5
    # Largest ground speed over that of the fastest driving rim.
    _MAX_RATIO = 1.3
    # Readings are accepted again after a time of plausible readings, s, that are near the last
    # accepted one (relative distance) or near the speed over ground (from, to, as shares of it).
    _NEAR = 0.3
    _NEAR_GROUND = (0.7, 2.0)
    _TRIAL = 0.2
    # The same time for wheels that only agree with each other while none drives, s.
    _AGREEING_TRIAL = 2.0
    # Largest age of a speed over ground for these checks, s.
    _RECENT = 0.5
    # Speed above which changes are relative to the speed, m/s.
    _SLOW = 1.0
    # Speed over ground of a sensor without direction, over that of every rim: from, to. A vehicle
    # that slides against its wheels has it at most for moments.
    _SAME_SIZE = (0.5, 1.1)
    # Share of `min_speed` above which signs are compared: less is noise.
    _SIGNED = 0.3
    # Smallest number of equal readings of a stuck sensor; some buses repeat a value of 10 Hz five
    # times.
    _STUCK_READINGS = 8
    _ALL_STUCK_READINGS = 6
    # Share of `stuck_time` after which all tachometers together count as stuck.
    _ALL_STUCK = 0.1

    def __init__(
        self, vehicle: Vehicle, min_speed: float = MIN_SPEED, stuck_time: float = 0.15
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
        self._stuck_time = stuck_time if stuck_time > 0.0 else math.inf
        self.reset()

    def reset(self) -> None:
        """Clear all readings."""
        n = len(self._names)
        self._t: float | None = None
        self._omega: list[float] = []
        self._accepted: list[float] = []
        self._torque: list[float] = []
        # Mean speed, rad/s, its largest error due to counted pulses, rad/s, and time of the last
        # pulse, s.
        self._mean: list[float] = []
        self._open = [0.0] * n
        self._pulse_t = [0.0] * n
        self._scatter = [0.0] * n
        self._cause = ''
        self._implausible_t = -math.inf
        self._apart_t = -math.inf
        self._wheels = [_Constancy() for _ in self._names]
        self._speeds: dict[str, _Constancy] = {}
        self._ground = 0.0
        self._ground_t = -math.inf
        # Time of the newest speed over ground that shows tachometers without sign, s.
        self._unsigned_t = -math.inf

    def wheels(
        self,
        t: float,
        omega: Sequence[float],
        torque: Sequence[float],
        v: float = math.nan,
        step: Sequence[float] = (),
    ) -> None:
        """Check a reading of the wheels; call it with every reading.

        After an implausible reading the following ones are rejected until they are plausible and
        near the last accepted one, near the speed over ground, or near each other while no wheel
        drives; or until the vehicle stands.

        Parameters
        ----------
        t : float
            Time of measurement, s. A reading older than the last is not checked; it is rejected
            while others are.
        omega : sequence of float
            Wheel speeds, rad/s, forward positive.
        torque : sequence of float
            Shaft torques, N·m, forward positive.
        v : float
            Expected speed over ground, m/s; NaN if unknown.
        step : sequence of float
            Resolution of each tachometer, rad/s, at least 0, see `Tachometers`; empty for ideal
            ones.

        Raises
        ------
        ImplausibleError
            If the reading is rejected; the text names wheel and reason.
        """
        if self._t is not None and t <= self._t:
            if self._cause:
                raise ImplausibleError(self._cause)
            return
        step = step or [0.0] * len(omega)
        self._follow_means(t, omega, step)
        cause = self._cause_of(t, omega, torque, v, step)
        self._t, self._omega, self._torque = t, list(omega), list(torque)
        if cause:
            self._cause, self._implausible_t, self._apart_t = cause, t, t
        elif self._cause:
            if not self._agree(t):
                self._apart_t = t
            if not self._back(t, omega):
                self._implausible_t = t
            elif t - self._implausible_t >= self._TRIAL:
                self._cause = ''
            if t - self._apart_t >= self._AGREEING_TRIAL:
                self._cause = ''
        if self._cause:
            raise ImplausibleError(self._cause)
        self._accepted = self._omega

    def _follow_means(self, t: float, omega: Sequence[float], step: Sequence[float]) -> None:
        """Update the mean speeds of wheels with counted pulses; others are as measured."""
        if self._t is None:
            self._mean = list(omega)
            self._open = list(step)
            self._pulse_t = [t] * len(omega)
            return
        dt = t - self._t
        share = 1.0 - math.exp(-dt / self._SMOOTHING)
        for j, reading in enumerate(omega):
            if reading or not step[j]:
                self._pulse_t[j] = t
            if not step[j]:
                self._mean[j], self._open[j] = reading, 0.0
                continue
            self._mean[j] += share * (reading - self._mean[j])
            self._open[j] = max(share * step[j], (1.0 - share) * self._open[j])
            if t > self._pulse_t[j]:
                # Without a pulse for a time T the speed is at most one pulse over T.
                fastest = step[j] * dt / (t - self._pulse_t[j])
                self._mean[j] = max(-fastest, min(fastest, self._mean[j]))
                self._open[j] = min(self._open[j], fastest)

    def _cause_of(
        self,
        t: float,
        omega: Sequence[float],
        torque: Sequence[float],
        v: float,
        step: Sequence[float],
    ) -> str:
        if t - self._unsigned_t <= self._RECENT:
            return 'speeds of all wheels have no sign: torque and ground have the other one'
        everything = (*omega, *torque)
        stuck = 0
        for j, name in enumerate(self._names):
            radius, grip = self._radii[j], self._MAX_GRIP * self._loads[j]
            if abs(torque[j]) > self._MAX_TORQUE * self._loads[j] * radius:
                return f"torque of wheel '{name}' is beyond any engine"
            if abs(radius * omega[j]) > self._MAX_SPEED:
                return f"speed of wheel '{name}' is beyond any vehicle"
            if self._t is not None:
                most = (abs(torque[j]) + grip * radius) / self._inertias[j]
                most *= min(max(t - self._t, self._MIN_TIME), self._MAX_TIME)
                change = abs(omega[j] - self._omega[j])
                # Counts at the same speed differ by less than two pulses.
                most += self._SMALL_CHANGE + 2.0 * step[j] + self._SCATTER * self._scatter[j]
                self._scatter[j] += self._SCATTER_SHARE * (
                    min(change, self._MAX_SCATTER) - self._scatter[j]
                )
                if change > most:
                    return f"speed of wheel '{name}' jumps beyond what torque and ground can do"
            rim = math.copysign(radius, v) * self._mean[j]
            pull = torque[j] / radius
            if (
                v * pull > 0.0
                and abs(pull) > self._DRIVING * self._loads[j]
                and rim + radius * self._open[j] < self._MIN_RATIO * abs(v) - self._min_speed
            ):
                return f"wheel '{name}' drives, yet is slower than the ground"
            constancy = self._wheels[j]
            constancy.take(t, omega[j], everything, self._scales, step[j])
            if (
                abs(rim) >= self._min_speed
                and constancy.time >= self._stuck_time
                and constancy.readings >= self._STUCK_READINGS
            ):
                return f"speed of wheel '{name}' is stuck"
            stuck += (
                constancy.readings >= self._ALL_STUCK_READINGS
                and constancy.time >= self._ALL_STUCK * self._stuck_time
            )
        fastest = max(abs(r * w) for r, w in zip(self._radii, omega, strict=True))
        if stuck == len(self._names) and fastest >= self._min_speed:
            return 'speeds of all wheels are stuck'
        return ''

    def _rims(self) -> list[tuple[float, float]]:
        """Speed of every rim and its largest error due to counted pulses, m/s."""
        return [
            (radius * mean, radius * open_)
            for radius, mean, open_ in zip(self._radii, self._mean, self._open, strict=True)
        ]

    def _back(self, t: float, omega: Sequence[float]) -> bool:
        """True if a reading is near the last accepted one or the ground, or a standstill."""
        rims = self._rims()
        known = t - self._ground_t <= self._RECENT
        ground = abs(self._ground)
        stands = max(abs(rim) - off for rim, off in rims) < self._min_speed
        if stands and not (known and ground >= self._min_speed):
            return True
        low, high = self._NEAR_GROUND
        if known and all(
            low * ground - off - self._min_speed
            <= math.copysign(1.0, self._ground) * rim
            <= high * ground + off + self._min_speed
            for rim, off in rims
        ):
            return True
        return bool(self._accepted) and all(
            abs(w - before) <= self._NEAR * abs(before)
            for w, before in zip(omega, self._accepted, strict=True)
        )

    def _agree(self, t: float) -> bool:
        """True if rims are near each other, and no wheel drives or the ground is unknown."""
        known = t - self._ground_t <= self._RECENT
        drives = any(
            abs(torque) > self._DRIVING * load * radius
            for torque, load, radius in zip(self._torque, self._loads, self._radii, strict=True)
        )
        rims = self._rims()
        mean = sum(rim for rim, _ in rims) / len(rims)
        return not (known and drives) and all(
            abs(rim - mean) <= self._NEAR * abs(mean) + off + self._min_speed for rim, off in rims
        )

    def speed(self, sensor: str, t: float, v: float) -> str:
        """Check a reading of the speed over ground; call it with every reading.

        Parameters
        ----------
        sensor : str
            Name of the sensor.
        t : float
            Time of measurement, s.
        v : float
            Speed, m/s, forward positive.

        Returns
        -------
        str
            Why it is implausible: faster than all wheels while they drive, faster than any
            vehicle, stuck, or of the other sign than all wheels; '' if it is plausible. If the
            torque, too, has the other sign than the wheels, these are rejected instead.
        """
        if not math.isfinite(v) or self._t is None:
            return ''
        if abs(v) > self._MAX_SPEED:
            return 'is faster than any vehicle'
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
        unsigned = self._other_sign(v)
        if unsigned and (driven or t - self._unsigned_t <= self._RECENT):
            self._unsigned_t = t
            unsigned = False
        if stuck:
            return 'is stuck'
        if unsigned:
            return 'has no sign: the wheels turn the other way'
        if driven and abs(v) > self._MAX_RATIO * fastest + self._min_speed:
            return 'is faster than all wheels while they drive'
        self._ground, self._ground_t = v, t
        return ''

    def _other_sign(self, v: float) -> bool:
        """True if a speed is that of all rims but for its sign, as of an unsigned radar."""
        low, high = self._SAME_SIZE
        rims = [rim for rim, _ in self._rims()]
        return abs(v) >= self._SIGNED * self._min_speed and all(
            low * abs(rim) <= abs(v) <= high * abs(rim) and v * rim < 0.0 for rim in rims
        )
