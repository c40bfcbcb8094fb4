"""Names nearest to a mistyped one, for errors."""

import difflib
from collections.abc import Iterable

LONGEST_NAME = 60
"""Number of characters compared; names in a hostile file may have millions."""

MAX_LISTED = 40
"""Number of names in a hint."""


def closest_name(name: object, known: Iterable[str]) -> str:
    """Known name nearest to a mistyped one.

    Parameters
    ----------
    name : object
        The unknown name.
    known : iterable of str
        Known names.

    Returns
    -------
    str
        The nearest one; empty if none is near.
    """
    near = difflib.get_close_matches(str(name)[:LONGEST_NAME], list(known), n=1)
    return near[0] if near else ''


def closest(name: object, known: Iterable[str]) -> str:
    """Hint with the known name nearest to a mistyped one.

    Parameters
    ----------
    name : object
        The unknown name.
    known : iterable of str
        Known names.

    Returns
    -------
    str
        ``"; did you mean 'x'?"``, or the list of names if none is near.
    """
    names = sorted(each for each in known if each)
    near = closest_name(name, names)
    if near:
        return f"; did you mean '{near}'?"
    return f'; there are: {", ".join(names[:MAX_LISTED])}'
