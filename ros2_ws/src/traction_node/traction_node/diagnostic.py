"""Levels and contents of a node's entry in `/diagnostics`."""

import math
from dataclasses import dataclass, field

# Numbered as diagnostic_msgs/msg/DiagnosticStatus numbers them.
OK = 0
WARN = 1
ERROR = 2
STALE = 3


def text(value: object) -> str:
    """Value of a diagnostic as people read it.

    Parameters
    ----------
    value : object
        Floats are given six significant digits, lists and tuples are spelt out.
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
    """What a node last said about its health.

    Attributes
    ----------
    level : int
        `OK`, `WARN`, `ERROR` or `STALE`.
    message : str
        One line for a person.
    values : dict
        Numbers and words behind the message, by name.
    """

    level: int = OK
    message: str = 'started'
    values: dict[str, object] = field(default_factory=dict)

    def change(self, level: int, message: str, values: dict[str, object]) -> bool:
        """Take over a new state.

        Returns
        -------
        bool
            True if level or message differ from before, so that people should hear at once;
            values alone can wait for the next regular report.
        """
        differs = (level, message) != (self.level, self.message)
        self.level, self.message, self.values = level, message, values
        return differs
