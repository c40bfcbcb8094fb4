"""Field data of others: the rover's radius and jumps in its track, the tractor's slip at work."""

from pathlib import Path

import numpy as np
import pytest

from traction_evaluation.estimation import field_data

# Beside the repository: field data may not be copied into the project.
FOLDER = Path(__file__).resolve().parents[5] / 'shared' / 'data' / 'field'
pytestmark = pytest.mark.skipif(not FOLDER.is_dir(), reason=f'{FOLDER} is not there')


@pytest.mark.parametrize('wrong', [0.94, 1.06])
def test_rover_radius_is_found(wrong):
    figures = field_data.rover(FOLDER, wrong * field_data.ROVER_RADIUS)
    assert figures.found <= 40.0
    assert figures.radius == pytest.approx(field_data.ROVER_RADIUS, rel=0.01)
    assert figures.deviation <= 0.01 * field_data.ROVER_RADIUS
    # The error is consistent with the reported standard deviation.
    assert abs(figures.radius - field_data.ROVER_RADIUS) < 2 * figures.deviation
    assert abs(figures.slip_bias) < 0.01
    assert abs(figures.late_slip_bias) < 0.01


def test_rover_positions_are_hardly_ever_refused_without_jumps():
    figures = field_data.rover(FOLDER)
    # The recording misses positions at 15.9, 21.2 and 40.2 s, where the track goes on by 0.14 m
    # more than it should: these count as jumps, of three positions each until it goes on.
    assert figures.samples == 705
    assert figures.refused <= 10
    assert figures.rebased == 3


def test_a_hundred_jumps_are_refused():
    figures = field_data.rover_jumps(FOLDER)
    assert figures.jumps == 100
    assert figures.refused == 100
    # Between jumps at every fifth position, of the 600 others.
    assert figures.falsely_refused <= 15
    # A jump taken in would be 3 m/s for a tenth of a second.
    assert figures.speed_error < 0.05


def test_jumps_that_stay_are_not_driven():
    figures = field_data.rover_jumps(FOLDER, count=8, lasting=20)
    assert figures.refused >= 3 * figures.jumps
    assert figures.speed_error < 0.05


def test_rover_odometry_beats_its_wheels():
    for wrong in (0.94, 1.06):
        figures = field_data.rover(FOLDER, wrong * field_data.ROVER_RADIUS)
        # Half of the remaining error comes from the time before calibration.
        assert abs(figures.odometry_error) < 0.4 * abs(figures.uncompensated_error)
        assert abs(figures.odometry_error) < 2 * figures.odometry_deviation


@pytest.fixture(scope='module')
def tractors():
    """The tractor's day from a radius too small, as sent, and too large."""
    return [field_data.tractor(FOLDER, start) for start in (0.94, 1.0, 1.06)]


def test_tractor_slip_by_state(tractors):
    for figures in tractors:
        assert figures.slip['W'] == pytest.approx(0.083, abs=0.01)
        assert abs(figures.slip['M']) < 0.015
        assert abs(figures.slip['T']) < 0.015


def test_tractor_slip_rises_with_engine_torque(tractors):
    for figures in tractors:
        assert figures.rank_correlation > 0.5
        assert np.all(np.diff(figures.slip_by_torque) > 0)


def test_tractor_work_is_not_calibrated_away(tractors):
    for figures in tractors:
        # A third of the day, at 8 % slip, nearly all of it seen as pulling.
        assert figures.pulling > 0.9
        assert figures.measured > 50
    # Wherever it starts, it finds the same.
    scales = [figures.scale for figures in tractors]
    assert max(scales) - min(scales) < 0.005
    # From the road on: the tractor starts to move at 4276 s.
    assert all(figures.calibrated < 4276 + 60 for figures in tractors)
