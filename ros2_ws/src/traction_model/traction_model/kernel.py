"""How kernels are compiled: Numba, cached on disk, or plain Python with NUMBA_DISABLE_JIT=1."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar('Function', bound=Callable[..., Any])

# Sums may be taken in another order, so that loops over points of a contact use the processor's
# vector instructions. NaN and infinity stay what they are.
REORDERED = {'reassoc', 'contract', 'nsz', 'arcp'}


def kernel(function: Function) -> Function:
    """Compile a function of floats and arrays with Numba.

    Division by zero gives infinity as in C, not an exception, and the machine code is
    cached beside the module.

    Parameters
    ----------
    function : callable
        The function, within Numba's subset of Python.

    Returns
    -------
    callable
        The compiled function.
    """
    compiled: Function = numba.njit(cache=True, error_model='numpy', fastmath=REORDERED)(function)
    return compiled


def inlined(function: Function) -> Function:
    """Compile a function as `kernel` does, to be merged into each kernel that calls it.

    For small functions and for those that are given many arrays: handing one array over costs
    as much as ten multiplications.

    Parameters
    ----------
    function : callable
        The function, within Numba's subset of Python.

    Returns
    -------
    callable
        The compiled function.
    """
    compiled: Function = numba.njit(
        cache=True, error_model='numpy', fastmath=REORDERED, forceinline=True
    )(function)
    return compiled
