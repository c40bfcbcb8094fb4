"""The loop of estimator, slip control and gate: what the nodes run, without their messages.

`TractionLoop` passes readings on in the order in which the nodes do: the wheels' reading is
estimated, the estimate is answered with torques, and the gate lets them through. It makes its
parts from the nodes' own parameters, so that the closed loop and the nodes run the same objects.
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
    """What the loop reads of an estimator, in SI units; see `VehicleEstimator`."""

    @property
    def slip(self) -> NDArray[Any]:
        """Slip of every wheel, -1 to 1, shape (n,)."""

    @property
    def slip_variance(self) -> NDArray[Any]:
        """Variance of `slip`, dimensionless, shape (n,)."""

    @property
    def valid(self) -> NDArray[Any]:
        """True for every wheel whose slip means anything, shape (n,)."""

    @property
    def rim_speed(self) -> NDArray[Any]:
        """r*omega of every wheel, m/s, shape (n,)."""

    @property
    def v(self) -> float:
        """Speed over ground, m/s, forward positive."""

    @property
    def source(self) -> Source:
        """What `v` rests on."""

    @property
    def gross_traction(self) -> NDArray[Any]:
        """Moment of the soil over the rolling radius, N, shape (n,)."""

    @property
    def slip_stiffness(self) -> NDArray[Any]:
        """Slope of gross traction over slip, N, shape (n,)."""

    def wheel_states(self, t: float, omega: ArrayLike, torque: ArrayLike) -> bool:
        """Take a reading of the wheels; False where it is refused."""

    def radar(self, t: float, v: float, variance: float) -> bool:
        """Take a radar reading; False where it is refused or not believed."""


def slip_state(estimator: Estimator) -> SlipState:
    """What slip control is told of an estimate, as by the message SlipEstimate.

    Parameters
    ----------
    estimator : Estimator
        After a reading of the wheels.

    Returns
    -------
    SlipState
        SI units.
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
        Slip from readings; `VehicleEstimator`, or another source of slip to compare with it.
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
        """Build the loop from the parameters of its nodes.

        Parameters
        ----------
        parameters : mapping of str to mapping
            As of `traction_evaluation.loop.shipped.shipped_parameters`.
        laws : mapping of str to class
            Control laws by name; the evaluation adds its baselines.

        Returns
        -------
        TractionLoop
            With nothing measured yet.

        Raises
        ------
        ValueError
            Naming the parameter that is refused, or does not fit the others.
        """
        p = {node: SimpleNamespace(**values) for node, values in parameters.items()}
        return cls(
            VehicleEstimator.from_parameters(p['slip_estimator']),
            SlipController.from_parameters(p['slip_controller'], laws),
            TorqueGate.from_parameters(p['torque_gate']),
        )

    def torque_request(self, steady_time: float, torque: Sequence[float]) -> None:
        """Take the driver's request.

        Parameters
        ----------
        steady_time : float
            When it came, s, of a clock that is never set.
        torque : sequence of float
            Of every wheel, N·m, forward positive.
        """
        self.controller.torque_request(steady_time, torque)

    def slip_target(self, target: float) -> None:
        """Take a slip target, as by the topic `slip_target`.

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
        """Take a radar reading.

        Parameters
        ----------
        t : float
            Its stamp, s.
        v : float
            Speed over ground, m/s, forward positive.
        variance : float
            m²/s²; 0 where it is not known.

        Returns
        -------
        bool
            False where it is refused or not believed.
        """
        return self.estimator.radar(t, v, variance)

    def wheel_states(
        self, t: float, steady_time: float, omega: Sequence[float], torque: Sequence[float]
    ) -> list[float]:
        """Take a reading of the wheels and answer it with torques.

        Parameters
        ----------
        t : float
            Its stamp, s.
        steady_time : float
            When it came, s, of a clock that is never set.
        omega : sequence of float
            Wheel speeds, rad/s, forward positive.
        torque : sequence of float
            Shaft torques, N·m, forward positive.

        Returns
        -------
        list of float
            Torque of every wheel that leaves the gate, N·m, forward positive; a new list.
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
        return list(self.gate.output)
