"""Check of arguments that must be above zero."""

import math


def check_positive(**values: float) -> None:
    """Refuse numbers that are not above 0, or not finite.

    Parameters
    ----------
    **values : float
        The numbers by name, each in its unit.

    Raises
    ------
    ValueError
        Naming the first such number.
    """
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ValueError(f'{name} must be above 0, got {value}')
