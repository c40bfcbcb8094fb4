"""Simulation of a vehicle under recorded torque."""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import BEKKER_WONG, Form
from traction_model.kernel import lean_kernel
from traction_model.simulation.drawbar import Drawbar
from traction_model.simulation.vehicle_dynamics import (
    DISTANCE,
    DYNAMIC,
    FIRST_WHEEL,
    SPEED,
    fresh_ruts_of,
    initial_state,
    integrate,
    pack,
)
from traction_model.simulation.wheel_forces import (
    FORCE_COLUMNS,
    LOAD,
    MOMENT,
    RESISTANCE,
    SINKAGE,
    THRUST,
)
from traction_model.slip import slips
from traction_model.soil.soil import Soil
from traction_model.soil.terrain import Terrain
from traction_model.vehicle.vehicle import Vehicle
from traction_model.vehicle.wheel import STATIC_LOAD

Array = NDArray[np.float64]

SMOOTHED = 0.05
"""Time window for the differentiation of given sinkage, s."""


@dataclass(frozen=True)
class Trajectory:
    """Simulated motion; k samples, n wheels.

    Attributes
    ----------
    t : ndarray, shape (k,)
        Time, s.
    v : ndarray, shape (k,)
        Speed, m/s, forward positive.
    x : ndarray, shape (k,)
        Distance along the path, m.
    omega : ndarray, shape (k, n)
        Wheel speeds, rad/s, forward positive.
    slip : ndarray, shape (k, n)
        Slip, -1 to 1; see `traction_model.slip.slip`.
    sinkage : ndarray, shape (k, n)
        m, downward positive.
    load : ndarray, shape (k, n)
        Load on the wheel after load transfer, N.
    thrust : ndarray, shape (k, n)
        F, N, forward positive.
    motion_resistance : ndarray, shape (k, n)
        R, N, positive against forward motion.
    soil_moment : ndarray, shape (k, n)
        M, N·m, moment of the soil against the rotation of the wheel.
    """

    t: Array
    v: Array
    x: Array
    omega: Array
    slip: Array
    sinkage: Array
    load: Array
    thrust: Array
    motion_resistance: Array
    soil_moment: Array


@lean_kernel
def _run(t0, dt, y, torque, given, model, ruts, forces, work, states, logged):
    n, form, mode = model.wheels.shape[0], model.form, model.mode
    if n == 1 and form == BEKKER_WONG and mode == DYNAMIC:
        # Constants at compile time remove loops and branches: a fifth of the time.
        integrate(
            t0, dt, y, torque, given, model, ruts, forces, work, 1, states, logged, 1,
            BEKKER_WONG, DYNAMIC,
        )  # fmt: skip
    else:
        integrate(
            t0, dt, y, torque, given, model, ruts, forces, work, 1, states, logged, n, form, mode
        )


def simulate(
    vehicle: Vehicle,
    terrain: Terrain | Soil,
    torque: ArrayLike,
    dt: float,
    *,
    form: Form = Form.CONTACT,
    sinkage: Literal['dynamic', 'equilibrium'] | ArrayLike = 'dynamic',
    drawbar: Drawbar = Drawbar(),
    multipass: bool = True,
    shear_step: float = 0.0,
    t0: float = 0.0,
    x0: float = 0.0,
    v0: float = 0.0,
    omega0: ArrayLike | None = None,
    sinkage0: ArrayLike | None = None,
    sinkage_rate0: ArrayLike | None = None,
) -> Trajectory:
    """Simulate a vehicle under recorded torque.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    terrain : Terrain or Soil
        Terrain or soil.
    torque : array_like, shape (k, n)
        Torque on every wheel at every sample, N·m; linear in between.
    dt : float
        Time between samples and longest step of integration, s, above 0 and at most 0.02.
    form : Form
        Form of the contact model.
    sinkage : {'dynamic', 'equilibrium'} or array_like, shape (k, n)
        Sinkage as a state, from vertical equilibrium, or given, m (from equilibrium if it is not
        positive). With given sinkage the load on the soil is the wheel load less mass times the
        acceleration of sinkage.
    drawbar : Drawbar
        Draft, N.
    multipass : bool
        True: wheels run in the ruts of those before them. False: undisturbed soil.
    shear_step : float
        Time of shear before contact, s, at least 0: 0, or half the time step of a simulation to
        reproduce, which integrates shear in whole steps.
    t0 : float
        Time of the first sample, s.
    x0 : float
        Position of the rear axle at `t0`, m along the path.
    v0 : float
        Speed at `t0`, m/s.
    omega0 : array_like, shape (n,), optional
        Wheel speeds at `t0`, rad/s; default: rolling without slip.
    sinkage0 : array_like, shape (n,), optional
        Sinkages at `t0`, m, if sinkage is a state; default: those at rest.
    sinkage_rate0 : array_like, shape (n,), optional
        Their rates, m/s, downward positive; default: 0.

    Returns
    -------
    Trajectory
        Motion, SI units, one row per sample.

    Raises
    ------
    ValueError
        If an argument has the wrong shape or is out of range; the text names it.
    """
    n = len(vehicle.wheels)
    torque = _series('torque', torque, n)
    if not 0 < dt <= 0.02:
        raise ValueError(f'dt must be above 0 and at most 0.02 s, got {dt}')
    if isinstance(sinkage, str):
        mode, given = sinkage, np.zeros((2, 3, n))
    else:
        mode, depth = 'given', _series('sinkage', sinkage, n)
        if len(depth) != len(torque):
            raise ValueError(f'sinkage has {len(depth)} samples, torque has {len(torque)}')
        given = _with_rates(depth, dt)
    if not (math.isfinite(shear_step) and shear_step >= 0):
        raise ValueError(f'shear_step must be at least 0 s, got {shear_step}')
    model = pack(vehicle, terrain, form, mode, drawbar, multipass, shear_step)

    radii = np.array([wheel.radius for wheel in vehicle.wheels])
    start = initial_state(vehicle, terrain, form)
    start[SPEED], start[DISTANCE] = v0, x0
    # Default: rolling without slip.
    start[FIRST_WHEEL : FIRST_WHEEL + n] = v0 / radii
    for k, (name, values) in enumerate(
        (('omega0', omega0), ('sinkage0', sinkage0), ('sinkage_rate0', sinkage_rate0))
    ):
        if values is not None:
            if np.shape(values) != (n,):
                raise ValueError(f'{name} must have shape ({n},), got {np.shape(values)}')
            start[FIRST_WHEEL + k * n : FIRST_WHEEL + (k + 1) * n] = values
    if not np.all(np.isfinite(start)):
        raise ValueError(
            f'x0, v0, omega0, sinkage0 and sinkage_rate0 must be finite, got {x0} m, {v0} m/s, '
            f'{omega0!r} rad/s, {sinkage0!r} m and {sinkage_rate0!r} m/s'
        )
    states = np.empty((len(torque), start.size))
    forces = np.empty((len(torque), n, FORCE_COLUMNS))
    loads = np.zeros((n, FORCE_COLUMNS))
    loads[:, LOAD] = model.wheels[:, STATIC_LOAD]
    loads[:, SINKAGE] = start[FIRST_WHEEL + n : FIRST_WHEEL + 2 * n]
    work = np.empty((3, start.size))
    _run(t0, dt, start, torque, given, model, fresh_ruts_of(vehicle), loads, work, states, forces)

    v = states[:, SPEED]
    omega = states[:, FIRST_WHEEL : FIRST_WHEEL + n]
    return Trajectory(
        t=t0 + dt * np.arange(float(len(v))),
        v=v,
        x=states[:, DISTANCE],
        omega=omega,
        slip=slips(v, omega * radii),
        sinkage=forces[:, :, SINKAGE],
        load=forces[:, :, LOAD],
        thrust=forces[:, :, THRUST],
        motion_resistance=forces[:, :, RESISTANCE],
        soil_moment=forces[:, :, MOMENT],
    )


def _with_rates(depth: Array, dt: float) -> Array:
    """Sinkage, its rate and its acceleration, each smoothed over SMOOTHED seconds."""
    # Imported on demand, since the import takes longer than that of the rest of the package.
    from scipy.signal import savgol_filter

    window = max(5, 2 * round(SMOOTHED / dt / 2) + 1)
    if len(depth) < window:
        raise ValueError(f'sinkage needs at least {window} samples, got {len(depth)}')
    rates = [savgol_filter(depth, window, 2, deriv=order, delta=dt, axis=0) for order in (1, 2)]
    return np.ascontiguousarray(np.stack([depth, *rates], axis=1))


def _series(name: str, values: ArrayLike, n: int) -> Array:
    """Checked samples of n wheels."""
    series = np.asarray(values, dtype=float)
    if series.ndim != 2 or series.shape[1] != n or len(series) < 2:
        raise ValueError(f'{name} must have shape (samples, {n}), got {series.shape}')
    if not np.all(np.isfinite(series)):
        row, column = np.argwhere(~np.isfinite(series))[0]
        raise ValueError(f'{name} of wheel {column} is not finite at sample {row}')
    return np.ascontiguousarray(series)
