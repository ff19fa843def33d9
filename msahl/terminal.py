"""Prints the messages of all commands, with escapes for characters that a terminal obeys."""

import os
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import click

from msahl.printable import printable


def echo(message: str, err: bool = False, nl: bool = True) -> None:
    """Print lines, with escapes in place of characters that are not printable."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=err, nl=nl)


def say(message: str) -> None:
    """Write to stderr, if it is still read: the results of a run do not depend on that."""
    try:
        echo(message, err=True)
    except OSError:
        # What is left in the buffer would fail again when Python ends, and change the exit status.
        with suppress(OSError), Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), sys.stderr.fileno())


FIRST, LONGEST = 20.0, 600.0
"""Seconds of a long computation until its first line and, in the end, between two lines."""


class SparseLines:
    """Lines on the progress of a long computation where no bar can be shown, in a file or a pipe:
    the first after ``FIRST`` seconds, then at times that grow, so that hours have few lines."""

    def __init__(
        self, tell: Callable[[str], object] = say, clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.tell, self.clock, self.began = tell, clock, clock()
        self.due = FIRST
        self.told = False

    def show(self, part: float, words: str) -> None:
        """Print, if a line is due, how far the computation is: the ``part`` done, in ``words``."""
        passed = self.clock() - self.began
        if passed < self.due:
            return
        self.due = passed + min(passed, LONGEST)
        self.told = True
        left = f", about {passed * (1.0 - part) / part:.0f} s left" if 0.0 < part <= 1.0 else ""
        self.tell(f"  {words}{left}")
