"""Values of named joints, in whatever order a message gives them, in one's own order."""

import math
from collections.abc import Sequence


class JointOrder:
    """Puts the values of a `sensor_msgs/msg/JointState` into the order of its receiver.

    Parameters
    ----------
    names : sequence of str
        The joints, in the receiver's order, each once.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = tuple(names)
        self._seen: list[str] = []
        self._order: tuple[int, ...] = ()

    def values(self, names: Sequence[str], values: Sequence[float], what: str) -> list[float]:
        """Return one finite value per joint.

        Parameters
        ----------
        names : sequence of str
            Joints of the message: every joint of the receiver once; more are passed over.
        values : sequence of float
            Their values, any unit.
        what : str
            What they are, for the error.

        Returns
        -------
        list of float
            The values in the receiver's order and the message's unit.

        Raises
        ------
        ValueError
            Naming the joint that is missing, given twice, or without a finite value.
        """
        if names != self._seen:
            self._order = self._find(names, what)
            self._seen = list(names)
        if len(values) != len(names):
            raise ValueError(f'{what}: {len(values)} values for {len(names)} names')
        ordered = [values[index] for index in self._order]
        for name, value in zip(self._names, ordered, strict=True):
            if not math.isfinite(value):
                raise ValueError(f"{what}: '{name}' is {value}")
        return ordered

    def _find(self, names: Sequence[str], what: str) -> tuple[int, ...]:
        place = {name: index for index, name in enumerate(names)}
        if len(place) != len(names):
            twice = next(name for index, name in enumerate(names) if place[name] != index)
            raise ValueError(f"{what}: '{twice}' is given twice")
        for name in self._names:
            if name not in place:
                raise ValueError(f"{what}: '{name}' is missing from {list(names)}")
        return tuple(place[name] for name in self._names)
