"""What all commands share: exit statuses, and messages to stderr."""

import os
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from msahl.printable import printable, shown_path
from msahl.terminal import echo, say

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


def stop(message: str, status: int = BAD_INPUT) -> NoReturn:
    """Write to stderr, and end the program with this exit ``status``."""
    say(message)
    sys.exit(status)


def print_report(lines: Callable[[], Iterable[str]], warnings: Iterable[str], quiet: bool) -> None:
    """Write ``warnings`` to stderr and, unless ``quiet``, the ``lines`` of a report to stdout."""
    for warning in warnings:
        say(f"WARN: {printable(warning)}")
    if not quiet:
        echo("\n".join(map(printable, lines())))


@contextmanager
def writing(path: Path, remedy: str = "", status: int = NOT_WRITTEN) -> Iterator[None]:
    """Report files of the results at ``path`` that cannot be written, with a ``remedy``, and end
    the program with this exit ``status``; likewise a folder that must not be written into.
    """
    try:
        yield
    except OSError as error:
        fault = f"{shown_path(error.filename or path)}: {error.strerror or error}"
        stop(f"{fault}; {remedy}" if remedy else fault, status)
    except _refusals() as error:
        stop(printable(str(error)))


def _refusals() -> tuple[type[Exception], ...]:
    """Return the exceptions of a folder that holds something else; imported when one was raised."""
    from msahl.results.folder import FolderError
    from msahl.results.lock import FolderInUseError

    return FolderError, FolderInUseError


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
