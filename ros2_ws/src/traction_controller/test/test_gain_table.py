"""Certificates and gain tables: checks of the guarantee, rejection of changed files."""

import math
import timeit

import numpy as np
import pytest
import yaml

from traction_controller.synthesis.certificate import (
    Certificate,
    CertificateError,
    LoopDesign,
    check,
    closed_loop,
    margins,
)
from traction_controller.synthesis.gain_table import (
    GainTable,
    GainTableError,
    Scheduling,
    largest_pole,
    read_gain_table,
    table_wheels,
    write_gain_table,
)
from traction_controller.synthesis.lpv_synthesis import synthesize
from traction_model.definition import DefinitionError
from traction_model.vehicle.vehicle import load_vehicle

RIG = load_vehicle('single_wheel_rig')
TRACTOR = load_vehicle('tractor_4wd')
WHEELS = table_wheels(RIG)
NARROW = Scheduling(stiffness=6.0, rim_speed=(2.0, 2.4))


@pytest.fixture(scope='module')
def certificate():
    narrow = {
        'largest_pole': largest_pole(WHEELS, NARROW), 'grid': 6, 'delays': (2, 2),
        'lags': (0.15, 0.2), 'lag_cells': 1, 'stiffness_error': 1.3, 'error_cells': 1,
    }  # fmt: skip
    return synthesize(LoopDesign.model_validate(narrow))


@pytest.fixture
def path(tmp_path, certificate):
    path = tmp_path / 'gains.yaml'
    write_gain_table(path, 'single_wheel_rig', WHEELS, NARROW, certificate)
    return path


def changed(certificate, **update):
    return Certificate.model_validate(certificate.model_dump() | update)


def test_holds_on_its_grid_and_ten_times_denser(certificate):
    assert check(certificate).least >= 0
    assert check(certificate, 10).least >= 0


def test_margin_is_that_of_the_inequality(certificate):
    # The quadratic form itself at one point of the grid, where nothing moves: V+ - V + z'z/gamma
    # - gamma*w'w as a matrix must be at most 0, and no more than the margin says.
    design = certificate.design.model_copy(update={'stiffness_rate': 0.0, 'rim_speed_rate': 0.0})
    still = changed(certificate, design=design.model_dump())
    P, gamma = still.matrices()[0, 0, 0, 2], still.performance[2]
    A, E, C = closed_loop(
        design, np.array(still.gains), np.array(2.0), np.array(0.2), 2, np.array(1.3)
    )
    whole = np.block([
        [A.T @ P @ A - P + C.T @ C / gamma, A.T @ P @ E],
        [E.T @ P @ A, E.T @ P @ E - gamma * np.eye(2)],
    ])  # fmt: skip
    assert np.linalg.eigvalsh(whole)[-1] < 0
    assert margins(still).least >= margins(certificate).least


def test_a_gain_that_was_changed_is_refused(certificate):
    gains = np.array(certificate.gains)
    gains[1, 0] *= 4.0
    with pytest.raises(CertificateError, match='closed-loop inequality fails at slip pole'):
        check(changed(certificate, gains=gains.tolist()))


def test_a_smaller_gamma_is_refused(certificate):
    better = [0.3 * gamma for gamma in certificate.performance]
    with pytest.raises(CertificateError, match='closed-loop inequality fails'):
        check(changed(certificate, performance=better))


def test_a_lyapunov_matrix_that_is_not_positive_definite_is_refused(certificate):
    lyapunov = np.array(certificate.lyapunov)
    lyapunov[0, 0, 0, 1, 0] *= -1.0
    with pytest.raises(CertificateError, match=r'Lyapunov matrix at slip pole .* not pos'):
        check(changed(certificate, lyapunov=lyapunov.tolist()))


def test_another_lyapunov_matrix_is_refused(certificate):
    lyapunov = np.array(certificate.lyapunov)
    lyapunov[0, 0, 0, 2] *= 2.0
    with pytest.raises(CertificateError, match='closed-loop inequality fails'):
        check(changed(certificate, lyapunov=lyapunov.tolist()))


def test_shapes_are_checked(certificate):
    with pytest.raises(ValueError, match='gains must have shape'):
        changed(certificate, gains=certificate.gains[:-1])


def test_written_and_read_again_it_is_the_same(path, certificate):
    table = read_gain_table(path, RIG, 0.01)['wheel']
    expected = GainTable(WHEELS[0], NARROW, certificate)
    assert table.at(2.2, 25000.0) == expected.at(2.2, 25000.0)
    assert path.read_text().startswith('# Gains of slip control for single_wheel_rig')


@pytest.mark.parametrize('key', ['gains', 'performance'])
def test_a_file_changed_within_what_holds_is_refused_by_its_digest(path, key):
    content = yaml.safe_load(path.read_text())
    part = content['certificate'][key]
    if key == 'gains':
        part[1][0] *= 1 + 1e-9
    else:
        part[1] *= 1 + 1e-9
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(GainTableError, match=r'gains.yaml: the digest does not fit'):
        read_gain_table(path)


def test_a_file_with_a_gain_changed_is_refused_by_what_it_breaks(path):
    content = yaml.safe_load(path.read_text())
    content['certificate']['gains'][1][1] *= -1.0
    path.write_text(yaml.safe_dump(content))
    with pytest.raises(GainTableError, match=r'gains.yaml: the certificate does not hold'):
        read_gain_table(path)


def test_another_period_is_refused(path):
    with pytest.raises(GainTableError, match=r'period of 0.01 s, the controller has 0.02 s'):
        read_gain_table(path, RIG, 0.02)


def test_another_vehicle_is_refused(path):
    with pytest.raises(GainTableError, match='made for the wheels wheel of single_wheel_rig'):
        read_gain_table(path, TRACTOR)
    heavier = RIG.model_copy(update={'chassis_mass': 600.0})
    with pytest.raises(GainTableError, match="wheel 'wheel' of load 4905, the vehicle's has 5886"):
        read_gain_table(path, heavier)


def test_wheels_that_the_certificate_does_not_cover_are_refused(tmp_path, certificate):
    path = tmp_path / 'wide.yaml'
    write_gain_table(path, 'rig', WHEELS, Scheduling(), certificate)
    with pytest.raises(GainTableError, match='the certificate covers slip poles up to'):
        read_gain_table(path)


@pytest.mark.parametrize(
    ('text', 'message'),
    [
        ('format: traction gain table 1\nvehicel: rig\n', 'vehicel: unknown key; did you mean'),
        ('[1, 2]\n', 'expected a mapping'),
        ('format: !!python/object/apply:os.getcwd []\n', 'not valid YAML'),
    ],
)
def test_what_is_not_a_gain_table_is_refused(tmp_path, text, message):
    path = tmp_path / 'gains.yaml'
    path.write_text(text)
    with pytest.raises(DefinitionError, match=message):
        read_gain_table(path)


def torque_per_rate(rim_speed):
    """By hand: J*omega/(1 - i), with J 20 kg*m^2, r 0.5 m, slip 0.15."""
    return 20.0 * rim_speed / (0.5 * 0.85)


def test_gains_at_a_point_of_the_grid_are_those_stored(certificate):
    table = GainTable(WHEELS[0], NARROW, certificate)
    for pole, stored in zip(certificate.design.poles, certificate.gains, strict=True):
        # p = r*C/G.
        found = table.at(2.0, pole * torque_per_rate(2.0) / 0.5)
        assert found == pytest.approx([stored[0] * torque_per_rate(2.0), *stored[1:]])


def test_gains_are_linear_in_the_logarithm_of_one_and_the_pole(certificate):
    table = GainTable(WHEELS[0], NARROW, certificate)
    low, high = certificate.design.poles[:2]
    middle = math.sqrt((1 + low) * (1 + high)) - 1
    found = table.at(2.2, middle * torque_per_rate(2.2) / 0.5)
    assert found[1] == pytest.approx((certificate.gains[0][1] + certificate.gains[1][1]) / 2)


def test_gains_outside_are_those_at_the_edge(certificate):
    table = GainTable(WHEELS[0], NARROW, certificate)
    assert table.at(2.0, 1e9) == table.at(2.0, 6.0 * 4905.0)
    assert table.at(0.0, 1e4) == table.at(2.0, 1e4)
    assert table.at(-2.2, 25000.0) == table.at(2.2, 25000.0)
    # Negative or unknown stiffness: smallest gains.
    assert table.at(2.2, -1e4) == table.at(2.2, math.nan) == table.at(2.2, 0.0)


def test_look_up_is_quick(certificate):
    table = GainTable(WHEELS[0], NARROW, certificate)
    best = min(timeit.repeat(lambda: table.at(2.2, 25000.0), number=1000, repeat=20)) / 1000
    assert best < 10e-6


def test_like_wheels_are_taken_together():
    front, rear = table_wheels(TRACTOR)
    assert front.names == ('fl', 'fr')
    assert rear.names == ('rl', 'rr')
    assert rear.load == pytest.approx(13979.25)
