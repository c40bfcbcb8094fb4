"""Batches on a CUDA GPU: the same functions, compiled by numba-cuda, one run per thread."""

from functools import cache
from typing import Any

import numpy as np
from numba import cuda
from numpy.typing import NDArray

from traction_model.simulation.runs import Runs, run_one

THREADS = 64
"""Runs per block, limited by the number of registers."""


class NoGpuError(RuntimeError):
    """There is no usable GPU; the text has the reason."""


def missing() -> str:
    """Reason why batches cannot run on a GPU.

    Returns
    -------
    str
        One line of text without a unit; empty if they can.
    """
    if cuda.is_available():
        return ''
    reason = ' '.join(str(cuda.cuda_error() or 'no device').split())
    return f'no CUDA GPU ({reason}); it takes an NVIDIA driver and pip install "numba-cuda[cu12]"'


@cache
def _kernel() -> Any:
    """Compiled kernel for the GPU, cached."""

    @cuda.jit
    def run(dt, every, runs, states, logged):
        b = cuda.grid(1)
        if b < runs.y.shape[0]:
            run_one(b, dt, every, runs, states, logged)

    return run


def run_all(
    dt: float,
    every: int,
    runs: Runs,
    states: NDArray[np.float64],
    logged: NDArray[np.float64],
) -> None:
    """Integrate all runs of a batch on the GPU.

    Parameters
    ----------
    dt : float
        Time between samples of torque, s.
    every : int
        Number of samples per stored one.
    runs : Runs
        All runs, SI units.
    states : ndarray, shape (b, m, 2 + 3n)
        Out: states at the stored samples, SI units.
    logged : ndarray, shape (b, m, n, 7)
        Out: forces at the stored samples, SI units.

    Raises
    ------
    NoGpuError
        If there is no GPU; the text has the reason.
    """
    reason = missing()
    if reason:
        raise NoGpuError(reason)
    on_gpu = Runs._make(cuda.to_device(x) if isinstance(x, np.ndarray) else x for x in runs)
    results = cuda.device_array(states.shape), cuda.device_array(logged.shape)
    count = len(runs.y)
    _kernel()[(count + THREADS - 1) // THREADS, THREADS](dt, every, on_gpu, *results)
    results[0].copy_to_host(states)
    results[1].copy_to_host(logged)
