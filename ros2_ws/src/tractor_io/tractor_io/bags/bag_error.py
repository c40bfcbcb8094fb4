"""The error of all that reads, writes, repairs or cuts bags."""


class BagError(ValueError):
    """A bag cannot be read or written; the text says which, where and why."""
