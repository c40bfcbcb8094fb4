"""Wait of a node that publishes until its subscribers are matched."""

from collections.abc import Mapping

from traction_node.host import Publisher

SETTLE_TIME = 0.2
"""Time from the match known here to the one known to the subscriber, s.

Until then best-effort messages are lost. Nothing tells when it is over."""


class SubscriberWait:
    """Wait until every publisher has its subscribers, at the longest for a time.

    Subscribers without history lose what was published before they were matched. Ask `over` again
    and again, say from a timer: a node must not block its executor.

    Parameters
    ----------
    publishers : mapping of str to publisher
        Publishers by the name of their topic.
    timeout : float
        Longest wait for subscribers, s, 0 or more; 0 does not wait for them.
    needed : int
        Subscribers that each topic needs.
    """

    def __init__(
        self, publishers: Mapping[str, Publisher], timeout: float, needed: int = 1
    ) -> None:
        self._publishers = dict(publishers)
        self._timeout = timeout
        self._needed = needed
        self._began: float | None = None
        self._matched: float | None = None

    @property
    def missing(self) -> list[str]:
        """Topics with fewer subscribers than needed, in the order given."""
        return [
            name
            for name, publisher in self._publishers.items()
            if publisher.get_subscription_count() < self._needed
        ]

    def over(self, now: float) -> bool:
        """True once all subscribers are matched and know it, or the time is over.

        Parameters
        ----------
        now : float
            Time of a steady clock, s. The first call begins the wait.
        """
        if self._began is None:
            self._began = now
        if self.missing:
            self._matched = None
            return now - self._began >= self._timeout
        if self._matched is None:
            self._matched = now
        return now - self._matched >= SETTLE_TIME
