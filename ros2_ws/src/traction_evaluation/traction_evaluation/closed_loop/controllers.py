"""Controllers of the comparison, as changes to the shipped parameters."""

import copy
from dataclasses import dataclass, replace
from functools import cache
from types import SimpleNamespace
from typing import Any

from traction_controller.estimation.vehicle_estimator import VehicleEstimator
from traction_evaluation.baselines.laws import ALL_LAWS, BASELINES
from traction_evaluation.loop.shipped import VEHICLE, shipped_parameters
from traction_evaluation.loop.traction_loop import TractionLoop
from traction_model.vehicle.vehicle import load_vehicle

REASONS = {
    'slip_controller.mode': 'trials hold slip at a target; what ships only limits it',
    'slip_controller.hold_torque': 'as `torque_gate.max_torque`',
    'torque_gate.max_torque': 'twice static load times radius, never the limit: in ruts even the '
    'nominal tractor needs more at a slip of 0.2 than ships, and control is judged here',
    'slip_controller.law': 'the law that is judged',
    'slip_controller.pi_proportional': 'tuned on draws of its own',
    'slip_controller.pi_integral': 'tuned on draws of its own',
    'slip_estimator.tachometer_pulses': 'a maker knows the tachometers: what that is worth',
}
"""Reasons of parameters that differ from the shipped ones; all others must be equal."""


@dataclass(frozen=True)
class Controller:
    """Controller of the comparison.

    Attributes
    ----------
    text : str
        Name in the report.
    changes : tuple of (str, object)
        Changes to the shipped parameters, by ``node.parameter``, SI units.
    perfect : bool
        True to use the true slip in place of an estimate.
    pulses_told : bool
        True to set the pulses per turn of the tachometers in the estimator.
    """

    text: str
    changes: tuple[tuple[str, Any], ...] = ()
    perfect: bool = False
    pulses_told: bool = False

    @property
    def parameters(self) -> dict[str, dict[str, Any]]:
        """All parameters of the loop, by node, SI units.

        Raises
        ------
        ValueError
            If a parameter differs from the shipped one and `REASONS` has no reason.
        """
        chosen: dict[str, dict[str, Any]] = {}
        for name, value in self.changes:
            if name not in REASONS:
                raise ValueError(f'{self.text}: no reason is given why {name} differs')
            node, _, parameter = name.partition('.')
            chosen.setdefault(node, {})[parameter] = value
        # The node's table does not allow the laws of the baselines.
        law = chosen.get('slip_controller', {}).get('law')
        if law in BASELINES:
            del chosen['slip_controller']['law']
        found = shipped_parameters(changes=chosen)
        if law in BASELINES:
            found['slip_controller']['law'] = law
        return found

    def loop(self, pulses_per_turn: float) -> TractionLoop:
        """Estimator, slip control and gate in their initial state.

        Parameters
        ----------
        pulses_per_turn : float
            Pulses of the tachometers; used only with `pulses_told`.

        Returns
        -------
        TractionLoop
            A copy of a cached loop, since the computation of gains takes long.
        """
        loop = copy.deepcopy(_made(self))
        if self.pulses_told:
            told = self.parameters['slip_estimator'] | {'tachometer_pulses': pulses_per_turn}
            loop.estimator = VehicleEstimator.from_parameters(SimpleNamespace(**told))
        return loop


@cache
def _made(controller: Controller) -> TractionLoop:
    return TractionLoop.from_parameters(controller.parameters, ALL_LAWS)


def _ample_torque() -> tuple[float, ...]:
    """Twice static load times radius of every wheel, N·m, rounded."""
    vehicle = load_vehicle(VEHICLE)
    return tuple(
        round(2.0 * float(load) * wheel.radius, -2)
        for load, wheel in zip(vehicle.static_loads(), vehicle.wheels, strict=True)
    )


HOLDING: tuple[tuple[str, Any], ...] = (
    ('slip_controller.mode', 'hold'),
    ('slip_controller.hold_torque', _ample_torque()),
    ('torque_gate.max_torque', _ample_torque()),
)
"""Changes of every controller in trials."""


def fixed_pi(proportional: float, integral: float) -> Controller:
    """PI with fixed gains.

    Parameters
    ----------
    proportional, integral : float
        Gains over static load times radius, dimensionless and 1/s.

    Returns
    -------
    Controller
        Holds slip.
    """
    return Controller(
        'fixed PI',
        (
            *HOLDING,
            ('slip_controller.law', 'pi'),
            ('slip_controller.pi_proportional', proportional),
            ('slip_controller.pi_integral', integral),
        ),
    )


def controllers(pi: Controller) -> list[Controller]:
    """All controllers of the comparison; the last one has the targets.

    Parameters
    ----------
    pi : Controller
        The tuned fixed PI.

    Returns
    -------
    list of Controller
        Controllers in mode hold.
    """
    return [
        pi,
        Controller('scheduled PI', (*HOLDING, ('slip_controller.law', 'scheduled_pi'))),
        Controller('sliding mode', (*HOLDING, ('slip_controller.law', 'sliding_mode'))),
        Controller('LQI', (*HOLDING, ('slip_controller.law', 'lqi'))),
        Controller('LPV', HOLDING),
    ]


def limiting(controller: Controller) -> Controller:
    """Same controller in the shipped mode limit.

    Parameters
    ----------
    controller : Controller
        Controller in mode hold.

    Returns
    -------
    Controller
        Controller in mode limit.
    """
    return replace(
        controller, changes=tuple(each for each in controller.changes if each not in HOLDING)
    )
