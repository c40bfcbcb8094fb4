"""Quality of service of the suite's topics, by the names in `topics.yaml`; without middleware."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Qos:
    """Quality of service of a publisher or subscriber.

    Attributes
    ----------
    reliable : bool
        Reliable, else best effort.
    latched : bool
        Transient local (late subscribers receive the last messages), else volatile.
    depth : int
        Number of messages kept.
    """

    reliable: bool = True
    latched: bool = False
    depth: int = 10


QOS = {
    'sensor_data': Qos(reliable=False, depth=5),
    'command': Qos(depth=1),
    'latched': Qos(latched=True, depth=1),
    'reliable': Qos(depth=10),
}
"""Quality of service by its name in `topics.yaml`."""
