"""Empirical traction curves: Brixius, Burckhardt, Pacejka, and their fits to samples.

A curve gives the gross traction ratio (thrust over load) and the motion resistance ratio of a
wheel from slip alone, for vehicles whose soil is known by its cone index, or by measured pull,
and not by Bekker's parameters.

Sources: ASABE D497.7, after W. W. Brixius, Traction prediction equations for bias ply tires,
ASAE Paper 87-1622, 1987; M. Burckhardt, Fahrwerktechnik: Radschlupf-Regelsysteme, 1993; H. B.
Pacejka, Tire and Vehicle Dynamics, 3rd edition, 2012, chapter 4.
"""

import math
from abc import abstractmethod
from enum import IntEnum
from typing import ClassVar, NamedTuple, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import Field, model_validator

from traction_model.definition import Definition
from traction_model.kernel import inlined, kernel
from traction_model.slip import checked_slip

# Columns of a packed curve: law, coefficients, rolling resistance (not for Brixius).
LAW, FIRST, SECOND, THIRD, FOURTH, ROLLING, CURVE_COLUMNS = range(7)

LARGEST_MOBILITY_NUMBER = 1e4
"""Upper bound of the mobility number in a fit; far above it the curve no longer changes."""


class Law(IntEnum):
    """Law of an empirical traction curve, as a packed curve holds it.

    Attributes
    ----------
    BRIXIUS
        ASABE D497: exponential in slip, from one mobility number.
    BURCKHARDT
        Exponential rise and linear fall.
    PACEJKA
        The magic formula.
    """

    BRIXIUS = 0
    BURCKHARDT = 1
    PACEJKA = 2


# The same as integers, for kernels.
BRIXIUS, BURCKHARDT, PACEJKA = (int(law) for law in Law)


@inlined
def curve_ratios(curve, slip):
    """Gross traction and motion resistance of one wheel, both over its load.

    Parameters
    ----------
    curve : ndarray, shape (6,)
        A packed curve, dimensionless.
    slip : float
        Slip, -1 (locked) to 1 (spinning).

    Returns
    -------
    gross : float
        Gross traction ratio, dimensionless, positive in the direction of motion.
    resistance : float
        Motion resistance ratio, dimensionless, at least 0: against the motion.
    """
    size = abs(slip)
    sign = 1.0 if slip >= 0.0 else -1.0
    if curve[LAW] == BRIXIUS:
        mobility = curve[FIRST]
        rise = 0.88 * math.expm1(-0.1 * mobility) * math.expm1(-7.5 * size)
        return sign * rise + 0.04, 1.0 / mobility + 0.04 + 0.5 * size / math.sqrt(mobility)
    if curve[LAW] == BURCKHARDT:
        gross = -curve[FIRST] * math.expm1(-curve[SECOND] * size) - curve[THIRD] * size
    else:
        x = curve[FIRST] * size
        bend = x - curve[FOURTH] * (x - math.atan(x))
        gross = curve[THIRD] * math.sin(curve[SECOND] * math.atan(bend))
    return sign * gross, curve[ROLLING]


@kernel
def _ratios_over(curve, slips):
    """`curve_ratios` at every slip of an array, shape (2, len(slips))."""
    ratios = np.empty((2, slips.size))
    for k in range(slips.size):
        ratios[0, k], ratios[1, k] = curve_ratios(curve, slips[k])
    return ratios


class Curve(Definition):
    """Base of the empirical curves: ratios over slip, the same for any load."""

    _starts: ClassVar[tuple[tuple[float, ...], ...]]
    _bounds: ClassVar[tuple[tuple[float, ...], tuple[float, ...]]]

    @abstractmethod
    def packed(self) -> NDArray[np.float64]:
        """Pack the curve for the kernels.

        Returns
        -------
        ndarray, shape (6,)
            Number of the law, its coefficients, rolling resistance; all dimensionless.
        """

    @classmethod
    @abstractmethod
    def _of(cls, free: NDArray[np.float64]) -> Self:
        """Curve from the free parameters of a fit."""

    def gross_traction_ratio(self, slip: ArrayLike) -> NDArray[np.float64]:
        """Gross traction over load: torque over rolling radius and load.

        Parameters
        ----------
        slip : array_like
            Slip, -1 (locked) to 1 (spinning), any shape.

        Returns
        -------
        ndarray
            Dimensionless, shape of `slip`; positive in the direction of motion.

        Raises
        ------
        ValueError
            If a slip is not a number from -1 to 1.
        """
        return np.asarray(self._ratios(slip)[0])

    def motion_resistance_ratio(self, slip: ArrayLike) -> NDArray[np.float64]:
        """Motion resistance over load.

        Parameters
        ----------
        slip : array_like
            Slip, -1 (locked) to 1 (spinning), any shape.

        Returns
        -------
        ndarray
            Dimensionless, shape of `slip`, at least 0: against the motion.

        Raises
        ------
        ValueError
            If a slip is not a number from -1 to 1.
        """
        return np.asarray(self._ratios(slip)[1])

    def net_traction_ratio(self, slip: ArrayLike) -> NDArray[np.float64]:
        """Net traction (drawbar pull) over load: gross traction less motion resistance.

        Parameters
        ----------
        slip : array_like
            Slip, -1 (locked) to 1 (spinning), any shape.

        Returns
        -------
        ndarray
            Dimensionless, shape of `slip`; positive in the direction of motion.

        Raises
        ------
        ValueError
            If a slip is not a number from -1 to 1.
        """
        gross, resistance = self._ratios(slip)
        return np.asarray(gross - resistance)

    def _ratios(self, slip: ArrayLike) -> NDArray[np.float64]:
        slips = checked_slip(slip)
        ratios: NDArray[np.float64] = _ratios_over(self.packed(), slips.ravel())
        return ratios.reshape((2, *slips.shape))


class Brixius(Curve):
    """Traction of a bias ply tractor tyre by Brixius, as in ASABE D497.

    ``GTR = 0.88*(1 - exp(-0.1*Bn))*(1 - exp(-7.5*s)) + 0.04``,
    ``MRR = 1/Bn + 0.04 + 0.5*s/sqrt(Bn)``.

    The standard covers driven wheels, s >= 0. For braking the curve is continued by symmetry: the
    gross traction ratio is odd about (0, 0.04), with a continuous slope, and motion resistance
    grows with the magnitude of slip.

    Attributes
    ----------
    mobility_number : float
        Bn, dimensionless, above 0: about 20 on soft soil, 30 tilled, 55 firm, 80 hard.
    """

    mobility_number: float = Field(gt=0)

    # The logarithm is varied, so the number stays above zero.
    _starts: ClassVar = ((math.log(3.0),), (math.log(30.0),))
    _bounds: ClassVar = ((math.log(1e-2),), (math.log(LARGEST_MOBILITY_NUMBER),))

    @classmethod
    def from_tyre(
        cls,
        *,
        cone_index: float,
        width: float,
        diameter: float,
        load: float,
        section_height: float,
        deflection: float,
    ) -> 'Brixius':
        """Curve of a tyre on a soil of known cone index.

        ``Bn = CI*b*d/W * (1 + 5*delta/h)/(1 + 3*b/d)``.

        Parameters
        ----------
        cone_index : float
            CI, Pa, above 0: mean of the top 0.15 m.
        width : float
            b, m, above 0: section width of the unloaded tyre.
        diameter : float
            d, m, above 0: overall diameter of the unloaded tyre.
        load : float
            W, N, above 0: load on the tyre.
        section_height : float
            h, m, above 0: of the unloaded tyre.
        deflection : float
            delta, m, at least 0 and below `section_height`: of the loaded tyre on hard ground.

        Returns
        -------
        Brixius
            The curve.

        Raises
        ------
        ValueError
            If an argument is out of range.
        """
        for name, value, allowed in (
            ('cone_index', cone_index, cone_index > 0),
            ('width', width, width > 0),
            ('diameter', diameter, diameter > 0),
            ('load', load, load > 0),
            ('section_height', section_height, section_height > 0),
            ('deflection', deflection, 0 <= deflection < section_height),
        ):
            if not (math.isfinite(value) and allowed):
                raise ValueError(f'{name} is out of range: {value}')
        number = cone_index * width * diameter / load
        number *= (1 + 5 * deflection / section_height) / (1 + 3 * width / diameter)
        return cls(mobility_number=number)

    def packed(self) -> NDArray[np.float64]:
        """Pack the curve for the kernels.

        Returns
        -------
        ndarray, shape (6,)
            Number of the law, Bn, and zeros; dimensionless.
        """
        return np.array([Law.BRIXIUS, self.mobility_number, 0.0, 0.0, 0.0, 0.0], dtype=float)

    @classmethod
    def _of(cls, free: NDArray[np.float64]) -> 'Brixius':
        return cls(mobility_number=math.exp(free[0]))


class Burckhardt(Curve):
    """Burckhardt's curve, odd in slip, less a constant rolling resistance.

    ``mu = c1*(1 - exp(-c2*|s|)) - c3*|s|`` in the direction of slip.

    Attributes
    ----------
    c1 : float
        Limit of the exponential part, dimensionless, above 0.
    c2 : float
        Rate of the rise, dimensionless, above 0; the initial slope is ``c1*c2 - c3``.
    c3 : float
        Slope of the fall, dimensionless, from 0 to ``c1*(1 - exp(-c2))``, where traction is 0 at
        slip 1.
    rolling_resistance : float
        Motion resistance ratio, dimensionless, at least 0, at any slip.
    """

    c1: float = Field(gt=0)
    c2: float = Field(gt=0)
    c3: float = Field(ge=0)
    rolling_resistance: float = Field(default=0.0, ge=0)

    # The third parameter is c3 over its upper limit.
    _starts: ClassVar = ((0.6, 10.0, 0.1, 0.05), (0.6, 2.0, 0.1, 0.05))
    _bounds: ClassVar = ((1e-6, 1e-3, 0.0, 0.0), (1e2, 1e3, 1.0, 1e1))

    @model_validator(mode='after')
    def _never_pushes(self) -> 'Burckhardt':
        most = -self.c1 * math.expm1(-self.c2)
        # Tolerance for rounding, as a fit may be on the limit.
        if self.c3 > most * (1 + 1e-9):
            raise ValueError(
                f'c3 is {self.c3}, above c1*(1 - exp(-c2)) = {most:.6g}: a locked wheel would be '
                'pushed along'
            )
        return self

    def packed(self) -> NDArray[np.float64]:
        """Pack the curve for the kernels.

        Returns
        -------
        ndarray, shape (6,)
            Number of the law, c1, c2, c3, 0, rolling resistance; dimensionless.
        """
        return np.array(
            [Law.BURCKHARDT, self.c1, self.c2, self.c3, 0.0, self.rolling_resistance],
            dtype=float,
        )

    @classmethod
    def _of(cls, free: NDArray[np.float64]) -> 'Burckhardt':
        c1, c2, share, rolling = map(float, free)
        return cls(c1=c1, c2=c2, c3=-share * c1 * math.expm1(-c2), rolling_resistance=rolling)


class Pacejka(Curve):
    """Pacejka's magic formula for longitudinal slip, less a constant rolling resistance.

    ``mu = D*sin(C*atan(B*s - E*(B*s - atan(B*s))))``, odd in slip, without shifts.

    Attributes
    ----------
    stiffness_factor : float
        B, dimensionless, above 0: the initial slope is B*C*D.
    shape_factor : float
        C, dimensionless, 1 to 2; below 1 D is no peak, above 2 the force changes its sign.
    peak_factor : float
        D, dimensionless, above 0: the peak, or with C = 1 the limit at large B*s.
    curvature_factor : float
        E, dimensionless, at most 1; above 1 the curve turns back at large slip.
    rolling_resistance : float
        Motion resistance ratio, dimensionless, at least 0, at any slip.
    """

    stiffness_factor: float = Field(gt=0)
    shape_factor: float = Field(ge=1, le=2)
    peak_factor: float = Field(gt=0)
    curvature_factor: float = Field(le=1)
    rolling_resistance: float = Field(default=0.0, ge=0)

    # The error has several minima: steep or slow rise, with or without a peak.
    _starts: ClassVar = (
        (10.0, 1.6, 0.6, 0.5, 0.05),
        (10.0, 1.1, 0.6, 0.0, 0.05),
        (2.0, 1.6, 0.6, 0.0, 0.05),
        (2.0, 1.1, 0.6, -1.0, 0.05),
    )
    _bounds: ClassVar = ((1e-3, 1.0, 1e-6, -1e2, 0.0), (1e3, 2.0, 1e2, 1.0, 1e1))

    def packed(self) -> NDArray[np.float64]:
        """Pack the curve for the kernels.

        Returns
        -------
        ndarray, shape (6,)
            Number of the law, B, C, D, E, rolling resistance; dimensionless.
        """
        return np.array(
            [
                Law.PACEJKA,
                self.stiffness_factor,
                self.shape_factor,
                self.peak_factor,
                self.curvature_factor,
                self.rolling_resistance,
            ],
            dtype=float,
        )

    @classmethod
    def _of(cls, free: NDArray[np.float64]) -> 'Pacejka':
        return cls(**dict(zip(cls.model_fields, map(float, free), strict=True)))


class CurveFit(NamedTuple):
    """Quality of the fit of a curve to its samples, all dimensionless.

    Attributes
    ----------
    net_rms, net_max : float
        Root mean square and largest error of the net traction ratio, dimensionless.
    gross_rms, gross_max : float or None
        The same for the gross traction ratio, dimensionless; None without samples of it.
    """

    net_rms: float
    net_max: float
    gross_rms: float | None
    gross_max: float | None


Fitted = TypeVar('Fitted', bound=Curve)


def fit_curve(
    law: type[Fitted],
    slip: ArrayLike,
    net_traction_ratio: ArrayLike,
    gross_traction_ratio: ArrayLike | None = None,
) -> tuple[Fitted, CurveFit]:
    """Fit an empirical curve to samples by least squares.

    Samples are measured, or computed for a soil::

        figures = tractive_figures(soil, wheel, np.linspace(0, 0.9, 50), load)
        curve, fit = fit_curve(
            Pacejka, figures.slip, figures.net_traction_ratio, figures.gross_traction_ratio
        )

    Parameters
    ----------
    law : type
        `Brixius`, `Burckhardt` or `Pacejka`.
    slip : array_like, shape (n,)
        Slip of each sample, -1 to 1.
    net_traction_ratio : array_like, shape (n,)
        Drawbar pull over load, dimensionless.
    gross_traction_ratio : array_like, shape (n,), optional
        Torque over rolling radius and load, dimensionless, with the same weight as the net ratio.
        It separates traction from resistance; without it only their difference is determined.

    Returns
    -------
    curve : Brixius, Burckhardt or Pacejka
        Curve with the minimum sum of squares.
    fit : CurveFit
        Its errors, dimensionless.

    Raises
    ------
    ValueError
        If samples are not finite, have different shapes, are out of range, or are fewer than the
        coefficients of the curve.
    TypeError
        If `law` is not one of the three.
    """
    # Imported on demand, since the import takes longer than that of the rest of the package.
    from scipy.optimize import least_squares

    if law not in (Brixius, Burckhardt, Pacejka):
        raise TypeError(f'law must be Brixius, Burckhardt or Pacejka, got {law!r}')
    slips = checked_slip(slip)
    measured = [('net_traction_ratio', net_traction_ratio)]
    if gross_traction_ratio is not None:
        measured.append(('gross_traction_ratio', gross_traction_ratio))
    samples = []
    for name, values in measured:
        array = np.asarray(values, dtype=float)
        if slips.ndim != 1 or array.shape != slips.shape:
            raise ValueError(
                f'{name} must be one number per slip: shapes are {array.shape} and {slips.shape}'
            )
        if not np.all(np.isfinite(array)):
            raise ValueError(f'{name} holds what is not a finite number')
        samples.append(array)
    coefficients = len(law._starts[0])
    if slips.size < coefficients:
        raise ValueError(
            f'{law.__name__} has {coefficients} coefficients: {slips.size} samples are too few'
        )

    def errors(free: NDArray[np.float64]) -> NDArray[np.float64]:
        gross, resistance = law._of(free)._ratios(slips)
        ratios = (gross - resistance, gross)[: len(samples)]
        return np.concatenate(np.subtract(ratios, samples))

    best = min(
        (least_squares(errors, start, bounds=law._bounds, x_scale='jac') for start in law._starts),
        key=lambda result: float(result.cost),
    )
    net, *gross = np.split(best.fun, len(samples))
    return law._of(best.x), CurveFit(
        rms(net),
        float(np.max(np.abs(net))),
        rms(gross[0]) if gross else None,
        float(np.max(np.abs(gross[0]))) if gross else None,
    )


def rms(errors: NDArray[np.float64]) -> float:
    """Root mean square.

    Parameters
    ----------
    errors : ndarray
        Errors, in any unit, at least one.

    Returns
    -------
    float
        In the unit of the errors.
    """
    return float(np.sqrt(np.mean(np.square(errors))))
