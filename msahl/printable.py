"""Makes text of unknown origin printable, so that a terminal obeys nothing in it."""

import os


def printable(given: str) -> str:
    """Return ``given`` with escapes in place of characters that do not print, also of line ends."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in given)


def shown_path(path: str | os.PathLike[str]) -> str:
    """Return a path for a message, always as one line."""
    return printable(os.fspath(path))
