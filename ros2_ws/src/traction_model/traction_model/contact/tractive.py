"""Tractive figures of wheels and vehicles in steady motion, in the terms of ASABE S296.

- *Gross traction*: input torque over rolling radius, N.
- *Net traction*: force of the wheel on the vehicle in the direction of motion, drawbar pull, N.
- *Motion resistance*: gross less net traction, N.
- *Net (dynamic) traction ratio*: net traction over the load on the soil, dimensionless.
- *Tractive efficiency*: output power (net traction times speed) over input power (torque times
  wheel speed), dimensionless; driving, ``(1 - i)*net/gross``.

Steady motion: no acceleration and constant sinkage.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import Form, check_form, contact, equilibrium_sinkage
from traction_model.slip import checked_slip
from traction_model.soil.empirical import Curve, curve_ratios
from traction_model.soil.soil import Soil
from traction_model.vehicle.vehicle import Vehicle
from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive

LARGEST_SLIP = 0.9
"""Upper bound of the search for the best slip."""


class TractiveFigures(NamedTuple):
    """Forces of a wheel, or of all wheels of a vehicle, in steady motion.

    Attributes
    ----------
    slip : ndarray
        Slip, -1 (locked) to 1 (spinning), any shape.
    load : float
        N, load on the soil.
    gross_traction : ndarray, shape of `slip`
        N, input torque over rolling radius.
    thrust : ndarray, shape of `slip`
        N, shear force of the soil in the direction of motion, without resistance.
    net_traction : ndarray, shape of `slip`
        N, drawbar pull.
    """

    slip: NDArray[np.float64]
    load: float
    gross_traction: NDArray[np.float64]
    thrust: NDArray[np.float64]
    net_traction: NDArray[np.float64]

    @property
    def motion_resistance(self) -> NDArray[np.float64]:
        """Gross less net traction, N, shape of `slip`."""
        return np.asarray(self.gross_traction - self.net_traction)

    @property
    def gross_traction_ratio(self) -> NDArray[np.float64]:
        """Gross traction over load, dimensionless, shape of `slip`."""
        return np.asarray(self.gross_traction / self.load)

    @property
    def net_traction_ratio(self) -> NDArray[np.float64]:
        """Net traction over load (the dynamic ratio), dimensionless, shape of `slip`."""
        return np.asarray(self.net_traction / self.load)

    @property
    def motion_resistance_ratio(self) -> NDArray[np.float64]:
        """Motion resistance over load, dimensionless, shape of `slip`."""
        return np.asarray(self.motion_resistance / self.load)

    @property
    def tractive_efficiency(self) -> NDArray[np.float64]:
        """Output power over input power, 0 to 1, shape of `slip`.

        0 without net traction or without input power.
        """
        slip = np.asarray(self.slip)
        output = self.net_traction * np.where(slip > 0, 1 - slip, 1.0)
        put_in = self.gross_traction * np.where(slip > 0, 1.0, 1 + slip)
        working = (output > 0) & (put_in > 0)
        return np.where(working, output / np.where(working, put_in, 1.0), 0.0)


def static_contact_length(soil: Soil, wheel: Wheel, load: float) -> float:
    """Contact length at standstill, by the contact form.

    Parameters
    ----------
    soil : Soil
        The soil.
    wheel : Wheel
        The wheel.
    load : float
        N, above 0.

    Returns
    -------
    float
        m.
    """
    sinkage = equilibrium_sinkage(
        int(Form.CONTACT), 0.0, 0.0, load, soil.packed(wheel), wheel.radius, wheel.width
    )
    return wheel.contact_length(sinkage)


def steady_contact(
    soil: Soil,
    wheel: Wheel,
    slip: float,
    load: float,
    form: Form = Form.CONTACT,
    speed: float = 1.0,
) -> tuple[float, float, float, float]:
    """Sinkage and forces of one wheel in steady motion.

    Parameters
    ----------
    soil : Soil
        The soil.
    wheel : Wheel
        The wheel.
    slip : float
        Slip, -1 (locked) to 1 (spinning).
    load : float
        N, above 0.
    form : Form
        Form of the contact model.
    speed : float
        m/s, above 0: the larger of ground speed and rim speed.

    Returns
    -------
    sinkage, thrust, resistance, moment : float
        Equilibrium sinkage, m; thrust and motion resistance, N; moment about the wheel's centre,
        N·m, positive when it resists.

    Raises
    ------
    ValueError
        If an argument is out of range, or the soil does not carry the load.
    """
    check_positive(load=load, speed=speed)
    slip = float(checked_slip(slip))
    check_form(form, [soil])
    v = speed * min(1.0, 1.0 - slip)
    omega = speed * min(1.0, 1.0 + slip) / wheel.radius
    # The only call of the contact kernels for steady motion.
    motion = (int(form), v, omega)
    ground = (soil.packed(wheel), wheel.radius, wheel.width)
    sinkage = equilibrium_sinkage(*motion, load, *ground)
    carried, thrust, resistance, moment = contact(*motion, sinkage, 0.0, *ground)
    if sinkage >= wheel.radius and carried < load:
        raise ValueError(
            f'the soil carries {carried:.0f} N of the load of {load:.0f} N with the wheel sunk '
            'to its axle: lower the load or take a stronger soil'
        )
    return sinkage, thrust, resistance, moment


def tractive_figures(
    ground: Soil | Curve,
    wheel: Wheel | Vehicle,
    slip: ArrayLike,
    load: float | None = None,
    form: Form = Form.CONTACT,
    speed: float = 1.0,
) -> TractiveFigures:
    """Tractive figures at given slip.

    Parameters
    ----------
    ground : Soil or Curve
        A soil, or an empirical curve of wheel and soil.
    wheel : Wheel or Vehicle
        One wheel, or a vehicle, with equal slip of all wheels on undisturbed soil under static
        loads.
    slip : array_like
        Slip, -1 (locked) to 1 (spinning), any shape.
    load : float, optional
        N, above 0: load on the wheel; not for a vehicle.
    form : Form
        Form of the contact model; without effect on a curve.
    speed : float
        m/s, above 0: the larger of ground speed and rim speed; without effect on a curve.

    Returns
    -------
    TractiveFigures
        Figures, summed over the wheels of a vehicle; forces in N.

    Raises
    ------
    ValueError
        If an argument is out of range, or the soil does not carry a wheel.
    """
    slips = checked_slip(slip)
    loaded = _loaded_wheels(wheel, load)
    gross, thrust, net = np.zeros((3, slips.size))
    for each, carried in loaded:
        for k, value in enumerate(slips.flat):
            if isinstance(ground, Curve):
                pull, drag = curve_ratios(ground.packed(), value)
                gross[k] += pull * carried
                thrust[k] += pull * carried
                net[k] += (pull - drag) * carried
            else:
                _, push, drag, moment = steady_contact(ground, each, value, carried, form, speed)
                gross[k] += moment / each.radius
                thrust[k] += push
                net[k] += push - drag
    return TractiveFigures(
        slips,
        sum(carried for _, carried in loaded),
        gross.reshape(slips.shape),
        thrust.reshape(slips.shape),
        net.reshape(slips.shape),
    )


def _loaded_wheels(wheel: Wheel | Vehicle, load: float | None) -> list[tuple[Wheel, float]]:
    """Wheels with the load on each, N."""
    if isinstance(wheel, Vehicle):
        if load is not None:
            raise ValueError('a vehicle brings its own loads: leave load out')
        return list(zip(wheel.wheels, map(float, wheel.static_loads()), strict=True))
    if load is None or not (math.isfinite(load) and load > 0):
        raise ValueError(f'load on the wheel must be above 0 N, got {load}')
    return [(wheel, load)]


def optimum_slip(
    ground: Soil | Curve,
    wheel: Wheel | Vehicle,
    load: float | None = None,
    form: Form = Form.CONTACT,
    speed: float = 1.0,
) -> float:
    """Slip of maximum tractive efficiency, above 0 and up to 0.9.

    Parameters
    ----------
    ground : Soil or Curve
        A soil, or an empirical curve of wheel and soil.
    wheel : Wheel or Vehicle
        One wheel, or a vehicle under its static loads.
    load : float, optional
        N, above 0: load on the wheel; not for a vehicle.
    form : Form
        Form of the contact model; without effect on a curve.
    speed : float
        m/s, above 0: rim speed; without effect on a curve.

    Returns
    -------
    float
        Slip, to about 1e-6.

    Raises
    ------
    ValueError
        If net traction is not positive at any slip, or as for `tractive_figures`.
    """

    def efficiency(slip: ArrayLike) -> NDArray[np.float64]:
        return tractive_figures(ground, wheel, slip, load, form, speed).tractive_efficiency

    best = _slip_of_most(efficiency)
    if efficiency(best) <= 0:
        raise ValueError(
            f'net traction is not positive at any slip up to {LARGEST_SLIP}: no slip is best'
        )
    return best


def greatest_pull_slip(
    ground: Soil | Curve,
    wheel: Wheel | Vehicle,
    load: float | None = None,
    form: Form = Form.CONTACT,
    speed: float = 1.0,
) -> float:
    """Slip of maximum net traction, above 0 and up to 0.9 (it may still rise there).

    Parameters
    ----------
    ground : Soil or Curve
        A soil, or an empirical curve of wheel and soil.
    wheel : Wheel or Vehicle
        One wheel, or a vehicle under its static loads.
    load : float, optional
        N, above 0: load on the wheel; not for a vehicle.
    form : Form
        Form of the contact model; without effect on a curve.
    speed : float
        m/s, above 0: rim speed; without effect on a curve.

    Returns
    -------
    float
        Slip, to about 1e-6.

    Raises
    ------
    ValueError
        As for `tractive_figures`.
    """
    return _slip_of_most(
        lambda slip: tractive_figures(ground, wheel, slip, load, form, speed).net_traction
    )


def _slip_of_most(figure: Callable[[ArrayLike], NDArray[np.float64]]) -> float:
    """Slip of the maximum of a figure: scan, then refinement around the best point."""
    # Imported on demand, since the import takes longer than that of the rest of the package.
    from scipy.optimize import minimize_scalar

    # Steps of 0.5 %, below the distance of maxima of a traction curve.
    scan = np.linspace(0.0, LARGEST_SLIP, 181)[1:]
    values = figure(scan)
    best = int(np.argmax(values))
    refined = minimize_scalar(
        lambda slip: -float(figure(slip)),
        bounds=(scan[best - 1] if best else 0.0, scan[min(best + 1, len(scan) - 1)]),
        method='bounded',
        options={'xatol': 1e-7},
    )
    return float(refined.x if -refined.fun >= values[best] else scan[best])
