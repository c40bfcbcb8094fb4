"""Laws of the evaluation by name: laws of the node, and baselines."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

from traction_controller.control.laws.law import SlipLaw
from traction_controller.control.laws.registry import LAWS
from traction_evaluation.baselines.scheduled_pi import ScheduledPiLaw
from traction_evaluation.baselines.sliding_mode import SlidingModeLaw

BASELINES: Mapping[str, Callable[..., SlipLaw]] = MappingProxyType(
    {'scheduled_pi': ScheduledPiLaw, 'sliding_mode': SlidingModeLaw}
)
"""Classes of the baselines, by name."""

ALL_LAWS: Mapping[str, Callable[..., SlipLaw]] = MappingProxyType({**LAWS, **BASELINES})
"""Classes of all laws by name, for the argument `laws` of slip control."""
