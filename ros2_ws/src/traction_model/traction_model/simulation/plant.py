"""Plant: vehicle on terrain, advanced step by step under commanded torque."""

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import Form
from traction_model.kernel import lean_kernel
from traction_model.simulation.drawbar import Drawbar, drawbar_force
from traction_model.simulation.vehicle_dynamics import (
    DISTANCE,
    FIRST_WHEEL,
    SPEED,
    advance,
    derivative,
    fresh_ruts_of,
    initial_state,
    pack,
)
from traction_model.simulation.wheel_forces import (
    FORCE_COLUMNS,
    LOAD,
    MOMENT,
    RESISTANCE,
    SINKAGE,
    THRUST,
    UPWARD,
)
from traction_model.slip import MIN_SPEED, is_valid, slip
from traction_model.soil.soil import Soil
from traction_model.soil.terrain import Terrain, as_terrain, soil_row
from traction_model.vehicle.vehicle import GRAVITY, Vehicle

Array = NDArray[np.float64]


@lean_kernel
def _begin(y, torque, given, model, ruts, forces, work):
    derivative(
        0.0, y, torque, given, 0, 0.0, model, ruts, forces, work[0], model.wheels.shape[0],
        model.form, model.mode,
    )  # fmt: skip


@lean_kernel
def _drive(
    t, dt, steps, y, command, shaft, keep, max_power, torque, given, model, ruts, forces, work
):
    """Advance a plant by steps, with lag of torque and limit of power."""
    n = command.size
    for k in range(steps):
        power = 0.0
        for j in range(n):
            power += max(0.0, command[j] * y[FIRST_WHEEL + j])
        allowed = min(1.0, max_power / power) if power > 0.0 else 1.0
        for j in range(n):
            target = allowed * command[j]
            torque[0, j] = shaft[j] if keep > 0.0 else target
            shaft[j] = target + (torque[0, j] - target) * keep
            torque[1, j] = shaft[j]
        derivative(
            t + k * dt, y, torque, given, 0, 0.0, model, ruts, forces, work[0],
            model.wheels.shape[0], model.form, model.mode,
        )  # fmt: skip
        advance(
            t + k * dt, dt, y, torque, given, 0, model, ruts, forces, work,
            model.wheels.shape[0], model.form, model.mode,
        )  # fmt: skip


class Plant:
    """Vehicle on terrain, advanced step by step.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    terrain : Terrain or Soil
        Terrain or soil.
    form : Form
        Form of the contact model.
    sinkage : {'dynamic', 'equilibrium'}
        Sinkage as a state, or from vertical equilibrium at every instant.
    drawbar : Drawbar
        Draft of the implement, N.
    multipass : bool
        True: wheels run in the ruts of those before them. False: undisturbed soil.
    torque_time_constant : float
        First-order lag between commanded and shaft torque, s, at least 0.
    max_power : float
        Power of the engine, W, above 0. If the wheels need more, all torques have the same
        reduction factor.
    step_size : float
        Longest integration step, s, above 0.
    v0 : float
        Speed at the start, m/s; the wheels roll without slip.

    Raises
    ------
    ValueError
        If a parameter is out of range.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        terrain: Terrain | Soil,
        *,
        form: Form = Form.CONTACT,
        sinkage: Literal['dynamic', 'equilibrium'] = 'dynamic',
        drawbar: Drawbar = Drawbar(),
        multipass: bool = True,
        torque_time_constant: float = 0.0,
        max_power: float = math.inf,
        step_size: float = 1e-3,
        v0: float = 0.0,
    ) -> None:
        if sinkage not in ('dynamic', 'equilibrium'):
            raise ValueError(f"sinkage must be 'dynamic' or 'equilibrium', got {sinkage!r}")
        if not (math.isfinite(torque_time_constant) and torque_time_constant >= 0):
            raise ValueError(
                f'torque_time_constant must be at least 0 s, got {torque_time_constant}'
            )
        if not max_power > 0:
            raise ValueError(f'max_power must be above 0 W, got {max_power}')
        if not 0 < step_size <= 0.01:
            raise ValueError(f'step_size must be above 0 and at most 0.01 s, got {step_size}')
        if not math.isfinite(v0):
            raise ValueError(f'v0 must be finite, got {v0} m/s')
        self.vehicle = vehicle
        self.torque_time_constant = torque_time_constant
        self.max_power = max_power
        self.step_size = step_size
        self._radii = np.array([wheel.radius for wheel in vehicle.wheels])
        self._form = form
        self._sinkage: Literal['dynamic', 'equilibrium'] = sinkage
        self._multipass = multipass
        self._terrain = as_terrain(terrain)
        self._drawbar = drawbar
        self._pack()
        self._ruts = fresh_ruts_of(vehicle)
        self.t = 0.0
        self.state = initial_state(vehicle, terrain, form)
        self.state[SPEED] = v0
        self.state[FIRST_WHEEL : FIRST_WHEEL + self.n_wheels] = v0 / self._radii
        self.shaft_torque = np.zeros(self.n_wheels)
        self._forces = np.zeros((self.n_wheels, FORCE_COLUMNS))
        self._forces[:, LOAD] = vehicle.static_loads()
        # Arrays for kernels: torque at the start and end of a step, unused sinkage, slopes.
        self._torque = np.zeros((2, self.n_wheels))
        self._not_given = np.zeros((2, 3, self.n_wheels))
        self._work = np.zeros((3, self.state.size))
        _begin(
            self.state, self._torque, self._not_given, self._model, self._ruts, self._forces,
            self._work,
        )  # fmt: skip

    def _pack(self) -> None:
        self._model = pack(
            self.vehicle, self._terrain, self._form, self._sinkage, self._drawbar, self._multipass
        )

    @property
    def terrain(self) -> Terrain:
        """Terrain, SI units; may be changed during a run, ruts are kept."""
        return self._terrain

    @terrain.setter
    def terrain(self, terrain: Terrain | Soil) -> None:
        self._terrain = as_terrain(terrain)
        self._pack()

    @property
    def drawbar(self) -> Drawbar:
        """Draft of the implement, N; may be changed during a run. Its ramp starts at t = 0."""
        return self._drawbar

    @drawbar.setter
    def drawbar(self, drawbar: Drawbar) -> None:
        self._drawbar = drawbar
        self._pack()

    @property
    def n_wheels(self) -> int:
        """Number of wheels, dimensionless."""
        return len(self._radii)

    @property
    def v(self) -> float:
        """Speed, m/s, forward positive."""
        return float(self.state[SPEED])

    @property
    def x(self) -> float:
        """Distance along the path, m."""
        return float(self.state[DISTANCE])

    @property
    def omega(self) -> Array:
        """Wheel speeds, rad/s, forward positive, shape (n,)."""
        return np.asarray(self.state[FIRST_WHEEL : FIRST_WHEEL + self.n_wheels])

    @property
    def rim_speed(self) -> Array:
        """r*omega of every wheel, m/s, forward positive, shape (n,)."""
        return np.asarray(self._radii * self.omega)

    @property
    def slip(self) -> list[float]:
        """Slip of every wheel, -1 to 1, n entries."""
        return [slip(self.v, float(rim)) for rim in self.rim_speed]

    @property
    def slip_valid(self) -> list[bool]:
        """True if the slip of a wheel is valid: rim or vehicle fast enough, n entries."""
        return [is_valid(self.v, float(rim), MIN_SPEED) for rim in self.rim_speed]

    @property
    def load(self) -> Array:
        """Load W on every wheel after load transfer, N, shape (n,)."""
        return self._forces[:, LOAD]

    @property
    def upward_force(self) -> Array:
        """Upward force N of the soil on every wheel, N, shape (n,)."""
        return self._forces[:, UPWARD]

    @property
    def sinkage(self) -> Array:
        """Sinkage z of every wheel, m, downward positive, shape (n,)."""
        return self._forces[:, SINKAGE]

    @property
    def thrust(self) -> Array:
        """Thrust F of every wheel, N, forward positive, shape (n,)."""
        return self._forces[:, THRUST]

    @property
    def motion_resistance(self) -> Array:
        """Motion resistance R of every wheel, N, positive against forward motion, shape (n,)."""
        return self._forces[:, RESISTANCE]

    @property
    def net_traction(self) -> Array:
        """Thrust less motion resistance of every wheel, N, forward positive, shape (n,)."""
        return np.asarray(self.thrust - self.motion_resistance)

    @property
    def soil_moment(self) -> Array:
        """Moment M of the soil about every wheel's centre, N·m, shape (n,).

        Positive if it resists forward rotation.
        """
        return self._forces[:, MOMENT]

    @property
    def max_shear_stress(self) -> list[float]:
        """c + (N/A)*tan(phi) over the contact arc of every wheel, Pa, n entries."""
        stresses = []
        for j, wheel in enumerate(self.vehicle.wheels):
            row = soil_row(self.x + self.vehicle.wheel_positions[j], self._terrain.starts)
            soil = self._terrain.soil(row, self.vehicle.tracks[j])
            depth = min(max(float(self.sinkage[j]), 1e-3), wheel.radius)
            area = wheel.width * wheel.contact_length(depth)
            stresses.append(soil.max_shear_stress(float(self.upward_force[j]) / area))
        return stresses

    @property
    def shear_deformation_modulus(self) -> list[float]:
        """K of the soil under every wheel, m, n entries."""
        return [
            self._terrain.soil(
                soil_row(self.x + x, self._terrain.starts), track
            ).shear_deformation_modulus
            for x, track in zip(self.vehicle.wheel_positions, self.vehicle.tracks, strict=True)
        ]

    @property
    def gross_traction(self) -> Array:
        """Moment of the soil over the radius of every wheel, N, forward positive, shape (n,)."""
        return np.asarray(self.soil_moment / self._radii)

    @property
    def external_resistance(self) -> float:
        """Gross traction less m*dv/dt, N: motion resistance, drawbar, grade and air drag."""
        grade = self._model.grades[soil_row(self.x, self._model.starts)]
        climb = self._model.mass * GRAVITY * math.sin(grade)
        drag = self._model.drag * self.v * abs(self.v)
        model = self._model
        pull = drawbar_force(self.t, self.v, model.pull, model.pull_per_speed, model.pull_ramp)
        lost_in_soil = self.gross_traction.sum() - self.net_traction.sum()
        return float(lost_in_soil + pull + climb + drag)

    def step(self, torque: ArrayLike, duration: float) -> None:
        """Advance by a duration under constant commanded torque.

        Parameters
        ----------
        torque : array_like, shape (n,)
            Commanded torque, N·m, forward positive.
        duration : float
            s, above 0.

        Raises
        ------
        ValueError
            If a torque is not finite, their number is wrong, or the duration is not above 0.
        """
        if not (math.isfinite(duration) and duration > 0):
            raise ValueError(f'duration must be above 0 s, got {duration}')
        command = np.asarray(torque, dtype=float)
        if command.shape != (self.n_wheels,) or not np.all(np.isfinite(command)):
            raise ValueError(f'torque must be {self.n_wheels} finite numbers, got {torque!r}')
        steps = max(1, math.ceil(duration / self.step_size - 1e-9))
        dt = duration / steps
        keep = math.exp(-dt / self.torque_time_constant) if self.torque_time_constant else 0.0
        state, shaft = self.state.copy(), self.shaft_torque.copy()
        _drive(
            self.t, dt, steps, state, command, shaft, keep, self.max_power, self._torque,
            self._not_given, self._model, self._ruts, self._forces, self._work,
        )  # fmt: skip
        self.state, self.shaft_torque = state, shaft
        self.t += steps * dt
