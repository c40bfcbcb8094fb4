"""Draft of an implement on the drawbar."""

import math
from dataclasses import dataclass

from traction_model.contact.contact import MIN_TRANSIT_SPEED
from traction_model.kernel import inlined


@dataclass(frozen=True)
class Drawbar:
    """Draft of an implement: a resistance that grows with speed.

    Attributes
    ----------
    pull : float
        Draft at rest, N; negative: the vehicle is towed along its motion.
    pull_per_speed : float
        Growth with speed, N*s/m, at least 0.
    ramp : float
        Time of the rise from zero, s, at least 0.
    """

    pull: float = 0.0
    pull_per_speed: float = 0.0
    ramp: float = 0.0

    def __post_init__(self) -> None:
        if not math.isfinite(self.pull):
            raise ValueError(f'drawbar pull must be finite, got {self.pull}')
        for name in ('pull_per_speed', 'ramp'):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f'drawbar {name} must be finite and at least 0, got {value}')


@inlined
def drawbar_force(t, v, pull, pull_per_speed, ramp):
    """Draft at a time and speed.

    Parameters
    ----------
    t : float
        Time since the start, s.
    v : float
        Speed, m/s.
    pull, pull_per_speed, ramp : float
        As in `Drawbar`, N, N*s/m, s.

    Returns
    -------
    float
        N, backward positive; 0 at standstill, since an implement does not push.
    """
    share = min(1.0, t / ramp) if ramp > 0.0 else 1.0
    direction = max(-1.0, min(1.0, v / MIN_TRANSIT_SPEED))
    return direction * share * (pull + pull_per_speed * abs(v))
