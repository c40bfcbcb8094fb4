"""Control laws by name, and construction of a law for a wheel."""

from collections.abc import Callable, Mapping
from inspect import signature
from types import MappingProxyType
from typing import Any

from traction_controller.control.laws.law import SlipLaw
from traction_controller.control.laws.lpv import LpvLaw
from traction_controller.control.laws.lqi import LqiLaw
from traction_controller.control.laws.pi import PiLaw
from traction_model.vehicle.wheel import Wheel
from traction_node.closest import closest
from traction_node.positive import check_positive

LAWS: Mapping[str, Callable[..., SlipLaw]] = MappingProxyType(
    {'pi': PiLaw, 'lqi': LqiLaw, 'lpv': LpvLaw}
)
"""Classes of the laws of the node, by name."""

# Arguments of every law; the others are its settings.
_COMMON = ('wheel', 'load', 'slip', 'lag', 'dt')


def make_law(
    name: str,
    wheel: Wheel,
    load: float,
    *,
    slip: float = 0.2,
    lag: float = 0.1,
    dt: float = 0.01,
    settings: Mapping[str, Any] | None = None,
    laws: Mapping[str, Callable[..., SlipLaw]] = LAWS,
) -> SlipLaw:
    """Law for a wheel, by its name.

    Parameters
    ----------
    name : str
        Name of the law.
    wheel : Wheel
        The wheel.
    load : float
        Its static load, N, above 0.
    slip : float
        Slip at the operating point, at least 0 and below 1.
    lag : float
        Time constant from commanded to shaft torque, s, above 0.
    dt : float
        Nominal sampling period, s, above 0.
    settings : mapping, optional
        Arguments of the law's class by name, in their units.
    laws : mapping of str to class
        Classes of laws by name.

    Returns
    -------
    SlipLaw
        Law in its initial state.

    Raises
    ------
    ValueError
        If the law or a setting is unknown, or a value is out of range.
    """
    if name not in laws:
        raise ValueError(f"unknown control law '{name}'{closest(name, laws)}")
    check_positive(load=load, lag=lag, dt=dt)
    if not 0 <= slip < 1:
        raise ValueError(f'slip must be at least 0 and below 1, got {slip}')
    own = [key for key in signature(laws[name]).parameters if key not in _COMMON]
    for key in settings or {}:
        if key not in own:
            raise ValueError(f"control law '{name}' has no setting '{key}'{closest(key, own)}")
    return laws[name](wheel, load, slip=slip, lag=lag, dt=dt, **(settings or {}))
