"""Sensors as tractors have them, and radars that fail, in closed loop with what ships."""

import numpy as np
import pytest

from traction_evaluation.closed_loop.closed_loop import DT, ClosedLoop, Sensors
from traction_evaluation.loop.shipped import SOIL, VEHICLE, shipped_parameters
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.plant import Plant
from traction_model.simulation.sensors import RadarModel
from traction_model.soil.soil import load_soil
from traction_model.vehicle.vehicle import load_vehicle

REQUEST = (3000.0, 3000.0, 8000.0, 8000.0)
"""Torque asked for, N·m: what ships as the most that the gate lets through."""

DRAFT = Drawbar(1.6 * 7000.0, 1.6 * 2000.0)
"""60 % more than the demo's plough."""


class FaultyLoop(TractionLoop):
    """The loop that ships, with a radar that can be made to fail."""

    fault = staticmethod(lambda v: v)

    def radar(self, t, v, variance):
        reading = self.fault(v)
        return True if reading is None else super().radar(t, reading, variance)


def drive(pulses, duration, fault=None, start=6.0, end=12.0):
    """Pull away and drive; what happened, refusals of wheels, and what was said, by time."""
    plant = Plant(
        load_vehicle(VEHICLE), load_soil(SOIL), drawbar=DRAFT, torque_time_constant=0.2,
        step_size=2e-3,
    )  # fmt: skip
    loop = FaultyLoop.from_parameters(shipped_parameters())
    sensors = Sensors(pulses, RadarModel(0.05, latency=0.05), torque_noise=0.005)
    closed = ClosedLoop(plant, loop, sensors, 1)
    refused, said = [], []
    for k in range(round(duration / DT)):
        t = k * DT
        loop.fault = fault if fault and start <= t < end else FaultyLoop.fault
        closed.step([min(1.0, t) * torque for torque in REQUEST])
        refused.append(loop.estimator.refused.get('wheel_states', ''))
        said.append(loop.estimator.health[1])
    return closed.drive(), refused, said


def reversals(torque, share=0.1):
    """Changes of direction of a torque by more than a share of its largest value."""
    turns, direction, extreme = 0, 0, torque[0]
    for value in torque:
        if direction * (value - extreme) >= 0 and direction:
            extreme = value
        elif abs(value - extreme) > share * np.abs(torque).max():
            turns += direction != 0
            direction, extreme = int(np.sign(value - extreme)), value
    return turns


def test_reversals_are_counted():
    # Up, down by half, up again: two. A ripple of 5 %: none.
    assert reversals(np.array([0.0, 50.0, 100.0, 75.0, 50.0, 80.0, 100.0])) == 2
    assert reversals(np.array([100.0, 95.0, 100.0, 95.0])) == 0


@pytest.fixture(scope='module')
def ideal():
    return drive(0.0, 14.0)[0]


@pytest.mark.parametrize('pulses', [60, 200, 400, 2000])
def test_ordinary_tachometers_drive_as_ideal_ones(pulses, ideal):
    found, refused, _ = drive(pulses, 14.0)
    assert set(refused) == {''}
    assert found.x[-1] == pytest.approx(ideal.x[-1], rel=0.05)
    later = found.t > 5.0
    assert np.sqrt(np.mean((found.slip_estimate - found.slip)[later] ** 2)) < 0.02
    assert found.slip[later].max() < 0.3


FAULTS = {
    'zero': lambda v: 0.0,
    'low': lambda v: 0.3,
    'tenth': lambda v: 0.1 * v,
    'half': lambda v: 0.5 * v,
    'double': lambda v: 2.0 * v,
    'tenfold': lambda v: 10.0 * v,
    'other sign': lambda v: -v,
    'silent': lambda v: None,
}

REASONS = {
    'other sign': 'has no sign: the wheels turn the other way',
    'tenfold': 'is faster than all wheels while they drive',
}
"""Reasons that `/diagnostics` gives; for the others the radar is against wheels and torque."""


@pytest.mark.parametrize('name', FAULTS)
def test_a_radar_that_fails_for_six_seconds(name):
    found, _, said = drive(400, 20.0, FAULTS[name])
    later = found.t > 6.0
    assert found.slip[later].max() < 0.3
    assert reversals(found.command[later].sum(axis=1)) < 2
    # m/s
    assert np.abs(found.v_estimate - found.v)[later].max() < 0.3
    if name != 'silent':
        # From the second reading on, and until readings are near again.
        why = REASONS.get(name, 'against wheels and torque')
        assert f'radar {why}: not believed' in said[620:1180]
    assert said[-1] == 'estimating'
