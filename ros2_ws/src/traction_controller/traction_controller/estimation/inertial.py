"""Readings of an inertial measurement unit, averaged between readings of the wheels."""

import math

from traction_controller.estimation.slip_filter import Motion


class InertialUnit:
    """Inertial measurement unit with unknown biases of its rates, which it finds at standstill.

    Attributes
    ----------
    yaw_rate : float
        Newest rate of yaw without bias, rad/s, counter-clockwise positive.
    """

    # Variance of an acceleration without a stated one, m^2/s^4: lugs and engine shake the chassis.
    _VARIANCE = 0.04

    # Age up to which a reading is used, s.
    _RECENT = 0.1
    # Largest specific force, m/s^2, and largest rate, rad/s, of a vehicle.
    _MAX_ACCELERATION, _MAX_RATE = 50.0, 10.0
    # Time constant of the biases at standstill, s; their initial and their smallest standard
    # deviation, rad/s, and random walk, rad/s per sqrt(s); standard deviation of a reading, rad/s.
    _BIAS_TIME = 1.0
    _BIAS_UNKNOWN, _BIAS_KNOWN, _BIAS_WALK, _NOISE = 0.01, 5e-4, 1e-4, 0.005
    # Time at rest before the biases are found, s: the chassis swings.
    _SETTLING = 0.5

    def __init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Forget all readings and the bias."""
        self.yaw_rate = self._pitch_rate = 0.0
        self._yaw_bias = self._pitch_bias = 0.0
        self._bias_variance = self._BIAS_UNKNOWN**2
        self._t = -math.inf
        self._rest_since: float | None = None
        self._followed_t = 0.0
        self._clear()

    def _clear(self) -> None:
        self._count = 0
        self._acceleration = self._variance = self._yaw_rates = self._pitch_rates = 0.0

    @property
    def yaw_rate_variance(self) -> float:
        """Variance of `yaw_rate`, rad^2/s^2."""
        return self._NOISE**2 + self._bias_variance

    def alive(self, t: float) -> bool:
        """True if a reading is recent.

        Parameters
        ----------
        t : float
            Time, s.
        """
        return abs(t - self._t) <= self._RECENT

    def add(
        self, t: float, acceleration: float, variance: float, yaw_rate: float, pitch_rate: float
    ) -> None:
        """Add a reading.

        Parameters
        ----------
        t : float
            Time of measurement, s, after that of the last one.
        acceleration : float
            Specific force along the vehicle, m/s^2, forward positive.
        variance : float
            Its variance, m^2/s^4; 0: not known, 0.04 is used.
        yaw_rate, pitch_rate : float
            Rates of yaw, counter-clockwise positive, and of pitch, nose down positive, rad/s.

        Raises
        ------
        ValueError
            If a value is not finite or beyond any vehicle, the variance is negative, or the stamp
            does not advance. Nothing is changed then.
        """
        for name, value, most in (
            ('acceleration', acceleration, self._MAX_ACCELERATION),
            ('yaw rate', yaw_rate, self._MAX_RATE),
            ('pitch rate', pitch_rate, self._MAX_RATE),
        ):
            if not abs(value) <= most:
                raise ValueError(f'{name} of imu is {value}')
        if not (math.isfinite(variance) and variance >= 0.0):
            raise ValueError(f'variance of imu is {variance} m^2/s^4')
        if not t > self._t:
            raise ValueError(f'stamp of imu does not advance: {t:.6f} s again')
        self._t = t
        self._count += 1
        self._acceleration += acceleration
        self._variance += variance or self._VARIANCE
        self._yaw_rates += yaw_rate
        self._pitch_rates += pitch_rate

    def take(self, t: float) -> Motion | None:
        """Mean of the readings since the last call.

        Parameters
        ----------
        t : float
            Time of a reading of the wheels, s.

        Returns
        -------
        Motion or None
            SI units, rates without bias; None without readings.
        """
        if not self._count or not self.alive(t):
            self._clear()
            return None
        n = self._count
        self.yaw_rate = self._yaw_rates / n - self._yaw_bias
        self._pitch_rate = self._pitch_rates / n - self._pitch_bias
        motion = Motion(
            self._acceleration / n, self._variance / n**2, self.yaw_rate, self._pitch_rate,
            self._bias_variance,
        )  # fmt: skip
        self._clear()
        return motion

    def note_rest(self, t: float, rests: bool) -> None:
        """Follow the biases at standstill.

        Parameters
        ----------
        t : float
            Time of a reading of the wheels, s.
        rests : bool
            True if no wheel moves.
        """
        dt, self._followed_t = t - self._followed_t, t
        if not rests or not self.alive(t):
            self._rest_since = None
            self._bias_variance += self._BIAS_WALK**2 * max(dt, 0.0)
            return
        if self._rest_since is None:
            self._rest_since = t
        if t - self._rest_since < self._SETTLING or dt <= 0.0:
            return
        share = 1.0 - math.exp(-dt / self._BIAS_TIME)
        self._yaw_bias += share * self.yaw_rate
        self._pitch_bias += share * self._pitch_rate
        self._bias_variance += share * (self._BIAS_KNOWN**2 - self._bias_variance)
