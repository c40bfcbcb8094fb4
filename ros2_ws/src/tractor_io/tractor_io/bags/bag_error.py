"""Error of reading, writing, repairing and cutting bags."""


class BagError(ValueError):
    """A bag cannot be read or written; the text names file, place and reason."""
