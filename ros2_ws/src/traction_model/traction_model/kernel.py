"""Compilation of kernels: Numba, cached on disk, or plain Python with NUMBA_DISABLE_JIT=1.

Division by zero gives infinity as in C, not an exception, and the machine code is cached beside
the module. Sums may be taken in another order, so that loops over points of a contact use the
processor's vector instructions; NaN and infinity stay what they are.
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

# Numba counts references to every array that a function takes apart, in instructions that lock
# memory: four fifths of a step. Functions that make no array need no count, their caller has it.
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
    """Compile a function that makes no array, for inner loops.

    Parameters
    ----------
    function : callable
        The function, within Numba's subset of Python; it changes arrays that it is given, and
        calls functions that do so, but returns none.

    Returns
    -------
    callable
        The compiled function.
    """
    compiled: Function = numba.njit(**UNCOUNTED)(function)
    return compiled


def inlined(function: Function) -> Function:
    """Compile a function as `lean_kernel` does, to be merged into each kernel that calls it.

    For small functions, and for those that are given many arrays: handing one array over costs
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
