"""Message stamps to seconds and back."""

from typing import Protocol

NANOSECONDS = 1_000_000_000


class Stamp(Protocol):
    """A `builtin_interfaces/msg/Time`, or any object with its two fields."""

    sec: int
    nanosec: int


def seconds(stamp: Stamp) -> float:
    """Time of a stamp.

    Parameters
    ----------
    stamp : Stamp
        Stamp of a message.

    Returns
    -------
    float
        Time [s]. Near the present date neighbouring floats are 0.24 us apart; take differences
        of stamps with `between` where that matters.
    """
    return stamp.sec + stamp.nanosec / NANOSECONDS


def nanoseconds(stamp: Stamp) -> int:
    """Time of a stamp, exact.

    Parameters
    ----------
    stamp : Stamp
        Stamp of a message.

    Returns
    -------
    int
        Time [ns].
    """
    return stamp.sec * NANOSECONDS + stamp.nanosec


def between(earlier: Stamp, later: Stamp) -> float:
    """Time from one stamp to another, exact to the nanosecond.

    Parameters
    ----------
    earlier, later : Stamp
        Stamps of two messages.

    Returns
    -------
    float
        Duration [s], negative if `later` is the earlier one.
    """
    return (later.sec - earlier.sec) + (later.nanosec - earlier.nanosec) / NANOSECONDS


def to_stamp(stamp: Stamp, time: float) -> None:
    """Set a message's stamp in place.

    Parameters
    ----------
    stamp : Stamp
        Stamp to overwrite.
    time : float
        Time [s], >= 0, rounded to the nearest nanosecond.
    """
    whole = int(time)
    # Rounded separately, since floats near the present date have few digits for the fraction.
    carry, nanosec = divmod(round((time - whole) * NANOSECONDS), NANOSECONDS)
    stamp.sec = whole + carry
    stamp.nanosec = nanosec


def to_stamp_exact(stamp: Stamp, time: int) -> None:
    """Set a message's stamp in place, exact.

    Parameters
    ----------
    stamp : Stamp
        Stamp to overwrite.
    time : int
        Time [ns], >= 0.
    """
    stamp.sec, stamp.nanosec = divmod(time, NANOSECONDS)
