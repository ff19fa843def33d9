"""What all commands share: exit statuses, and messages to stderr."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn

from msahl.printable import shown_path
from msahl.terminal import echo

BAD_VERDICT, BAD_INPUT, NOT_CONVERGED, NOT_WRITTEN, INTERRUPTED = 1, 2, 3, 4, 130
STATUS = {
    "completed": 0,
    "not started": BAD_INPUT,
    "not converged": NOT_CONVERGED,
    "not written": NOT_WRITTEN,
    "interrupted": INTERRUPTED,
}
"""Exit status of a run by how it ended; 143 instead of 130 if it was terminated."""


OTHER_FOLDER = "choose another folder with -o"


def say(message: str) -> None:
    """Write to stderr, if it is still read: the results of a run do not depend on that."""
    try:
        echo(message, err=True)
    except OSError:
        # What is left in the buffer would fail again when Python ends, and change the exit status.
        with suppress(OSError), Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), sys.stderr.fileno())


def stop(message: str, status: int = BAD_INPUT) -> NoReturn:
    """Write to stderr, and end the program with this exit ``status``."""
    say(message)
    sys.exit(status)


@contextmanager
def writing(path: Path, remedy: str = "") -> Iterator[None]:
    """Report files of the results at ``path`` that cannot be written, with a ``remedy``, and end
    the program.
    """
    try:
        yield
    except OSError as error:
        fault = f"{shown_path(error.filename or path)}: {error.strerror or error}"
        stop(f"{fault}; {remedy}" if remedy else fault, NOT_WRITTEN)


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
