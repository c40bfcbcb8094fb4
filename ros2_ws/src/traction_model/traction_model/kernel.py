"""Compilation of kernels: Numba, cached on disk, or plain Python with NUMBA_DISABLE_JIT=1.

Division by zero gives infinity as in C, without an exception. Machine code is cached beside the
module. Sums may be reordered, so that loops over contact points use vector instructions. NaN and
infinity are handled as in IEEE 754.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar('Function', bound=Callable[..., Any])

OPTIONS = {
    'cache': True,
    'error_model': 'numpy',
    'fastmath': {'reassoc', 'contract', 'nsz', 'arcp'},
}

# Numba counts references to every array that a function unpacks, with locked instructions: four
# fifths of a step. Functions that create no array do not need it, since the caller holds a
# reference.
UNCOUNTED = OPTIONS | {'_nrt': False}


def kernel(function: Function) -> Function:
    """Compile a function of floats and arrays with Numba.

    Parameters
    ----------
    function : callable
        The function, within Numba's subset of Python.

    Returns
    -------
    callable
        The compiled function.
    """
    compiled: Function = numba.njit(**OPTIONS)(function)
    return compiled


def lean_kernel(function: Function) -> Function:
    """Compile a function that creates no array, for inner loops.

    Parameters
    ----------
    function : callable
        The function, within Numba's subset of Python. It may change its array arguments, but
        returns no array.

    Returns
    -------
    callable
        The compiled function.
    """
    compiled: Function = numba.njit(**UNCOUNTED)(function)
    return compiled


def inlined(function: Function) -> Function:
    """Compile a function as `lean_kernel`, inlined into each kernel that calls it.

    It is for small functions, and for functions with many array arguments: passing one array costs
    as much as ten multiplications.

    Parameters
    ----------
    function : callable
        The function, within Numba's subset of Python; as for `lean_kernel`.

    Returns
    -------
    callable
        The compiled function.
    """
    compiled: Function = numba.njit(**UNCOUNTED, forceinline=True)(function)
    return compiled
