"""Text of unknown origin for a reader: nothing in it is obeyed by a terminal."""

import os


def printable(given: str) -> str:
    """``given`` with escapes in place of what does not print, line ends included."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in given)


def shown_path(path: str | os.PathLike[str]) -> str:
    """A path for a message: one line, whatever the file is called."""
    return printable(os.fspath(path))
