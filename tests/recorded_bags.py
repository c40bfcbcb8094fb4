"""The bags of the repository, for all tests across packages."""

from pathlib import Path

BAGS = Path(__file__).resolve().parents[1] / 'bags'
"""Folder of the bags."""

NAMES = sorted(path.parent.name for path in BAGS.glob('*/metadata.yaml'))
"""Their names, sorted."""

# The radar's noise of 0.05 m/s at the speeds of these runs is 0.012 to 0.05 of slip; the
# estimator has to do better than that by what it knows of torque and inertia.
AT_MOST = {
    'wheel_drawbar': 0.01,
    'wheel_torque_sine': 0.01,
    'tractor_sandy_loam': 0.01,
    'tractor_soft_patch': 0.01,
    # Down to 0.9 m/s, where one reading's noise is 0.06 of slip.
    'wheel_soft_patch': 0.015,
    # At 30 to 56 m/s a radar is good to a thousandth of slip or two.
    'wheel_low_slip': 0.01,
    'wheel_high_slip': 0.01,
}
"""RMSE of slip that the estimator is held to in lock step, dimensionless."""

BEYOND = {
    # Slip goes to -0.93 and back within a second.
    'tractor_braked': 0.015,
    # The stepped wheels ring by 0.05 to 0.1 rad/s, some hundredths of slip at 0.6 m/s.
    'tractor_steps_medium': 0.015,
    'tractor_steps_slow': 0.045,
    # It goes straight ahead: outer wheels are 0.8 m*yaw rate faster than it takes them for, inner
    # ones slower, up to 8 % of the speed.
    'turn_left': 0.07,
    'turn_slalom': 0.05,
    'turn_pull': 0.09,
}
"""RMSE of slip on bags that the estimator is not made for, as it is, dimensionless."""
