"""Wait of a publishing node until its subscribers are matched."""

from collections.abc import Mapping

from traction_node.host import Publisher

SETTLE_TIME = 0.2
"""Time from the match at the publisher to the match at the subscriber, s.

Until then best-effort messages are lost. There is no notice of the second match."""


class SubscriberWait:
    """Wait until every publisher has its subscribers, with a timeout.

    Subscribers without history lose messages published before the match. Call `over` repeatedly,
    for example from a timer, because a node must not block its executor.

    Parameters
    ----------
    publishers : mapping of str to publisher
        Publishers by name of topic.
    timeout : float
        Longest wait for subscribers, s, at least 0; 0: no wait.
    needed : int
        Number of subscribers for each topic.
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
        """True when all subscribers are matched on both sides, or at the timeout.

        Parameters
        ----------
        now : float
            Time of a steady clock, s. The first call starts the wait.
        """
        if self._began is None:
            self._began = now
        if self.missing:
            self._matched = None
            return now - self._began >= self._timeout
        if self._matched is None:
            self._matched = now
        return now - self._matched >= SETTLE_TIME
