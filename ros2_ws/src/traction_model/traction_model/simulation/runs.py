"""Runs of a batch as arrays, and the kernel for one of them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from traction_model.kernel import lean_kernel
from traction_model.simulation.vehicle_dynamics import Model, integrate
from traction_model.soil.rut import Ruts

Array = NDArray[np.float64]


class Runs(NamedTuple):
    """Packed runs, for kernels; b runs, n wheels, k soils, m stored samples.

    Attributes
    ----------
    form, mode : int
        As in `Model`.
    wheels : ndarray, shape (b, n, 7)
        Packed wheels, SI units, as in `Model`; so are the next.
    load_distribution : ndarray, shape (b, n, 2)
        Dimensionless and 1/m.
    soils : ndarray, shape (b, n, k, 17)
        SI units.
    starts, grades : ndarray, shape (b, k)
        m, rad.
    numbers : ndarray, shape (b, 9)
        The floats of `Model` from `mass` on, SI units.
    depth, shear, rut_width : ndarray, shape (b, tracks, cells)
        As in `Ruts`, m.
    newest : ndarray, shape (b, tracks)
        Index of the foremost cell, dimensionless, as in `Ruts`.
    y : ndarray, shape (b, 2 + 3n)
        States, SI units, as in `traction_model.simulation.vehicle_dynamics.derivative`.
    forces : ndarray, shape (b, n, 7)
        Forces, SI units, as in the same function.
    work : ndarray, shape (b, 3, 2 + 3n)
        Working memory, SI units.
    torque : ndarray, shape (b or 1, samples, n)
        Torque, N·m; one for all runs, or one each.
    given : ndarray, shape (2, 3, n)
        Unused given sinkage, m.
    """

    form: int
    mode: int
    wheels: Array
    load_distribution: Array
    soils: Array
    starts: Array
    grades: Array
    numbers: Array
    depth: Array
    shear: Array
    rut_width: Array
    newest: NDArray[np.int64]
    y: Array
    forces: Array
    work: Array
    torque: Array
    given: Array


@lean_kernel
def run_one(b, dt, every, runs, states, logged):
    """Integrate one run of many.

    Parameters
    ----------
    b : int
        Index of the run.
    dt : float
        Time between samples of torque, s.
    every : int
        Number of samples per stored one.
    runs : Runs
        All runs, SI units; states, ruts and forces are changed in place.
    states : ndarray, shape (b, m, 2 + 3n)
        Out: states at the stored samples, SI units.
    logged : ndarray, shape (b, m, n, 7)
        Out: forces at the stored samples, SI units.
    """
    numbers = runs.numbers[b]
    model = Model(
        runs.form, runs.mode, runs.wheels[b], runs.load_distribution[b], runs.soils[b],
        runs.starts[b], runs.grades[b], numbers[0], numbers[1], numbers[2], numbers[3],
        numbers[4], numbers[5], numbers[6], numbers[7], numbers[8],
    )  # fmt: skip
    ruts = Ruts(runs.depth[b], runs.shear[b], runs.rut_width[b], runs.newest[b])
    torque = runs.torque[b if runs.torque.shape[0] > 1 else 0]
    integrate(
        0.0, dt, runs.y[b], torque, runs.given, model, ruts, runs.forces[b], runs.work[b], every,
        states[b], logged[b], runs.wheels.shape[1], runs.form, runs.mode,
    )  # fmt: skip
