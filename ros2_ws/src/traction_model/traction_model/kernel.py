"""How kernels are compiled: Numba, cached on disk, or plain Python with NUMBA_DISABLE_JIT=1."""

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar('Function', bound=Callable[..., Any])


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
    compiled: Function = numba.njit(cache=True, error_model='numpy')(function)
    return compiled
