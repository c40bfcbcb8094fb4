"""Estimator without error, to separate errors of estimation and control."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from traction_controller.estimation.slip_filter import Source
from traction_model.contact.contact import shear_deficit
from traction_model.simulation.plant import Plant
from traction_model.soil.terrain import soil_row

Array = NDArray[np.float64]


class PerfectEstimator:
    """Perfect estimator of a simulated vehicle.

    Parameters
    ----------
    plant : Plant
        The vehicle.

    Attributes
    ----------
    v : float
        Speed over ground, m/s.
    slip, slip_variance, rim_speed, valid, gross_traction : ndarray, shape (n,)
        As in `VehicleEstimator`; dimensionless, dimensionless, m/s, dimensionless, N.
    source : Source
        Ground: the speed counts as measured.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant = plant
        self.slip_variance = np.zeros(plant.n_wheels)
        self.source = Source.GROUND
        self._copy_state()

    def _copy_state(self) -> None:
        plant = self._plant
        self.v = plant.v
        self.slip = np.array(plant.slip)
        self.rim_speed = plant.rim_speed
        self.valid = np.array(plant.slip_valid)
        self.gross_traction = plant.gross_traction

    def wheel_states(self, t: float, omega: ArrayLike, torque: ArrayLike) -> bool:
        """Copy the state of the plant; the readings are not used.

        Parameters
        ----------
        t : float
            Time, s.
        omega, torque : array_like, shape (n,)
            Readings, rad/s and N·m; not used.

        Returns
        -------
        bool
            True.
        """
        self._copy_state()
        return True

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Ignore a radar reading.

        Parameters
        ----------
        t, v, variance : float
            Stamp, s, reading, m/s, and its variance, m²/s²; not used.

        Returns
        -------
        bool
            True.
        """
        return True

    def commanded_torque(self, torque: Sequence[float]) -> None:
        """Ignore commanded torques.

        Parameters
        ----------
        torque : sequence of float, shape (n,)
            Torque of every wheel, N·m; not used.
        """

    @property
    def slip_stiffness(self) -> Array:
        """Slope of gross traction over slip by sinkage and tau_max of the plant, N, shape (n,)."""
        plant, terrain, vehicle = self._plant, self._plant.terrain, self._plant.vehicle
        slopes = []
        for j, (wheel, track) in enumerate(zip(vehicle.wheels, vehicle.tracks, strict=True)):
            row = soil_row(plant.x + float(vehicle.wheel_positions[j]), terrain.starts)
            depth = min(max(float(plant.sinkage[j]), 1e-3), wheel.radius)
            length = wheel.contact_length(depth)
            path = length / terrain.soil(row, track).shear_deformation_modulus
            # d(1 - kappa)/dy at y = |i|*l/K: (kappa - exp(-y))/y, 1/2 at y = 0.
            y = max(abs(float(self.slip[j])) * path, 1e-6)
            slope = (shear_deficit(y) - math.exp(-y)) / y if y > 1e-4 else 0.5
            slopes.append(wheel.width * length * path * slope)
        return np.asarray(np.array(plant.max_shear_stress) * np.array(slopes))
