"""Figures of the demo against the README."""

import pytest

from traction_evaluation.drives.figures import judge, latency
from traction_evaluation.drives.recording import read_recording

pytestmark = pytest.mark.process

TARGET = 0.2
# Rear axle on the soft patch, m along the path; evaluated 2 s later.
SOFT_FROM = 15.0
# It arrives there after about 9 s.
DURATION = 15.0


@pytest.fixture(scope='module')
def drives(tmp_path_factory, traction):
    """Both drives of a demo of the shortest sufficient duration."""
    folder = tmp_path_factory.mktemp('demo')
    status, said = traction('demo', '--folder', folder, '--duration', DURATION)
    assert status == 0, said
    [made] = folder.iterdir()
    assert (made / 'demo.png').read_bytes().startswith(b'\x89PNG')
    for what in ('energy per metre', 'command latency, p99', 'demo.png', 'with_control'):
        assert what in said
    return [read_recording(made / name) for name in ('without_control', 'with_control')]


def test_control_keeps_slip_and_saves_energy(drives):
    without, controlled = (judge(drive, TARGET, SOFT_FROM, 2.0) for drive in drives)
    assert controlled.slip_p95 <= 0.03
    assert max(without.slip_peak) > 0.4
    assert controlled.energy_per_metre < without.energy_per_metre
    assert controlled.mean_speed > without.mean_speed


def test_the_bags_hold_the_whole_drive_at_its_rate(drives):
    for drive in drives:
        # From the first request, with torque still at zero, to the last.
        assert drive['torque_command'].values[0].max() < 100.0
        assert drive.end == pytest.approx(DURATION, abs=0.5)
        # All at 100 Hz; but on a busy machine nodes skip readings when they wait for a core.
        for quantity, least in (('wheel_speed', 90.0), ('slip_estimate', 70.0), ('torque', 70.0)):
            assert least < drive.rate(quantity) < 105.0, quantity
        assert len(latency(drive)) > 0.6 * 100.0 * DURATION
