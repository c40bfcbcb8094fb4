"""Loop of estimator, slip control and gate: the cores of the nodes, without messages.

`TractionLoop` calls them in the order of the messages: estimate from a reading of the wheels,
torques from the estimate, limits by the gate. It constructs them from the parameters of the nodes,
so the closed loop and the nodes run the same classes.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from types import SimpleNamespace
from typing import Any, Protocol

from numpy.typing import ArrayLike, NDArray

from torque_gate.gate import TorqueGate
from traction_controller.control.laws.law import SlipLaw
from traction_controller.control.laws.registry import LAWS
from traction_controller.control.slip_controller import SlipController
from traction_controller.control.slip_state import SlipState
from traction_controller.estimation.slip_filter import Source
from traction_controller.estimation.vehicle_estimator import VehicleEstimator


class Estimator(Protocol):
    """Interface of an estimator for the loop, SI units; see `VehicleEstimator`."""

    @property
    def slip(self) -> NDArray[Any]:
        """Slip of every wheel, -1 to 1, shape (n,)."""

    @property
    def slip_variance(self) -> NDArray[Any]:
        """Variance of `slip`, dimensionless, shape (n,)."""

    @property
    def valid(self) -> NDArray[Any]:
        """True if a slip can be used, shape (n,)."""

    @property
    def rim_speed(self) -> NDArray[Any]:
        """r*omega of every wheel, m/s, shape (n,)."""

    @property
    def v(self) -> float:
        """Speed over ground, m/s, forward positive."""

    @property
    def source(self) -> Source:
        """Present source of `v`."""

    @property
    def gross_traction(self) -> NDArray[Any]:
        """Moment of the soil over the rolling radius, N, shape (n,)."""

    @property
    def slip_stiffness(self) -> NDArray[Any]:
        """Slope of gross traction over slip, N, shape (n,)."""

    def wheel_states(self, t: float, omega: ArrayLike, torque: ArrayLike) -> bool:
        """Update with a reading of the wheels; False if it is rejected."""

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Update with a radar reading; False if it is rejected."""

    def commanded_torque(self, torque: Sequence[float]) -> None:
        """Set the torques after the gate."""


def slip_state(estimator: Estimator) -> SlipState:
    """Slip state from an estimate, as in the message SlipEstimate.

    Parameters
    ----------
    estimator : Estimator
        Estimator, after a reading of the wheels.

    Returns
    -------
    SlipState
        Input of slip control, SI units.
    """
    measured = estimator.source is not Source.WHEEL
    deviation = None
    if not measured:
        deviation = [math.sqrt(max(each, 0.0)) for each in estimator.slip_variance.tolist()]
    return SlipState(
        slip=estimator.slip.tolist(),
        valid=estimator.valid.tolist(),
        rim_speed=estimator.rim_speed.tolist(),
        speed=estimator.v,
        slip_stiffness=estimator.slip_stiffness.tolist(),
        gross_traction=estimator.gross_traction.tolist(),
        speed_measured=measured,
        slip_deviation=deviation,
    )


class TractionLoop:
    """Estimator, slip control and gate of one vehicle.

    Parameters
    ----------
    estimator : Estimator
        Slip from readings: `VehicleEstimator`, or another source of slip for comparison.
    controller : SlipController
        Torques from slip.
    gate : TorqueGate
        Last check of the torques.

    Attributes
    ----------
    estimator, controller, gate
        As given.
    """

    def __init__(self, estimator: Estimator, controller: SlipController, gate: TorqueGate) -> None:
        self.estimator = estimator
        self.controller = controller
        self.gate = gate
        self._names = controller.control.vehicle.wheel_names

    @classmethod
    def from_parameters(
        cls,
        parameters: Mapping[str, Mapping[str, Any]],
        laws: Mapping[str, Callable[..., SlipLaw]] = LAWS,
    ) -> 'TractionLoop':
        """Construct the loop from the parameters of its nodes.

        Parameters
        ----------
        parameters : mapping of str to mapping
            As from `traction_evaluation.loop.shipped.shipped_parameters`.
        laws : mapping of str to class
            Control laws by name; the evaluation adds its baselines.

        Returns
        -------
        TractionLoop
            Loop in its initial state.

        Raises
        ------
        ValueError
            If a parameter is invalid or contradicts others.
        """
        p = {node: SimpleNamespace(**values) for node, values in parameters.items()}
        return cls(
            VehicleEstimator.from_parameters(p['slip_estimator']),
            SlipController.from_parameters(p['slip_controller'], laws),
            TorqueGate.from_parameters(p['torque_gate']),
        )

    def torque_request(self, steady_time: float, torque: Sequence[float]) -> None:
        """Set the torque request of the driver.

        Parameters
        ----------
        steady_time : float
            Time of arrival, s, of a clock that is never set.
        torque : sequence of float
            Requested torque of every wheel, N·m, forward positive.
        """
        self.controller.torque_request(steady_time, torque)

    def slip_target(self, target: float) -> None:
        """Set the slip target, as by the topic `slip_target`.

        Parameters
        ----------
        target : float
            0.01 to 0.9.

        Raises
        ------
        ValueError
            If it is out of range.
        """
        self.controller.slip_target(target)

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Update with a radar reading.

        Parameters
        ----------
        t : float
            Stamp, s.
        v : float
            Speed over ground, m/s, forward positive.
        variance : float
            Variance, m²/s²; 0 if unknown.

        Returns
        -------
        bool
            False if it is rejected.
        """
        return self.estimator.radar(t, v, variance)

    def wheel_states(
        self, t: float, steady_time: float, omega: Sequence[float], torque: Sequence[float]
    ) -> list[float]:
        """Update with a reading of the wheels; returns the torques.

        Parameters
        ----------
        t : float
            Stamp, s.
        steady_time : float
            Time of arrival, s, of a clock that is never set.
        omega : sequence of float
            Wheel speeds, rad/s, forward positive.
        torque : sequence of float
            Shaft torques, N·m, forward positive.

        Returns
        -------
        list of float
            Torque of every wheel after the gate, N·m, forward positive; a new list.
        """
        estimated = self.estimator.wheel_states(t, omega, torque)
        self.controller.wheel_states(t, torque)
        self.gate.measured(steady_time, t, self._names, torque)
        if estimated:
            outcomes = self.controller.slip_estimate(t, steady_time, slip_state(self.estimator))
            command = [outcome.torque for outcome in outcomes]
            self.gate.command(steady_time, t, self._names, command)
        else:
            self.gate.step(steady_time)
        output = list(self.gate.output)
        self.estimator.commanded_torque(output)
        return output
