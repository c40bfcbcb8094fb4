"""Conversion of the values of named joints from the order of a message to that of the receiver."""

import math
from collections.abc import Sequence
from typing import TypeVar

Number = TypeVar('Number', bound=float)


class JointError(ValueError):
    """A message does not have one finite value for every joint.

    Attributes
    ----------
    cause : str
        'names', 'length' or 'not_finite'.
    """

    def __init__(self, cause: str, text: str) -> None:
        super().__init__(text)
        self.cause = cause


class JointOrder:
    """Values of a `sensor_msgs/msg/JointState` in the order of its receiver.

    Parameters
    ----------
    names : sequence of str
        Joints in the receiver's order, each once.
    what : str
        Name of the quantity for errors, such as 'torque'.
    only : bool
        True: messages with other joints are errors. False: other joints are ignored.
    one_for_all : bool
        True: one value without a name is that of every joint.
    """

    def __init__(
        self, names: Sequence[str], what: str, only: bool = False, one_for_all: bool = False
    ) -> None:
        self._names = tuple(names)
        self._what = what
        self._only = only
        self._one_for_all = one_for_all
        # Names of the newest message, and index of each joint in it.
        self._seen: list[str] | None = None
        self._order: tuple[int, ...] = ()

    def values(self, names: Sequence[str], values: Sequence[Number]) -> list[Number]:
        """One finite value per joint.

        Parameters
        ----------
        names : sequence of str
            Joints of the message, every joint of the receiver once.
        values : sequence of float or bool
            Values, in any unit.

        Returns
        -------
        list of float or bool
            Values in the receiver's order and the message's unit.

        Raises
        ------
        JointError
            If a joint is missing, unknown, given twice, or without a finite value.
        """
        if self._one_for_all and len(values) == 1 and not names:
            names, values = self._names, [values[0]] * len(self._names)
        if names != self._seen:
            self._order = self._find(names)
            self._seen = list(names)
        if len(values) != len(names):
            said = f'{self._what}: {len(values)} values for {len(names)} joints'
            raise JointError('length', said)
        ordered = [values[index] for index in self._order]
        for name, value in zip(self._names, ordered, strict=True):
            if not math.isfinite(value):
                raise JointError('not_finite', f"{self._what} of joint '{name}' is {value}")
        return ordered

    def _find(self, names: Sequence[str]) -> tuple[int, ...]:
        """Index of each joint among the names."""
        place = {name: index for index, name in enumerate(names)}
        if len(place) != len(names):
            twice = next(name for index, name in enumerate(names) if place[name] != index)
            raise JointError('names', f"{self._what}: joint '{twice}' is given twice")
        for name in self._names:
            if name not in place:
                raise JointError('names', f"{self._what}: joint '{name}' is missing")
        if self._only and len(names) != len(self._names):
            extra = next(name for name in names if name not in self._names)
            raise JointError('names', f"{self._what}: unknown joint '{extra}'")
        return tuple(place[name] for name in self._names)
