"""Faults of elastic models and their files: file, line and a message with the remedy."""

from msahl.printable import printable

LONGEST = 60
"""Characters of a file's text that a message repeats."""


class ReductionError(Exception):
    """A model that cannot be read or reduced; ``line`` 0 means the file as a whole."""

    def __init__(self, file: str, message: str, line: int = 0) -> None:
        super().__init__(file, message, line)
        self.file, self.message, self.line = file, message, line

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.message}" if self.line else self._of_file()

    def _of_file(self) -> str:
        return f"{self.file}: {self.message}"


def shown(text: str) -> str:
    """Return a piece of a file's text for a message: printable, of bounded length."""
    text = text.strip()
    return printable(text if len(text) <= LONGEST else f"{text[:LONGEST]} ...")
