"""Slip control on soil: every law, grouping and differential on the contact form, no estimator."""

import math
from pathlib import Path

import numpy as np
import pytest

from traction_controller.control.driveline import Differential, Grouping
from traction_controller.control.laws.registry import LAWS
from traction_controller.control.slip_control import Mode, SlipControl
from traction_controller.control.slip_state import SlipState
from traction_controller.synthesis.gain_table import read_gain_table
from traction_model.contact.contact import shear_deficit
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.soil.soil import load_soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import load_vehicle

TRACTOR = load_vehicle('tractor_4wd')
RADII = np.array([wheel.radius for wheel in TRACTOR.wheels])
PATCH = Terrain([load_soil('sandy_loam_chrono'), load_soil('soft_patch_chrono')], [8.0])
DT, LAG = 0.01, 0.1
# Full throttle: more than rear wheels in the ruts of the front ones can use at 20 % slip.
REQUEST = np.array([2400.0, 2400.0, 9000.0, 9000.0])
GAINS = Path(__file__).resolve().parents[1] / 'config' / 'gains' / 'tractor_4wd.yaml'
TABLES = read_gain_table(GAINS, TRACTOR, DT)


def stiffnesses(plant):
    """Slip stiffness of every wheel from the plant's own state, as terrain_estimate gives it."""
    found = []
    for j, wheel in enumerate(TRACTOR.wheels):
        place = plant.x + TRACTOR.wheel_positions[j]
        soil = PATCH.soils[int(np.searchsorted(PATCH.starts, place, side='right')) - 1]
        length = wheel.radius * math.acos(1 - max(plant.sinkage[j], 1e-3) / wheel.radius)
        path = length / soil.shear_deformation_modulus
        # F = tau_max*A*(1 - kappa(y)) with y = |i|*l/K, and -d(kappa)/dy = (kappa - exp(-y))/y.
        y = max(abs(plant.slip[j]) * path, 1e-3)
        slope = (shear_deficit(y) - math.exp(-y)) / y
        found.append(plant.max_shear_stress[j] * wheel.width * length * path * slope)
    return found


def onto_the_patch(control, *, locked=(), pull=13000.0, shaft=True):
    """Slips, torques and speeds from 2 s on the patch on, a row every 10 ms.

    `locked` names pairs of wheels that a stiff shaft couples, N·m·s/rad per pair.
    """
    # With locked wheels the drive's lag is here, so that what couples them has none.
    lag = 0.0 if locked else LAG
    plant = Plant(
        TRACTOR, PATCH, drawbar=Drawbar(pull, 1500, 2.0), torque_time_constant=lag,
        max_power=75e3,
    )  # fmt: skip
    torques = np.zeros(4)
    rows, entered = [], None
    for _ in range(round(20.0 / DT)):
        measured = torques if locked else plant.shaft_torque
        state = SlipState(
            plant.slip, plant.slip_valid, plant.rim_speed.tolist(), plant.v, stiffnesses(plant)
        )
        outcomes = control.step(
            DT, state, measured.tolist() if shaft else None,
            (REQUEST * min(1.0, plant.t / 3.0)).tolist(),
        )  # fmt: skip
        sent = np.array([outcome.torque for outcome in outcomes])
        if locked:
            for _ in range(10):
                torques = torques + (sent - torques) * (1 - math.exp(-1e-3 / LAG))
                coupling = np.zeros(4)
                for left, right, size in locked:
                    coupling[[left, right]] += (
                        size * (plant.omega[right] - plant.omega[left]) * (np.array([1.0, -1.0]))
                    )
                plant.step(torques + coupling, 1e-3)
        else:
            plant.step(sent, DT)
        if plant.x > 8.0 and entered is None:
            entered = plant.t
        if entered is not None and plant.t > entered + 2.0:
            rows.append([*plant.slip, *sent, *plant.rim_speed, plant.v])
    assert entered is not None
    assert len(rows) > 500
    rows = np.array(rows)
    return rows[:, :4], rows[:, 4:8], rows[:, 8:12], rows[:, 12]


def settings(law):
    return {'lpv': {'gain_table': TABLES}} if law == 'lpv' else None


@pytest.mark.parametrize('mode', list(Mode))
@pytest.mark.parametrize('law', LAWS)
def test_slip_on_a_soft_patch_stays_at_its_target(law, mode):
    control = SlipControl(TRACTOR, 0.2, mode, law=law, settings=settings(law))
    slips, torques, _, _ = onto_the_patch(control)
    # All wheels; the budget of the demo.
    assert np.percentile(np.abs(slips - 0.2), 95) <= 0.03
    if mode is Mode.LIMIT:
        assert np.all(torques <= REQUEST + 1e-9)


@pytest.mark.parametrize('law', LAWS)
def test_without_shaft_torque(law):
    # The sent torque after the lag is used: same limit of the error.
    control = SlipControl(TRACTOR, 0.2, law=law, settings=settings(law))
    slips, _, _, _ = onto_the_patch(control, shaft=False)
    assert np.percentile(np.abs(slips - 0.2), 95) <= 0.03


@pytest.mark.parametrize('law', LAWS)
def test_open_differentials_of_axles(law):
    # Both wheels of an axle have equal torque and soil, so both are at the target.
    control = SlipControl(
        TRACTOR, 0.2, law=law, settings=settings(law), grouping=Grouping.AXLE
    )  # fmt: skip
    slips, torques, _, _ = onto_the_patch(control)
    assert np.percentile(np.abs(slips - 0.2), 95) <= 0.03
    np.testing.assert_array_equal(torques[:, 0], torques[:, 1])
    np.testing.assert_array_equal(torques[:, 2], torques[:, 3])


@pytest.mark.parametrize('law', LAWS)
def test_open_differentials_of_one_engine(law):
    # The wheel that slips most bounds all, and torque is split as requested: 9000/2400.
    control = SlipControl(
        TRACTOR, 0.2, law=law, settings=settings(law), grouping=Grouping.VEHICLE
    )  # fmt: skip
    slips, torques, _, _ = onto_the_patch(control, pull=9000.0)
    largest = np.max(slips, axis=1)
    assert np.percentile(np.abs(largest - 0.2), 95) <= 0.03
    np.testing.assert_allclose(torques[:, 2], torques[:, 0] * 9000 / 2400)


@pytest.mark.parametrize('law', LAWS)
def test_locked_differentials_of_axles(law):
    # Wheels of an axle coupled with 20 kN·m·s/rad: their common rim speed has the slip wanted.
    control = SlipControl(
        TRACTOR, 0.2, law=law, settings=settings(law), grouping=Grouping.AXLE,
        differential=Differential.LOCKED,
    )  # fmt: skip
    locked = [(0, 1, 5e3), (2, 3, 2e4)]
    _, torques, rims, v = onto_the_patch(control, locked=locked)
    for left, right in ((0, 1), (2, 3)):
        common = 1 - v / rims[:, [left, right]].mean(axis=1)
        assert np.percentile(np.abs(common - 0.2), 95) <= 0.03
        np.testing.assert_array_equal(torques[:, left], torques[:, right])


def test_two_wheel_drive():
    control = SlipControl(TRACTOR, 0.2, driven='rear')
    slips, torques, _, _ = onto_the_patch(control, pull=6000.0)
    assert np.all(torques[:, :2] == 0.0)
    assert np.percentile(np.abs(slips[:, 2:] - 0.2), 95) <= 0.03
