"""Plain filter of measured speeds over ground, beside the slip filter.

State: speed v and acceleration a, where a is a random walk that decays,

    v' = a,  a' = -a/ACCELERATION_TIME + noise.

It uses neither wheels nor torque nor soil. It is the measure of the slip filter: where the soil
model predicts the measured speeds worse than this filter, the model is wrong, for example a torque
of the other sign or an unsuitable nominal soil, and this filter's speed is used instead.
"""

import math

import numpy as np

from traction_model.kernel import kernel

SPEED_TRACK = np.dtype(
    [
        # Time of the state, s; -inf before the first measured speed.
        ('time', float),
        # Speed, m/s, and acceleration, m/s^2, with their covariance.
        ('speed', float),
        ('acceleration', float),
        ('speed_variance', float),
        ('covariance', float),
        ('acceleration_variance', float),
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
# Weight of the newest reading in `excess`, and most that one reading counts; excess above which
# this filter is preferred, and excess below which it no longer is after a time, s. Chosen so that
# the bags of bags/ hardly exceed it.
EXCESS_SHARE, EXCESS_CLIP, MAX_EXCESS = 0.1, 4.0, 1.5
NO_EXCESS, TRIAL = 0.1, 1.0
# Time after which a slip filter with half of that excess restarts again, s.
RESTART = 5.0


@kernel
def advance(track, t):
    """Predict the state at a later time, in place.

    Parameters
    ----------
    track : record
        Record of `SPEED_TRACK`, SI units.
    t : float
        Time, s; an earlier one than that of the state changes nothing.
    """
    dt = t - track.time
    if not 0.0 < dt < math.inf:
        return
    kept = math.exp(-dt / ACCELERATION_TIME)
    gain = ACCELERATION_TIME * (1.0 - kept)
    track.speed += gain * track.acceleration
    track.acceleration *= kept
    track.speed_variance += gain * (2.0 * track.covariance + gain * track.acceleration_variance)
    track.covariance = kept * (track.covariance + gain * track.acceleration_variance)
    track.acceleration_variance = kept**2 * track.acceleration_variance + (
        ACCELERATION_WALK**2 * dt
    )
    # Integral of the random walk within dt.
    track.covariance += ACCELERATION_WALK**2 * dt**2 / 2.0
    track.speed_variance += ACCELERATION_WALK**2 * dt**3 / 3.0
    track.time = t


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
        track.time = t
        track.speed, track.acceleration = v, 0.0
        track.speed_variance, track.covariance = variance, 0.0
        # Stationary variance of the acceleration.
        track.acceleration_variance = 0.5 * ACCELERATION_WALK**2 * ACCELERATION_TIME
        return
    advance(track, t)
    innovation = v - (track.speed + track.acceleration * (t - track.time))
    total = track.speed_variance + variance
    of_speed, of_acceleration = track.speed_variance / total, track.covariance / total
    track.speed += of_speed * innovation
    track.acceleration += of_acceleration * innovation
    track.acceleration_variance -= of_acceleration * track.covariance
    track.covariance *= 1.0 - of_speed
    track.speed_variance *= 1.0 - of_speed


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
    advance(track, t)
    own = v - (track.speed + track.acceleration * (t - track.time))
    expected = track.speed_variance + variance
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
