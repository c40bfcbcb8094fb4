"""Names nearest to a mistyped one, for errors."""

import difflib
from collections.abc import Iterable

LONGEST_NAME = 60
"""Characters of a name that are looked at: those of a hostile file may have millions."""

MAX_LISTED = 40
"""Number of names in a hint."""


def closest_name(name: object, known: Iterable[str]) -> str:
    """Known name nearest to a mistyped one.

    Parameters
    ----------
    name : object
        The unknown name.
    known : iterable of str
        The names there are.

    Returns
    -------
    str
        The nearest one; empty when none is near.
    """
    near = difflib.get_close_matches(str(name)[:LONGEST_NAME], list(known), n=1)
    return near[0] if near else ''


def closest(name: object, known: Iterable[str]) -> str:
    """Hint that names the known name nearest to a mistyped one.

    Parameters
    ----------
    name : object
        The unknown name.
    known : iterable of str
        The names there are.

    Returns
    -------
    str
        ``"; did you mean 'x'?"``, or the list of names when none is near.
    """
    names = sorted(each for each in known if each)
    near = closest_name(name, names)
    if near:
        return f"; did you mean '{near}'?"
    return f'; there are: {", ".join(names[:MAX_LISTED])}'
