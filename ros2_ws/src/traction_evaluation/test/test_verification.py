"""Contact form against Chrono: the limits of `make verify` as tests."""

import lzma
import math

import numpy as np
import pytest

from traction_evaluation.verification.chrono import CHRONO_RUNS, read_chrono
from traction_evaluation.verification.verification import (
    LIMITS,
    NOT_REACHED,
    PAPER_TABLE_3,
    PREDICTED_FACTOR,
    Errors,
    errors,
    exceeded,
    follow,
)
from traction_model.contact.contact import Form


@pytest.mark.parametrize('name', list(CHRONO_RUNS))
def test_with_sinkage_fed(chrono, name):
    recording = chrono(name)
    found = errors(recording, follow(recording))
    assert exceeded(found, LIMITS[name]) == NOT_REACHED.get(name, [])


@pytest.mark.parametrize('name', list(CHRONO_RUNS))
def test_with_sinkage_predicted(chrono, name):
    recording = chrono(name)
    found = errors(recording, follow(recording, fed=False))
    assert exceeded(found, LIMITS[name], PREDICTED_FACTOR) == []


def test_closed_forms_are_worse_than_the_arc(chrono):
    # Their resistance and contact length go by the load alone, or know no damping.
    recording = chrono('wheel_drawbar')
    arc = errors(recording, follow(recording))
    for form in (Form.PAPER, Form.BEKKER_WONG):
        assert errors(recording, follow(recording, form)).v_mean > 5 * arc.v_mean


def test_errors_by_hand(chrono):
    # The recording against itself, with 0.1 m/s added to speed and 0.3 rad/s at one sample.
    recording = chrono('wheel_drawbar')
    motion = follow(recording)
    last = slice(len(recording.t) - len(motion.t), None)
    omega = recording.omega[last].copy()
    omega[100] += 0.3
    made = type(motion)(
        **{
            **vars(motion),
            'v': recording.v[last] + 0.1,
            'omega': omega,
            'slip': recording.slip[last],
        }
    )
    found = errors(recording, made)
    assert found.v_max == pytest.approx(0.1)
    assert found.v_mean == pytest.approx(0.1)
    assert found.omega_max == pytest.approx(0.3)
    assert found.omega_mean == pytest.approx(0.3 / len(omega))
    assert found.slip_max == 0.0


def test_run_starts_from_chronos_state(chrono):
    recording = chrono('tractor_soft_patch')
    motion = follow(recording)
    k = round(0.3 / 0.005)
    assert motion.t[0] == pytest.approx(0.3)
    assert motion.v[0] == recording.v[k]
    assert motion.x[0] == recording.x[k]
    np.testing.assert_array_equal(motion.omega[0], recording.omega[k])


def test_errors_above_their_limits_are_named():
    limits = Errors(math.inf, 0.5, 1.0, 1.0, 0.1, 0.1)
    # 9 is not above infinity, 0.5 not above 0.5; 1.5 and 0.2 are above 1 and 0.1.
    found = Errors(9.0, 0.5, 1.5, 1.0, 0.2, 0.1)
    assert exceeded(found, limits) == ['omega_max', 'slip_max']
    # Twice the limits allow 1.5, and just 0.2.
    assert exceeded(found, limits, 2.0) == []
    assert exceeded(found, limits, 1.9) == ['slip_max']


def test_papers_table_is_the_limit_of_its_runs():
    assert LIMITS['wheel_high_slip'] == PAPER_TABLE_3['wheel_high_slip']
    assert math.isinf(LIMITS['wheel_drawbar'].v_max)


@pytest.mark.parametrize(
    ('text', 'reason'),
    [
        ('t,v\n0,0\n0.005,0\n', 'column x is missing'),
        ('t,v,x,torque,omega,sinkage,fx\n0,0,0,0,0,0,0\n1,0,0,0,0,0,0\n', 'not sampled every'),
    ],
)
def test_recording_that_is_wrong(tmp_path, text, reason):
    path = tmp_path / 'run.csv.xz'
    path.write_bytes(lzma.compress(text.encode()))
    with pytest.raises(ValueError, match=rf'run\.csv\.xz: {reason}'):
        read_chrono(path, CHRONO_RUNS['wheel_drawbar'])
