"""Plain filter of measured speeds over ground, beside the slip filter.

State: speed v, acceleration a, which is a random walk that decays, and offset o of an
accelerometer, which is a random walk,

    v' = a,  a' = -a/ACCELERATION_TIME + noise,  o' = -g*pitch_rate + noise.

An accelerometer along the vehicle measures a + o: the offset has its bias, its mounting and the
grade, g*sin(slope). The filter uses neither wheels nor torque nor soil. It is the measure of the
slip filter: where the soil model predicts the measured speeds worse than this filter, the model is
wrong, for example a torque of the other sign or an unsuitable nominal soil. Then the speed of this
filter is used instead.
"""

import math

import numpy as np

from traction_controller.estimation.kalman import optimal_gain, reset_entry, update
from traction_model.kernel import kernel
from traction_model.vehicle.vehicle import GRAVITY

# State of the filter.
SPEED, ACCELERATION, OFFSET = range(3)

SPEED_TRACK = np.dtype(
    [
        # Time of the state, s; -inf before the first measured speed.
        ('time', float),
        # Speed, m/s, acceleration and offset, m/s^2, and their covariance.
        ('x', float, (3,)),
        ('p', float, (3, 3)),
        # Mean square error of the slip filter's predictions beyond that of this filter's, as a
        # share of the expected one.
        ('excess', float),
        # 1 while this filter is preferred; time since which the slip filter is not worse, and of
        # its newest restart, s.
        ('preferred', float),
        ('not_worse_since', float),
        ('restarted_at', float),
    ],
    align=True,
)
"""State of the plain filter, SI units."""

# Random walk of the acceleration, m/s^2 per sqrt(s), and time constant of its decay, s. Chosen on
# the runs of a single wheel in bags/.
ACCELERATION_WALK, ACCELERATION_TIME = 1.0, 2.0
# Offset of an accelerometer: initial standard deviation, m/s^2, and random walk, m/s^2 per
# sqrt(s).
OFFSET_UNKNOWN, OFFSET_WALK = 1.0, 0.02
# Time for which an unknown bias of the rate of pitch counts as a random walk, s.
BIAS_TIME = 1.0
# Standard deviation of the acceleration at standstill, m/s^2.
REST_DEVIATION = 0.05
# Weight of the newest reading in `excess`, and most that one reading counts; excess above which
# this filter is preferred, and excess below which it no longer is after a time, s. Chosen so that
# the bags of bags/ hardly exceed it.
EXCESS_SHARE, EXCESS_CLIP, MAX_EXCESS = 0.1, 4.0, 1.5
NO_EXCESS, TRIAL = 0.1, 1.0
# Time after which a slip filter with half of that excess restarts again, s.
RESTART = 5.0


@kernel
def start(track, t, v, variance):
    """Initialise with a speed, in place; the offset and its variance are kept.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units.
    t : float
        Time, s.
    v : float
        Speed, m/s, forward positive.
    variance : float
        Its variance, m^2/s^2, above 0.
    """
    track.time = t
    track.x[SPEED], track.x[ACCELERATION] = v, 0.0
    reset_entry(track.p, SPEED, variance)
    # Stationary variance of the acceleration.
    reset_entry(track.p, ACCELERATION, 0.5 * ACCELERATION_WALK**2 * ACCELERATION_TIME)
    if track.p[OFFSET, OFFSET] == 0.0:
        track.p[OFFSET, OFFSET] = OFFSET_UNKNOWN**2


@kernel
def advance(track, t, pitch_rate, bias_variance):
    """Predict the state at a later time, in place.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units.
    t : float
        Time, s; an earlier one than that of the state changes nothing.
    pitch_rate : float
        Rate of pitch, rad/s, nose down positive (REP-103); 0 if it is not measured.
    bias_variance : float
        Variance of its bias, rad^2/s^2.
    """
    dt = t - track.time
    if not 0.0 < dt < math.inf:
        return
    x, p = track.x, track.p
    kept = math.exp(-dt / ACCELERATION_TIME)
    gain = ACCELERATION_TIME * (1.0 - kept)
    x[SPEED] += gain * x[ACCELERATION]
    x[ACCELERATION] *= kept
    x[OFFSET] -= GRAVITY * pitch_rate * dt
    # P = F*P*F': rows, then columns.
    for b in range(3):
        p[SPEED, b] += gain * p[ACCELERATION, b]
        p[ACCELERATION, b] *= kept
    for a in range(3):
        p[a, SPEED] += gain * p[a, ACCELERATION]
        p[a, ACCELERATION] *= kept
    # Integrals of the random walk of the acceleration within dt.
    walk = ACCELERATION_WALK**2
    p[SPEED, SPEED] += walk * dt**3 / 3.0
    p[SPEED, ACCELERATION] += walk * dt**2 / 2.0
    p[ACCELERATION, SPEED] += walk * dt**2 / 2.0
    p[ACCELERATION, ACCELERATION] += walk * dt
    p[OFFSET, OFFSET] += (OFFSET_WALK**2 + GRAVITY**2 * bias_variance * BIAS_TIME) * dt
    track.time = t


@kernel
def expected_speed(track, t):
    """Speed at a time near that of the state.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units.
    t : float
        Time, s.

    Returns
    -------
    float
        Speed, m/s, forward positive.
    """
    return track.x[SPEED] + track.x[ACCELERATION] * (t - track.time)


@kernel
def measure(track, t, v, variance):
    """Update with a measured speed, in place.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units.
    t : float
        Time of measurement, s. A reading older than the state is compared with the state
        extrapolated back to it.
    v : float
        Speed, m/s, forward positive.
    variance : float
        Its variance, m^2/s^2, above 0.
    """
    if track.time == -math.inf:
        start(track, t, v, variance)
        return
    advance(track, t, 0.0, 0.0)
    h = np.zeros(3)
    h[SPEED] = 1.0
    gain = np.empty(3)
    optimal_gain(track.p, h, variance, gain)
    update(track.x, track.p, h, gain, v - expected_speed(track, t), variance)


@kernel
def accelerate(track, t, measured, variance, pitch_rate, bias_variance):
    """Update with a reading of an accelerometer, in place.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units; before the first speed nothing is changed.
    t : float
        Time of measurement, s.
    measured : float
        Specific force along the vehicle, m/s^2, forward positive.
    variance : float
        Its variance, m^2/s^4, above 0.
    pitch_rate : float
        Rate of pitch, rad/s, nose down positive (REP-103); 0 if it is not measured.
    bias_variance : float
        Variance of its bias, rad^2/s^2.
    """
    if track.time == -math.inf:
        return
    advance(track, t, pitch_rate, bias_variance)
    h = np.ones(3)
    h[SPEED] = 0.0
    gain = np.empty(3)
    optimal_gain(track.p, h, variance, gain)
    innovation = measured - track.x[ACCELERATION] - track.x[OFFSET]
    update(track.x, track.p, h, gain, innovation, variance)


@kernel
def rest(track, t):
    """Update at standstill: the acceleration is 0, so that the offset is found, in place.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units; before the first speed nothing is changed.
    t : float
        Time, s.
    """
    if track.time == -math.inf:
        return
    advance(track, t, 0.0, 0.0)
    h = np.zeros(3)
    h[ACCELERATION] = 1.0
    gain = np.empty(3)
    optimal_gain(track.p, h, REST_DEVIATION**2, gain)
    update(track.x, track.p, h, gain, -track.x[ACCELERATION], REST_DEVIATION**2)


@kernel
def compare(track, t, v, variance, predicted):
    """Compare the predictions of both filters with a measured speed, before `measure`, in place.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units.
    t : float
        Time of measurement, s.
    v : float
        Speed, m/s, forward positive.
    variance : float
        Its variance, m^2/s^2, above 0.
    predicted : float
        Prediction of the slip filter, m/s.

    Returns
    -------
    bool
        True if the slip filter shall forget soil and drawbar with this reading: this filter
        becomes preferred, or has been so for a time.
    """
    if track.time == -math.inf:
        return False
    advance(track, t, 0.0, 0.0)
    own = v - expected_speed(track, t)
    expected = track.p[SPEED, SPEED] + variance
    worse = ((v - predicted) ** 2 - own**2) / expected
    worse = max(-EXCESS_CLIP, min(EXCESS_CLIP, worse))
    track.excess += EXCESS_SHARE * (worse - track.excess)
    if track.excess > NO_EXCESS:
        track.not_worse_since = t
    if track.preferred == 0.0:
        restarts = track.excess > MAX_EXCESS
    else:
        restarts = 2.0 * track.excess > MAX_EXCESS and t - track.restarted_at >= RESTART
        if t - track.not_worse_since >= TRIAL:
            track.preferred = 0.0
    if restarts:
        track.preferred, track.restarted_at = 1.0, t
        track.excess = MAX_EXCESS
    return restarts
