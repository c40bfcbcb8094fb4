"""Exponential and power in plain arithmetic, for vector instructions in loops over points.

The mathematical library takes one number per call, which would need half to three quarters of the
time of the stress integrals (``docs/performance.md``). Both functions agree with ``math.exp`` and
``math.pow`` within a few units of the last place, as the tests check.
"""

import math

import numpy as np

from traction_model.kernel import inlined

LN_2 = math.log(2.0)

# Coefficients of exp(r) = sum of r^k/k!, |r| <= ln(2)/2: the next term is below 2e-16.
EXP_TERMS = tuple(1.0 / math.factorial(k) for k in range(13))
# Of ln((1 + t)/(1 - t)) = 2*t*sum of t^(2k)/(2k + 1), |t| <= 3 - 2*sqrt(2): next below 3e-17.
LOG_TERMS = tuple(2.0 / (2 * k + 1) for k in range(10))

# A double is 2^(e - 1023)*(1 + fraction), with 52 bits of fraction below e.
FRACTION_BITS = 52
BIAS = 1023
SQRT_HALF_BITS = int(np.float64(math.sqrt(0.5)).view(np.int64))

MIN_EXPONENT = -708.0
MIN_BASE = 1e-300


@inlined
def exponential(x):
    """Exponential function.

    Parameters
    ----------
    x : float
        Dimensionless, at most 709; values below -708 count as -708.

    Returns
    -------
    float
        ``exp(x)``, dimensionless, within ``(3 + |x|)*1.2e-16`` of it, relative.
    """
    x = max(x, MIN_EXPONENT)
    doublings = math.floor(x / LN_2 + 0.5)
    rest = x - doublings * LN_2
    value = EXP_TERMS[12]
    for k in range(11, -1, -1):
        value = value * rest + EXP_TERMS[k]
    return value * np.int64((np.int64(doublings) + BIAS) << FRACTION_BITS).view(np.float64)


@inlined
def power(base, exponent):
    """Power of a non-negative number.

    Parameters
    ----------
    base : float
        Any unit, at least 0; values below 1e-300 count as 1e-300.
    exponent : float
        Dimensionless, above 0.

    Returns
    -------
    float
        ``base**exponent`` in the base's unit to that power, within
        ``(3 + 2*exponent*(1 + |ln(base)|))*1.2e-16`` of it, relative.
    """
    bits = np.float64(max(base, MIN_BASE)).view(np.int64)
    doublings = (bits - SQRT_HALF_BITS) >> FRACTION_BITS
    mantissa = np.int64(bits - (doublings << FRACTION_BITS)).view(np.float64)
    t = (mantissa - 1.0) / (mantissa + 1.0)
    square = t * t
    logarithm = LOG_TERMS[9]
    for k in range(8, -1, -1):
        logarithm = logarithm * square + LOG_TERMS[k]
    return exponential(exponent * (doublings * LN_2 + t * logarithm))
