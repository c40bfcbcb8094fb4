"""All bags through estimator, controller and gate in lock step, by function and by command."""

import re

import numpy as np
import pytest
from recorded_bags import AT_MOST, BAGS, BEYOND, NAMES

from traction_evaluation.estimation.estimate_errors import estimate_errors
from tractor_io.bags.reader import BagReader


def test_every_bag_is_judged():
    assert set(NAMES) == set(AT_MOST) | set(BEYOND)


@pytest.mark.parametrize('name', sorted(AT_MOST))
def test_core_meets_ground_truth(name):
    errors = estimate_errors(BAGS / name)
    assert errors.total_slip_rmse <= AT_MOST[name]
    # 95 % of errors belong inside two standard deviations, or more.
    assert errors.within_two_sigma.min() >= 0.90


@pytest.mark.parametrize('name', sorted(BEYOND))
def test_core_beyond_what_it_is_made_for(name):
    assert estimate_errors(BAGS / name).total_slip_rmse <= BEYOND[name]


@pytest.mark.parametrize('name', sorted(set(AT_MOST) - {'wheel_soft_patch'}))
def test_core_meets_ground_truth_with_any_noise(name):
    seeds = [estimate_errors(BAGS / name, radar_seed=seed) for seed in range(3)]
    assert len({errors.total_slip_rmse for errors in seeds}) == 3
    # Nothing is made for one noise: the mean is as good as with the bag's own.
    assert np.mean([errors.total_slip_rmse for errors in seeds]) <= 1.1 * AT_MOST[name]


def test_radar_gap_costs_little():
    window = {'settle': 5.0, 'until': 10.0}
    without = estimate_errors(BAGS / 'tractor_soft_patch', **window)
    gap = estimate_errors(BAGS / 'tractor_soft_patch', radar_gap=(5.0, 10.0), **window)
    assert without.total_slip_rmse < gap.total_slip_rmse <= without.total_slip_rmse + 0.03
    assert gap.samples == without.samples


def test_replay_gives_the_same_numbers_every_time():
    first, second = (estimate_errors(BAGS / 'wheel_torque_sine') for _ in range(2))
    assert first.slip_rmse.tobytes() == second.slip_rmse.tobytes()
    assert first.speed_rmse == second.speed_rmse


def test_command_prints_the_error_of_the_core(traction):
    status, said = traction('replay', BAGS / 'wheel_drawbar')
    assert status == 0
    printed = float(re.search(r'slip RMSE ([0-9.]+)', said).group(1))
    # Printed to four places.
    errors = estimate_errors(BAGS / 'wheel_drawbar')
    assert printed == pytest.approx(errors.total_slip_rmse, abs=6e-5)


@pytest.mark.parametrize(
    ('arguments', 'named'),
    [
        (['replay', 'bags/nowhere'], 'bags/nowhere'),
        (['replay', BAGS / 'wheel_drawbar', '--soil', 'dry_sandd'], "did you mean 'dry_sand'"),
        (['replay', BAGS / 'wheel_drawbar', '--vehicle', 'tractor_4wd'], 'wheel_states'),
        (['replay', BAGS / 'wheel_drawbar', '-p', 'slip_estimator.method=ufk'], "'ukf'"),
        (['plot', BAGS / 'README.md'], 'not a bag'),
    ],
)
def test_command_names_what_is_wrong_with_its_input(arguments, named, traction):
    status, said = traction(*arguments)
    assert status == 2
    assert named in said
    assert 'Traceback' not in said


def test_a_bag_without_ground_truth_is_replayed_and_not_judged(tmp_path, traction):
    from traction_node.quality_of_service import QOS
    from tractor_io.bags.writer import BagWriter

    with (
        BagReader(BAGS / 'wheel_drawbar') as bag,
        BagWriter(tmp_path / 'cut', bag.custom_data) as cut,
    ):
        cut.add_topic('/wheel_states', 'sensor_msgs/msg/JointState', QOS['sensor_data'])
        for message in bag.messages(['wheel_states'], raw=True):
            cut.write('/wheel_states', message.time, message.message)
    status, said = traction('replay', tmp_path / 'cut')
    assert status == 0
    assert 'SHA-256' in said
    assert 'RMSE' not in said


def test_plot_draws_a_bag(tmp_path, traction):
    status, said = traction('plot', BAGS / 'tractor_soft_patch', '-o', tmp_path / 'tractor.png')
    assert status == 0, said
    assert (tmp_path / 'tractor.png').read_bytes().startswith(b'\x89PNG')
