"""LPV model with wheel speeds as states: the paper's (29) and (31) with corrected units.

In (29) r is printed in one of the two terms of the second row; here both have it. (31) has
``cos(alpha)`` on the motion resistance; here resistance follows from the load, which already
contains the slope.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import MIN_TRANSIT_SPEED, slip_along_path
from traction_model.lpv.matrices import Matrices
from traction_model.lpv.model import LpvModel, OperatingPoint, WheelMotion
from traction_model.lpv.scheduling import Schedule, SchedulingParameter
from traction_model.lpv.shear_terms import SHEAR_TERMS, ShearTerms
from traction_model.soil.soil import N_EXP, SHEAR_MODULUS

Array = NDArray[np.float64]

LARGEST_INVERSE_SLIP = 1e4
"""Bound of |1/i| as a scheduling parameter, dimensionless; there is no thrust at this value."""


class SpeedLpvModel(LpvModel):
    """LPV model with x = [v, omega ...], u = T and u_uc = [tau_max, z of every wheel ..., D_x].

    The shear is ``F = tau_max*A*mobilisation`` with ``mobilisation = +-(1 - kappa)``. Torque does
    not act on v: the stress of the soil is an uncontrolled input, the paper's (28). In the form
    `EMPIRICAL` the mean pressure N/A replaces tau_max, and mobilisation is the gross traction
    ratio. Parameters and attributes: `traction_model.lpv.model.LpvModel`.
    """

    @property
    def _shear(self) -> ShearTerms:
        return SHEAR_TERMS[self.form]

    def _wheel_inputs(self) -> tuple[tuple[str, str], ...]:
        return (self._shear.STRESS, 'Pa'), ('sinkage', 'm')

    def _name_states(self, free: Sequence[str]) -> None:
        self.state_names = ('v', *(f'omega_{name}' for name in free))
        self.state_units = ('m/s', *('rad/s' for _ in free))
        self.output_names = ('v', *(f'omega_{name}' for name in self.vehicle.wheel_names))

    def _valid_ranges(self) -> list[SchedulingParameter]:
        width = np.array([wheel.width for wheel in self.vehicle.wheels])
        known = [
            SchedulingParameter('heading', '1', np.array([-1.0]), np.array([1.0])),
            self._range('sinkage_exponent', '1', 0.0, 3.0),
            self._range('area', 'm^2', width * self._min_length, 2 * width * self._radius),
            self._range('load', 'N', 0.0, self._largest_load),
            self._range('shear_deformation_modulus', 'm', 1e-4, 1.0),
            self._range(
                'inverse_slip', '1', -LARGEST_INVERSE_SLIP, LARGEST_INVERSE_SLIP, reciprocal=True
            ),
            # The shear stress is at most the strength, whose mean over the contact ahead of the
            # bottom is tau_max. So the bound is 1, and more with contact behind the bottom.
            self._range('mobilisation', '1', -3.0, 3.0),
            self._range('moment_mobilisation', '1', -3.0, 3.0),
            self._gradient_range(),
        ]
        by_name = {entry.name: entry for entry in known}
        return [by_name[name] for name in self._shear.PARAMETERS]

    def _operating_point(self, motion: WheelMotion, holding_force: float) -> OperatingPoint:
        found, v = motion.reaction, motion.v
        stress = self._shear.stress(found.load / found.area, motion.soils)
        # 0 for a wheel off the ground.
        stress = np.where(motion.z > 0, stress, 0.0)
        # Sign of the thrust; in reverse it differs from that of slip.
        slipping = [slip_along_path(v, rim) for rim in self._radius * motion.omega]
        values: dict[str, ArrayLike] = {
            'heading': max(-1.0, min(1.0, v / MIN_TRANSIT_SPEED)),
            'sinkage_exponent': motion.soils[:, N_EXP],
            'area': found.area,
            'load': found.load,
            'shear_deformation_modulus': motion.soils[:, SHEAR_MODULUS],
            'inverse_slip': [_bounded_inverse(value) for value in slipping],
            'mobilisation': self._mobilisation(found.shear, stress * found.area),
            'moment_mobilisation': self._mobilisation(
                found.shear_moment / self._radius, stress * found.area
            ),
            'resistance_gradient': motion.resistance_gradient,
        }
        rho = self.schedule(**{name: values[name] for name in self.parameters})
        x = np.array([v, *motion.omega[list(self.independent)]])
        u_uc = np.append(np.column_stack([stress, motion.z]).ravel(), holding_force)
        return OperatingPoint(rho, x, u_uc)

    def _mobilisation(self, force: Array, strength: Array) -> Array:
        """Force over strength, both in N."""
        bare = (strength == 0) & (np.abs(force) > 0)
        if np.any(bare):
            name = self.vehicle.wheel_names[int(np.flatnonzero(bare)[0])]
            raise ValueError(
                f"soil under wheel '{name}' has neither cohesion nor friction, which shear "
                'is scheduled by'
            )
        return np.asarray(np.divide(force, strength, out=np.zeros_like(force), where=strength > 0))

    def terms(self, rho: Schedule | Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Terms at a scheduling vector; the matrices are affine in them.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        dict of str to ndarray
            ``thrust_area``, m^2, thrust per tau_max, ``resistance_gradient``, N/m, and, in the
            form `CONTACT`, ``moment_area``, m^2, the shear's moment per tau_max and radius.

        Raises
        ------
        ValueError
            As `schedule`.
        """
        values = self.schedule(**(rho.values if isinstance(rho, Schedule) else rho)).values
        width = np.array([wheel.width for wheel in self.vehicle.wheels])
        return self._shear.areas(values, width)

    def assemble(self, terms: Mapping[str, Array]) -> Matrices:
        """Matrices from terms, without checks, see `LpvModel.assemble`."""
        n, g = self.constraint.shape
        # Effect of shear and moment of each wheel on the states: v, then wheels.
        force, torque = np.zeros((g + 1, 1)), np.zeros((g + 1, n))
        force[0] = 1 / self.vehicle.mass
        torque[1:] = self._per_torque
        A = np.zeros((g + 1, g + 1))
        A[1:, 1:] = -self._per_torque @ (self._friction[:, None] * self.constraint)
        lever = terms[self._shear.LEVER]
        by_stress = force * terms['thrust_area'] - torque * (self._radius * lever)
        by_sinkage = self._resistance_input(force, torque, terms['resistance_gradient'])
        # Inputs wheel by wheel, then D_x.
        by_wheel = np.stack([by_stress, by_sinkage], axis=2).reshape(g + 1, -1)
        C = np.zeros((n + 1, g + 1))
        C[0, 0] = 1.0
        C[1:, 1:] = self.constraint
        return Matrices(A, torque, np.hstack([by_wheel, -force]), C, np.zeros((n + 1, n)))


def _bounded_inverse(slipping: float) -> float:
    """1/slip, at most `LARGEST_INVERSE_SLIP` in magnitude."""
    if abs(slipping) * LARGEST_INVERSE_SLIP < 1:
        return math.copysign(LARGEST_INVERSE_SLIP, slipping)
    return 1 / slipping
