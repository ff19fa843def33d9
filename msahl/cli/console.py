"""What all commands share: exit statuses, and messages to stderr."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn

from msahl import terminal
from msahl.printable import printable
from msahl.terminal import echo

BAD_VERDICT, NOT_CONVERGED, INTERRUPTED = 1, 3, 130
BAD_INPUT, NOT_WRITTEN = terminal.BAD_INPUT, terminal.NOT_WRITTEN
STATUS = {
    "completed": 0,
    "not started": BAD_INPUT,
    "not converged": NOT_CONVERGED,
    "not written": NOT_WRITTEN,
    "interrupted": INTERRUPTED,
}
"""Exit status of a run by how it ended; 143 instead of 130 if it was terminated."""


say = terminal.say
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
def writing(path: Path, remedy: str = "") -> Iterator[None]:
    """Report what cannot be written, as ``terminal.writing`` does; likewise a folder that must not
    be written into, which is a fault of the input.
    """
    try:
        with terminal.writing(path, remedy):
            yield
    except _refusals() as error:
        stop(printable(str(error)))


def _refusals() -> tuple[type[Exception], ...]:
    """Return the exceptions of a folder that holds something else; imported when one was raised."""
    from msahl.results.folder import FolderError
    from msahl.results.lock import FolderInUseError

    return FolderError, FolderInUseError
