"""Kalman filters for measurements that depend on a few entries of the state.

All methods have one interface. `sigma_points` chooses points, the caller evaluates its nonlinear
function there, and `linearise` returns mean, slope and the variance of the residual:

- ``EKF``: a small step along each entry; the slope is the derivative.
- ``UKF``: cubature points at +-sqrt(k) along the columns of the Cholesky factor of the covariance
of
  k entries. Mean, slope and residual are those of statistical linear regression. This is the
  unscented transform of these entries with ``lambda = 0``.
- ``SCHEDULED_GAIN``: the derivative as for ``EKF``; the covariance comes from a table.

Updates use the Joseph form, which keeps the covariance symmetric and positive semidefinite for any
gain.

Sources: S. J. Julier and J. K. Uhlmann, Unscented filtering and nonlinear estimation, Proc. IEEE
92(3), 2004; T. Lefebvre, H. Bruyninckx and J. De Schutter, Comment on "A new method for the
nonlinear transformation of means and covariances in filters and estimators", IEEE Trans. Autom.
Control 47(8), 2002; I. Arasaratnam and S. Haykin, Cubature Kalman filters, IEEE Trans. Autom.
Control 54(6), 2009.
"""

import math
from enum import IntEnum

import numpy as np

from traction_model.kernel import kernel
from traction_node.closest import closest


class Method(IntEnum):
    """Kind of Kalman filter.

    Attributes
    ----------
    EKF
        Extended Kalman filter: derivatives.
    UKF
        Unscented Kalman filter: regression over sigma points.
    SCHEDULED_GAIN
        Filter with a precomputed covariance, interpolated in a table, and its gains.
    """

    EKF = 0
    UKF = 1
    SCHEDULED_GAIN = 2


_UKF = int(Method.UKF)


def method_named(name: str) -> Method:
    """Method of a name.

    Parameters
    ----------
    name : str
        ``ekf``, ``ukf`` or ``scheduled_gain``.

    Returns
    -------
    Method
        The method.

    Raises
    ------
    ValueError
        If there is no such method; the text has the nearest name.
    """
    names = {method.name.lower(): method for method in Method}
    if name not in names:
        raise ValueError(f"unknown method '{name}'{closest(str(name), names)}")
    return names[name]


@kernel
def propagate(x, p, transition, noise):
    """Predict: linear transition of state and covariance, in place.

    Parameters
    ----------
    x : ndarray, shape (m,)
        State, each entry in its own unit.
    p : ndarray, shape (m, m)
        Its covariance, in products of these units.
    transition : ndarray, shape (m, m)
        New state per old state, in their units.
    noise : ndarray, shape (m, m)
        Covariance that the transition adds, in products of the units.
    """
    x[:] = transition @ x
    p[:] = transition @ p @ transition.T + noise


@kernel
def reset_entry(p, entry, variance):
    """Reset variance and covariances of one entry of the state, in place; its value is kept.

    Parameters
    ----------
    p : ndarray, shape (m, m)
        Covariance, in products of the state's units.
    entry : int
        Index of the entry.
    variance : float
        Its new variance, in the square of its unit.
    """
    p[entry, :] = 0.0
    p[:, entry] = 0.0
    p[entry, entry] = variance


@kernel
def optimal_gain(p, h, variance, gain):
    """Gain of minimum variance for a scalar measurement.

    Parameters
    ----------
    p : ndarray, shape (m, m)
        Covariance, in products of the state's units.
    h : ndarray, shape (m,)
        Measurement per state, in their units.
    variance : float
        Variance of the measurement, in the square of its unit, above 0.
    gain : ndarray, shape (m,)
        Out: change of state per innovation, in their units.

    Returns
    -------
    float
        Variance of the innovation, in the square of the measurement's unit.
    """
    m = h.size
    total = variance
    for a in range(m):
        seen = 0.0
        for b in range(m):
            seen += p[a, b] * h[b]
        gain[a] = seen
        total += h[a] * seen
    gain /= total
    return total


@kernel
def update(x, p, h, gain, innovation, variance):
    """Update with one scalar measurement and any gain, in place, in the Joseph form.

    ``(I - K*h') * P * (I - K*h')' + K*R*K'`` is computed as
    ``P - K*(P*h)' - (P*h)*K' + K*(h'*P*h + R)*K'``.

    Parameters
    ----------
    x : ndarray, shape (m,)
        State, each entry in its own unit.
    p : ndarray, shape (m, m)
        Its covariance, in products of these units.
    h : ndarray, shape (m,)
        Derivative of the measurement with respect to the state, in their units.
    gain : ndarray, shape (m,)
        Change of state per innovation, in their units.
    innovation : float
        Measured minus expected value, in the measurement's unit.
    variance : float
        Variance of the measurement, in the square of its unit, above 0.
    """
    m = x.size
    seen = np.zeros(m)
    total = variance
    for a in range(m):
        for b in range(m):
            seen[a] += p[a, b] * h[b]
        total += h[a] * seen[a]
    for a in range(m):
        x[a] += gain[a] * innovation
        for b in range(a + 1):
            changed = gain[a] * gain[b] * total - gain[a] * seen[b] - seen[a] * gain[b]
            p[a, b] += changed
            if a != b:
                p[b, a] = p[a, b]


@kernel
def sigma_points(method, x, p, entries, steps, root, points):
    """Points for the evaluation of a function of k entries.

    For `UKF` cubature points at +-sqrt(k) along the Cholesky columns, else single steps.

    Parameters
    ----------
    method : int
        A `Method`.
    x : ndarray, shape (m,)
        State, each entry in its own unit.
    p : ndarray, shape (m, m)
        Its covariance, in products of these units.
    entries : ndarray of int, shape (k,)
        Indices of the entries that the function depends on, dimensionless.
    steps : ndarray, shape (k,)
        Step along each entry for the derivative, in its unit, not 0.
    root : ndarray, shape (k, k)
        Out, for `UKF`: Cholesky factor of the entries' covariance, lower triangle, in their
        units.
    points : ndarray, shape (1 + 2k, k)
        Out: values of the entries in their units, one point a row, the mean first.

    Returns
    -------
    int
        Number of points: 1 + 2k for `UKF`, else 1 + k.
    """
    k = entries.size
    for a in range(k):
        points[0, a] = x[entries[a]]
    if method != _UKF:
        for a in range(k):
            points[1 + a, :] = points[0, :]
            points[1 + a, a] += steps[a]
        return 1 + k
    for a in range(k):
        for b in range(a + 1):
            rest = p[entries[a], entries[b]]
            for c in range(b):
                rest -= root[a, c] * root[b, c]
            if a == b:
                root[a, a] = math.sqrt(max(rest, 0.0))
            else:
                # An exactly known entry has a zero column.
                root[a, b] = rest / root[b, b] if root[b, b] > 0.0 else 0.0
                root[b, a] = 0.0
    far = math.sqrt(k)
    for a in range(k):
        for b in range(k):
            points[1 + a, b] = points[0, b] + far * root[b, a]
            points[1 + k + a, b] = points[0, b] - far * root[b, a]
    return 1 + 2 * k


@kernel
def linearise(method, values, steps, root, slope):
    """Mean, slope and variance of the residual from the values of a function at the points.

    Parameters
    ----------
    method : int
        A `Method`, as for `sigma_points`.
    values : ndarray, shape (1 + 2k,)
        Values of the function at the points, in its unit.
    steps : ndarray, shape (k,)
        As for `sigma_points`, in the entries' units.
    root : ndarray, shape (k, k)
        As returned by `sigma_points`, in the entries' units.
    slope : ndarray, shape (k,)
        Out: function per entry, in their units.

    Returns
    -------
    mean, rest : float
        Expected value, in the function's unit, and variance about the line, in its square.
    """
    k = slope.size
    if method != _UKF:
        for a in range(k):
            slope[a] = (values[1 + a] - values[0]) / steps[a]
        return values[0], 0.0
    mean = 0.0
    for a in range(2 * k):
        mean += values[1 + a]
    mean /= 2 * k
    total = 0.0
    for a in range(2 * k):
        total += (values[1 + a] - mean) ** 2
    rest = total / (2 * k)
    # Slopes along the columns of the root, where the variance is one; root.T maps to the entries.
    for a in range(k - 1, -1, -1):
        projected = (values[1 + a] - values[1 + k + a]) / (2.0 * math.sqrt(k))
        rest -= projected * projected
        for b in range(a + 1, k):
            projected -= root[b, a] * slope[b]
        slope[a] = projected / root[a, a] if root[a, a] > 0.0 else 0.0
    return mean, max(rest, 0.0)
