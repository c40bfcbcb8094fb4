"""Figures of a drive with known figures."""

from pathlib import Path

import numpy as np
import pytest

from traction_evaluation.drives.figures import judge, latency, work
from traction_evaluation.drives.recording import Recording, Series


def series(t, values, delay=0.0):
    t = np.asarray(t, dtype=float)
    return Series(t, np.asarray(values, dtype=float), t + delay)


@pytest.fixture
def drive():
    """Two wheels at 2 m/s for 20 s; slip 0.3 and 0.1, but 0.9 during the first 7 s."""
    t = np.linspace(0.0, 20.0, 2001)
    slip = np.where(t[:, None] < 7.0, 0.9, np.tile([0.3, 0.1], (len(t), 1)))
    return Recording(
        Path('drive'),
        ('rl', 'rr'),
        {
            'wheel_speed': series(t, np.tile([5.0, 4.0], (len(t), 1))),
            'shaft_torque': series(t, np.tile([100.0, 300.0], (len(t), 1))),
            'torque_request': series(t, np.full((len(t), 2), 300.0)),
            'torque': series(t, np.full((len(t), 2), 300.0), delay=0.004),
            'slip': series(t, slip),
            'distance': series(t, 2.0 * t),
        },
    )


def test_work_is_power_over_time(drive):
    # 100 N·m · 5 rad/s + 300 N·m · 4 rad/s = 1700 W, over 20 s 34 kJ.
    t, joules = work(drive)
    assert t[-1] == 20.0
    assert joules[-1] == pytest.approx(34e3)


def test_figures_count_from_the_place_and_slip_from_later(drive):
    # 10 m are reached after 5 s; 2 s later, at 7 s, slip is 0.3 and 0.1.
    figures = judge(drive, 0.2, 10.0, 2.0)
    assert figures.distance == pytest.approx(30.0)
    assert figures.mean_speed == pytest.approx(2.0)
    assert figures.energy_per_metre == pytest.approx(1700.0 / 2.0)
    assert figures.peak_wheel_speed == 5.0
    # Both wheels are off by 0.1, on either side.
    assert figures.slip_rmse == pytest.approx(0.1)
    assert figures.slip_p95 == pytest.approx(0.1)
    assert figures.slip_peak == pytest.approx((0.3, 0.1))


def test_a_drive_that_does_not_get_there_is_not_judged(drive):
    with pytest.raises(ValueError, match=r'got to 40\.0 m, too little to be judged from 39 m'):
        judge(drive, 0.2, 39.0, 2.0)


def test_latency_is_that_of_the_first_answer_under_a_stamp(drive):
    torque = drive['torque']
    again = Series(
        np.append(torque.t, torque.t[-1]),
        np.vstack([torque.values, torque.values[-1:]]),
        np.append(torque.logged, torque.logged[-1] + 1.0),
    )
    delays = latency(Recording(drive.path, drive.wheel_names, {**drive.series, 'torque': again}))
    assert len(delays) == 2001
    assert delays == pytest.approx(0.004)


def test_a_missing_quantity_is_named(drive):
    with pytest.raises(ValueError, match='holds no radar'):
        drive['radar']
