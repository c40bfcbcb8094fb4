"""Peers of the benchmarks solve the equations of the model: agreement, and errors."""

import shutil

import numpy as np
import pytest
from model import Row, drive
from peers import Octave, Scipy, SolverError, closed_form, stress_integrals
from problem import SAMPLE_TIME, recorded

from traction_model import Drawbar, Form

WHEEL = 'wheel_torque_sine', Drawbar(900, 300, 2.0)
TRACTOR = 'tractor_sandy_loam', Drawbar(6000, 1500, 2.0)


@pytest.mark.parametrize('drive_of', [WHEEL, TRACTOR], ids=['wheel', 'tractor'])
@pytest.mark.parametrize(
    ('form', 'right_hand_side', 'rolling'),
    [
        (Form.BEKKER_WONG, closed_form, False),
        (Form.BEKKER_WONG, closed_form, True),
        (Form.CONTACT, stress_integrals, True),
    ],
)
def test_scipy_solves_the_same_equations(form, right_hand_side, rolling, drive_of):
    # 2 s, in which the drawbar comes on; both sides keep errors of a step below 1e-6.
    problem = recorded(*drive_of, 2.0, rolling=rolling)
    ours = drive(problem, form)
    peer = Scipy('RK45', right_hand_side, max_step=10 * SAMPLE_TIME)
    _, v, omega = peer(problem, ours.sinkage[0])
    assert ours.v == pytest.approx(v, abs=1e-4 * np.abs(v).max())
    assert ours.omega == pytest.approx(omega, abs=1e-4 * np.abs(omega).max())


OCTAVE = shutil.which('octave-cli') or shutil.which('octave')


@pytest.mark.skipif(not OCTAVE, reason='no `octave` on the PATH')
def test_octave_solves_the_same_equations():
    problem = recorded(*WHEEL, 1.0, rolling=True)
    ours = drive(problem, Form.BEKKER_WONG)
    seconds, v, omega = Octave(OCTAVE)(problem, ours.sinkage[0])
    assert seconds > 0
    assert ours.v == pytest.approx(v, abs=1e-3 * np.abs(v).max())
    assert ours.omega == pytest.approx(omega, abs=1e-3 * np.abs(omega).max())


def test_a_solver_that_fails_says_so():
    problem = recorded(*WHEEL, 0.5, rolling=True)

    def explosive(_):
        # y' = y^2 has left every number behind at t = 1/y(0).
        return lambda t, y: np.array([100.0 * y[0] ** 2, 0.0, 0.0, 0.0])

    with pytest.raises(SolverError, match='step size'):
        Scipy('RK45', explosive)(problem, np.array([0.1]))


def test_a_row_is_met_by_its_ratio_and_its_agreement():
    def row(ratio, target, difference):
        return Row('', '', '', '', ratio, target, difference).met

    assert row(400.0, 400.0, 1e-3)
    assert not row(399.0, 400.0, 1e-3)
    assert not row(400.0, 400.0, 2e-3)
    assert row(0.1, None, None)
