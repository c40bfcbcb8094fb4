"""Trust in a sensor of the speed over ground, from its own record.

A vehicle changes its speed no faster than ground and torque allow. A sensor whose reading departs
from that within one period has failed, not the vehicle: its readings are rejected until they are
near the estimate again, agree with another sensor, or imply a slip that wheels can have. A reading
that departs slowly, over many periods, shows an error of the soil model instead.
"""

import math

import numpy as np

from traction_model.kernel import kernel

SENSOR_MEMORY = np.dtype(
    [
        # Newest reading: time, s, and speed, m/s; speed by integrated acceleration then, m/s.
        ('time', float),
        ('speed', float),
        ('reckoned', float),
        # Variance of readings as found from their changes, m^2/s^2.
        ('scatter', float),
        # 1 while the sensor is not trusted; time of the last reading that could not be, s; and
        # consecutive readings near the estimate.
        ('suspect', float),
        ('implausible_time', float),
        ('near', float),
        # Newest reading outside the gate: time, s, speed, m/s, and count of consistent ones.
        ('refused_time', float),
        ('refused_speed', float),
        ('refused_in_a_row', float),
    ],
    align=True,
)
"""Record of one sensor of the speed over ground, SI units."""

# Largest change between two readings beyond the expected one: standard deviations of their
# difference, and error of the expected acceleration, m/s^2. Changes are judged over at most a
# time, s.
JUMP, ACCELERATION_ERROR, MAX_INTERVAL = 5.0, 3.0, 0.5
# Weight of the newest change in the scatter, and largest multiple of the mean that one counts.
SCATTER_SHARE, SCATTER_CLIP = 0.05, 25.0


@kernel
def follow(record, t, v, reckoned, variance):
    """Update the record of a sensor with a reading, in place.

    Parameters
    ----------
    record : record
        Record of `SENSOR_MEMORY`, SI units.
    t : float
        Time of measurement, s.
    v : float
        Speed, m/s, forward positive.
    reckoned : float
        Integral of the estimated acceleration, m/s.
    variance : float
        Variance of the reading as stated, m^2/s^2, above 0.

    Returns
    -------
    bool
        True if the speed jumped beyond what a vehicle can do.
    """
    dt = t - record.time
    jumped = False
    if 0.0 < dt <= MAX_INTERVAL:
        change = (v - record.speed) - (reckoned - record.reckoned)
        deviation = math.sqrt(2.0 * record.scatter)
        jumped = abs(change) > JUMP * deviation + ACCELERATION_ERROR * dt
        seen = min(0.5 * change**2, SCATTER_CLIP * record.scatter)
        record.scatter += SCATTER_SHARE * (seen - record.scatter)
    elif dt > 0.0:
        record.scatter = max(record.scatter, variance)
    if dt > 0.0:
        record.time, record.speed, record.reckoned = t, v, reckoned
    return jumped
