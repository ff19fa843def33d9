"""Prints the messages of all commands, with escapes for characters that a terminal obeys."""

import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from errno import EPIPE
from pathlib import Path
from typing import Any, NoReturn, TextIO

import click

from msahl.printable import printable, shown_path

BAD_INPUT, NOT_WRITTEN = 2, 4
"""Exit status for input with faults, and for results that cannot be written or printed."""


class NotPrintedError(Exception):
    """Standard output cannot be written; no ``OSError``, which would be taken for one of a file."""


def echo(message: str, err: bool = False, nl: bool = True) -> None:
    """Print lines, with escapes in place of characters that are not printable."""
    try:
        click.echo("\n".join(map(printable, message.split("\n"))), err=err, nl=nl)
    except OSError as error:
        if err:
            raise
        raise NotPrintedError from error


def say(message: str) -> None:
    """Write to stderr, if it is still read: the results of a run do not depend on that."""
    try:
        echo(message, err=True)
    except OSError:
        _mute(sys.stderr)


def _mute(stream: TextIO) -> None:
    """Write no more to a stream: what is left in its buffer would fail again when Python ends, and
    change the exit status."""
    with suppress(OSError, ValueError), Path(os.devnull).open("wb") as nowhere:
        os.dup2(nowhere.fileno(), stream.fileno())


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


@contextmanager
def writing(path: Path, remedy: str = "") -> Iterator[None]:
    """Report files of the results at ``path`` that cannot be written, with a ``remedy``, and end
    the program with the exit status of that.
    """
    try:
        yield
    except OSError as error:
        fault = f"{shown_path(error.filename or path)}: {error.strerror or error}"
        say(f"{fault}; {remedy}" if remedy else fault)
        sys.exit(NOT_WRITTEN)


def _show_warning(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Print a warning of Python without the line of the source. Those of arithmetic say nothing to
    a user: results are checked for numbers that are not finite."""
    if not issubclass(category, RuntimeWarning):
        say(f"WARN: {printable(str(message))}")


class Program(click.Group):
    """A program of several commands, of which each reports its own faults."""

    def main(self, *args: Any, **settings: Any) -> Any:
        """Enter the program; what cannot be read or printed is reported in one line."""
        open_standard_streams()
        shown, warnings.showwarning = warnings.showwarning, _show_warning
        try:
            return super().main(*args, **settings)
        except NotPrintedError as error:
            self._report(error.__cause__)
        except OSError as error:  # of what click prints, or of a file that cannot be read
            self._report(error)
        finally:
            warnings.showwarning = shown

    def _report(self, error: Any) -> NoReturn:
        """End the program because of a file, or of standard output if ``error`` names none."""
        printed = error.filename is None
        if printed:
            _mute(sys.stdout)
        if printed and error.errno == EPIPE:  # the reader has seen enough, as that of "| head"
            sys.exit(1)
        place = "standard output" if printed else shown_path(error.filename)
        say(f"{self.name}: {place}: {error.strerror or error}")
        sys.exit(NOT_WRITTEN if printed else BAD_INPUT)


def open_standard_streams() -> None:
    """Open what is closed of stdin, stdout and stderr: otherwise a table would get its descriptor,
    and messages would be written into the table.
    """
    while True:
        descriptor = os.open(os.devnull, os.O_RDWR)
        if descriptor > 2:
            break
    os.close(descriptor)
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w"))  # noqa: SIM115
