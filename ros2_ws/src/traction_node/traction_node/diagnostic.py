"""Levels and content of a node's entry in `/diagnostics`."""

import math
from dataclasses import dataclass, field

# Numbers of diagnostic_msgs/msg/DiagnosticStatus.
OK = 0
WARN = 1
ERROR = 2
STALE = 3


def text(value: object) -> str:
    """Text of a value in a diagnostic.

    Parameters
    ----------
    value : object
        Floats have six significant digits; lists and tuples are written entry by entry.
    """
    if isinstance(value, bool):
        return 'true' if value else 'false'
    if isinstance(value, float):
        return f'{value:.6g}' if math.isfinite(value) else str(value)
    if isinstance(value, list | tuple):
        return ', '.join(text(entry) for entry in value)
    return str(value)


@dataclass
class Diagnostic:
    """Newest diagnostic of a node.

    Attributes
    ----------
    level : int
        `OK`, `WARN`, `ERROR` or `STALE`.
    message : str
        One line for a person.
    values : dict
        Values for the message, by name.
    """

    level: int = OK
    message: str = 'started'
    values: dict[str, object] = field(default_factory=dict)

    def change(self, level: int, message: str, values: dict[str, object]) -> bool:
        """Set a new state.

        Returns
        -------
        bool
            True if level or message changed, so that it must be published at once. A change of
            values alone waits for the next regular report.
        """
        differs = (level, message) != (self.level, self.message)
        self.level, self.message, self.values = level, message, values
        return differs
