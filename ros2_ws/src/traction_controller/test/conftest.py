"""Wheels on a linear model, for all tests of the package."""

import numpy as np
import pytest

from traction_model.lpv.sampling import sampled
from traction_model.lpv.slip_dynamics import slip_dynamics
from traction_model.vehicle.vehicle import GRAVITY, load_vehicle


class LinearWheels:
    """Wheels of the tractor as the model of `slip_dynamics` at slip 0.2, and their shaft torque.

    Each goes by itself, or all wheels of an axle as one (`locked`), under their mean torque.
    """

    DT = 0.01

    def __init__(self, rim_speed=2.0, lag=0.1, relative_stiffness=(4, 4, 4, 4), locked=False):
        tractor = load_vehicle('tractor_4wd')
        self.rim_speed = rim_speed
        self.locked = locked
        self.state = np.zeros((4, 2))
        loads = [float(load) for load in tractor.static_loads()]
        self.stiffness = [s * load for s, load in zip(relative_stiffness, loads, strict=True)]
        self.models, self.per_slip = [], []
        for j, (wheel, load) in enumerate(zip(tractor.wheels, loads, strict=True)):
            own = self.stiffness[j]
            if locked:
                own = (own + self.stiffness[j ^ 1]) / 2  # wheels of an axle: 0, 1 and 2, 3
            a, b = slip_dynamics(wheel, load / GRAVITY, rim_speed, own, 0.2)
            # Torque beyond that of the load that holds a slip of 1.
            self.per_slip.append(-a / b)
            self.models.append(
                sampled(np.array([[a, b], [0.0, -1 / lag]]), np.array([[0.0], [1 / lag]]), self.DT)
            )
        self.load_torque = 0.0
        # The most that reaches the shaft, N·m.
        self.power = np.inf

    def advance(self, torques):
        # Torque above the steady moment of the soil changes the slip.
        torques = np.minimum(torques, self.power)
        if self.locked:
            torques = np.repeat(torques.reshape(2, 2).mean(axis=1), 2)
        for j, (a, b) in enumerate(self.models):
            shifted = self.state[j] - [0.0, self.load_torque]
            self.state[j] = a @ shifted + b[:, 0] * (torques[j] - self.load_torque)
            self.state[j] += [0.0, self.load_torque]

    @property
    def slips(self):
        return self.state[:, 0].tolist()

    @property
    def shaft(self):
        return self.state[:, 1].tolist()


@pytest.fixture(scope='session')
def linear_wheels():
    """Maker of `LinearWheels`."""
    return LinearWheels
