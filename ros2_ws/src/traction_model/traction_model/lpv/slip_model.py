"""LPV model with slips as states; speed is then controllable by torque, too."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_model.contact.contact import MIN_TRANSIT_SPEED
from traction_model.lpv.matrices import Matrices
from traction_model.lpv.model import LpvModel, OperatingPoint, WheelMotion
from traction_model.lpv.scheduling import Schedule, SchedulingParameter
from traction_model.lpv.slip_slopes import rim_ratio, slip_slopes
from traction_model.slip import slip

Array = NDArray[np.float64]


class SlipLpvModel(LpvModel):
    """LPV model with x = [v, slip ...] and u = T.

    The uncontrolled inputs are u_uc = [thrust and moment at slip zero, z of every wheel ..., D_x]:
    shear is linear in slip, ``F = thrust_0 + slip_stiffness*i``. It is valid for forward motion at
    0.05 m/s and more. Parameters and attributes: `traction_model.lpv.model.LpvModel`.
    """

    _state = 'slip'

    def _wheel_inputs(self) -> tuple[tuple[str, str], ...]:
        return ('thrust', 'N'), ('moment', 'N·m'), ('sinkage', 'm')

    def _name_states(self, free: Sequence[str]) -> None:
        self.state_names = ('v', *(f'{self._state}_{name}' for name in free))
        self.state_units = ('m/s', *('1' for _ in free))
        self.output_names = self.state_names

    def _valid_ranges(self) -> list[SchedulingParameter]:
        # Order of magnitude: load*l/K, with l/K <= r/0.1 mm.
        stiffness = self._largest_load * self._radius / 1e-4
        lever = stiffness * self._radius
        return [
            SchedulingParameter('speed', 'm/s', np.array([MIN_TRANSIT_SPEED]), np.array([100.0])),
            self._state_range(),
            self._range('slip_stiffness', 'N', -stiffness, stiffness),
            self._range('moment_stiffness', 'N·m', -lever, lever),
            self._gradient_range(),
        ]

    def _state_range(self) -> SchedulingParameter:
        """Range of the states of the wheels."""
        return self._range('slip', '1', -0.99, 0.99)

    def _state_of(self, slipping: Array) -> Array:
        """State of wheels at a slip."""
        return slipping

    def _state_slope(self, slipping: Array) -> Array:
        """Slope of the state of a wheel over its slip, dimensionless."""
        return np.ones_like(slipping)

    def _operating_point(self, motion: WheelMotion, holding_force: float) -> OperatingPoint:
        n, v, omega, found = self.n_wheels, motion.v, motion.omega, motion.reaction
        slipping = np.array([slip(v, self._radius[j] * omega[j]) for j in range(n)])
        # Slopes over wheel speed at constant v, which is another state.
        shear_slope, moment_slope = np.empty(n), np.empty(n)
        for j in range(n):
            h = 1e-5 * max(abs(omega[j]), max(abs(v), MIN_TRANSIT_SPEED) / self._radius[j])
            below, above = (
                self._soil_reaction(
                    j, v, speed, motion.z[j], motion.z_rate[j], motion.soils[j], motion.imposed[j]
                )
                for speed in (omega[j] - h, omega[j] + h)
            )
            shear_slope[j] = (above.shear - below.shear) / (2 * h)
            moment_slope[j] = (above.shear_moment - below.shear_moment) / (2 * h)
        values: dict[str, ArrayLike] = {
            'speed': v,
            self._state: self._state_of(slipping),
            'resistance_gradient': motion.resistance_gradient,
        }
        # A division by zero here means speed or slip out of range; the check below raises the
        # error.
        with np.errstate(divide='ignore', invalid='ignore'):
            per_speed = slip_slopes(v, slipping)[1] * self._radius
            values['slip_stiffness'] = shear_slope / per_speed
            values['moment_stiffness'] = moment_slope / per_speed
        rho = self.schedule(**{name: values[name] for name in self.parameters})

        states = rho[self._state][list(self.independent)]
        turned = self._wheel_speed_per_state(v, slipping) @ states
        at_zero = [found.shear - shear_slope * turned, found.shear_moment - moment_slope * turned]
        u_uc = np.append(np.column_stack([*at_zero, motion.z]).ravel(), holding_force)
        return OperatingPoint(rho, np.array([v, *states]), u_uc)

    def _wheel_state_slopes(self, v: float, slipping: Array) -> tuple[Array, Array]:
        """Slopes of the independent wheels' states over v, s/m, and wheel speed, s/rad."""
        over_v, over_rim = slip_slopes(v, slipping)
        own = list(self.independent)
        factor = self._state_slope(slipping[own])
        return factor * over_v[own], factor * (over_rim * self._radius)[own]

    def _wheel_speed_per_state(self, v: float, slipping: Array) -> Array:
        """Slope of every wheel's speed over the independent wheels' states, rad/s, (n, g)."""
        return np.asarray(self.constraint / self._wheel_state_slopes(v, slipping)[1])

    def terms(self, rho: Schedule | Mapping[str, ArrayLike]) -> dict[str, Array]:
        """Terms of the matrices at a scheduling vector.

        Parameters
        ----------
        rho : Schedule or mapping
            Scheduling vector, each entry in its parameter's unit.

        Returns
        -------
        dict of str to ndarray
            ``speed``, m/s, ``slip``, dimensionless, ``slip_stiffness``, N, ``moment_stiffness``,
            N·m, and ``resistance_gradient``, N/m.

        Raises
        ------
        ValueError
            As `schedule`.
        """
        return dict(self.schedule(**(rho.values if isinstance(rho, Schedule) else rho)).values)

    def assemble(self, terms: Mapping[str, Array]) -> Matrices:
        """Matrices from terms, without checks, see `LpvModel.assemble`."""
        n, g = self.constraint.shape
        mass = self.vehicle.mass
        v, slipping = float(terms['speed'][0]), terms['slip']
        over_v, over_speed = self._wheel_state_slopes(v, slipping)
        # Effect of shear and moment of each wheel on the states: v, then wheels.
        force, torque = np.empty((g + 1, 1)), np.zeros((g + 1, n))
        force[0] = 1 / mass
        force[1:, 0] = over_v / mass
        torque[1:] = over_speed[:, None] * self._per_torque
        turned = self._wheel_speed_per_state(v, slipping)
        per_speed = (slip_slopes(v, slipping)[1] * self._radius)[:, None]
        shear = terms['slip_stiffness'][:, None] * per_speed * turned
        moment = terms['moment_stiffness'][:, None] * per_speed * turned
        A = np.zeros((g + 1, g + 1))
        A[:, 1:] = force * shear.sum(axis=0) - torque @ moment
        # omega = (omega/v)*v: friction is linear in v at a given slip.
        own = list(self.independent)
        per_v = rim_ratio(slipping[own]) / self._radius[own]
        friction = self._per_torque @ (self._friction[:, None] * self.constraint)
        A[1:, 0] = -over_speed * (friction @ per_v)
        by_sinkage = self._resistance_input(force, torque, terms['resistance_gradient'])
        # Inputs wheel by wheel, then D_x.
        by_wheel = np.stack([np.tile(force, n), -torque, by_sinkage], axis=2).reshape(g + 1, -1)
        B_uc = np.hstack([by_wheel, -force])
        return Matrices(A, torque, B_uc, np.eye(g + 1), np.zeros((g + 1, n)))
