"""Set-point: the optimal slip target on the estimated soil.

At a common slip of all wheels

    J(i) = (1 - w)*TE(i)/max(TE) + w*P(i)/max(P)

weighs tractive efficiency TE against net traction P. Its maximum within the bounds is the goal.
The forces are those of the contact form (`traction_model.contact.tractive`) on the nominal soil,
with cohesion and tan(phi) scaled to the estimated maximum shear stress and with the estimated
shear deformation modulus K. They are computed once over a grid of strength, K and slip (some
tenths of a second for two axles); an evaluation then takes some tens of microseconds. The target
follows the goal with a lag and a rate limit.
"""

import math
from collections.abc import Sequence

import numpy as np

from traction_model.contact.tractive import static_contact_length, tractive_figures
from traction_model.interpolation import GridTable
from traction_model.soil.soil import Soil
from traction_model.vehicle.vehicle import Vehicle
from traction_model.vehicle.wheel import Wheel
from traction_node.positive import check_positive

# Grids: strength and K over those of the nominal soil, uniform in their logarithms.
_STRENGTHS = np.geomspace(0.2, 5.0, 13)
_MODULI = np.geomspace(0.25, 4.0, 9)
_SLIPS = np.linspace(0.01, 0.6, 60)


class SetPoint:
    """Slip target from the estimated soil.

    Parameters
    ----------
    vehicle : Vehicle
        The vehicle.
    soil : Soil
        Nominal soil, the same as in the estimator, whose maximum shear stress refers to the
        contact area on it.
    weight : float
        w: 0 for maximum tractive efficiency, 1 for maximum net traction.
    low, high : float
        Bounds of the target, slip, 0.01 to 0.6.
    rate : float
        Limit of the rate of the target, slip per second (1/s), above 0.
    time_constant : float
        Lag of the target behind the goal, s, above 0.

    Attributes
    ----------
    target : float or None
        Present target, slip; None before a soil is known.
    goal : float or None
        Optimal slip on the newest estimated soil.

    Raises
    ------
    ValueError
        If an argument is out of range, or the nominal soil does not carry a wheel.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        soil: Soil,
        weight: float = 0.0,
        low: float = 0.05,
        high: float = 0.3,
        rate: float = 0.01,
        time_constant: float = 5.0,
    ) -> None:
        if not 0.01 <= low <= high <= 0.6:
            raise ValueError(f'bounds of the target must be 0.01 to 0.6, got {low} to {high}')
        check_positive(rate=rate, time_constant=time_constant)
        self.set_weight(weight)
        self.low, self.high, self.rate, self.time_constant = low, high, rate, time_constant
        self._modulus = soil.shear_deformation_modulus
        # For every wheel: nominal maximum shear stress, Pa, and index of its curves.
        self._nominal: list[float] = []
        self._kind: list[int] = []
        kinds: list[tuple[Wheel, float]] = []
        for wheel, exact in zip(vehicle.wheels, vehicle.static_loads(), strict=True):
            load = round(float(exact), 6)
            area = wheel.width * static_contact_length(soil, wheel, load)
            self._nominal.append(soil.max_shear_stress(load / area))
            if (wheel, load) not in kinds:
                kinds.append((wheel, load))
            self._kind.append(kinds.index((wheel, load)))
        # For every kind of wheel: gross and net traction over slip, N, by strength and K.
        self._curves = []
        for wheel, load in kinds:
            curves = np.empty((len(_STRENGTHS), len(_MODULI), 2, len(_SLIPS)))
            for p, strength in enumerate(_STRENGTHS):
                for q, modulus in enumerate(_MODULI):
                    ground = soil.sheared(float(strength), float(modulus))
                    figures = tractive_figures(ground, wheel, _SLIPS, load)
                    curves[p, q] = figures.gross_traction, figures.net_traction
            self._curves.append(GridTable([np.log(_STRENGTHS), np.log(_MODULI)], curves))
        self.reset()

    def reset(self) -> None:
        """Reset soil, goal and target."""
        # Strength and K of every wheel over those of the nominal soil; None: unknown.
        self._soils: list[tuple[float, float] | None] = [None] * len(self._nominal)
        self.target: float | None = None
        self.goal: float | None = None

    def set_weight(self, weight: float) -> None:
        """Set the weight of net traction against efficiency.

        Parameters
        ----------
        weight : float
            w, 0 to 1, dimensionless.

        Raises
        ------
        ValueError
            If it is outside 0 to 1.
        """
        if not 0 <= weight <= 1:
            raise ValueError(f'weight must be 0 (efficiency) to 1 (pull), got {weight}')
        self.weight = weight

    def update(
        self,
        dt: float,
        present: float,
        max_shear_stress: Sequence[float],
        valid: Sequence[bool],
        shear_deformation_modulus: Sequence[float] | None = None,
    ) -> float | None:
        """Update the target with a terrain estimate.

        Parameters
        ----------
        dt : float
            Time since the last update, s, at least 0.
        present : float
            Slip target in force, the initial value of the target.
        max_shear_stress : sequence of float
            Maximum shear stress of every wheel, Pa.
        valid : sequence of bool
            True for valid values; for the others the last valid one is used.
        shear_deformation_modulus : sequence of float or None
            K of every wheel, m; NaN or None: that of the nominal soil.

        Returns
        -------
        float or None
            The target, slip; None before the soil of a wheel is known.
        """
        for j, stress in enumerate(max_shear_stress):
            if valid[j] and math.isfinite(stress) and stress > 0.0:
                modulus = self._modulus
                if shear_deformation_modulus is not None:
                    given = shear_deformation_modulus[j]
                    modulus = given if math.isfinite(given) and given > 0.0 else modulus
                self._soils[j] = stress / self._nominal[j], modulus / self._modulus
        goal = self._best()
        if goal is None:
            return self.target
        self.goal = goal
        if self.target is None:
            self.target = min(max(present, self.low), self.high)
        change = (goal - self.target) * (1.0 - math.exp(-dt / self.time_constant))
        most = self.rate * dt
        self.target += min(max(change, -most), most)
        return self.target

    def _best(self) -> float | None:
        """Slip of maximum J within the bounds; None without known soil or net traction."""
        gross, net = np.zeros((2, len(_SLIPS)))
        for soil, kind in zip(self._soils, self._kind, strict=True):
            if soil is not None:
                curves = self._curves[kind].at(*np.log(soil))
                gross += curves[0]
                net += curves[1]
        within = (_SLIPS - self.low > -1e-9) & (_SLIPS - self.high < 1e-9)
        efficiency = np.where(net > 0.0, (1.0 - _SLIPS) * net / np.maximum(gross, 1e-9), 0.0)
        if efficiency.max() <= 0.0:
            return None
        worth = (1.0 - self.weight) * efficiency / efficiency.max()
        worth += self.weight * net / net.max()
        worth[~within] = -np.inf
        best = int(np.argmax(worth))
        goal = float(_SLIPS[best])
        if within[best - 1 : best + 2].sum() == 3:
            # Vertex of the parabola through the best point and its neighbours.
            before, top, after = worth[best - 1 : best + 2]
            lean = float(0.5 * (before - after) / (before - 2.0 * top + after))
            goal += lean * float(_SLIPS[1] - _SLIPS[0])
        return min(max(goal, self.low), self.high)
