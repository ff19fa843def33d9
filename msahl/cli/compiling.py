"""What surrounds a computation: its faults, and one line on the progress of compiling kernels."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from msahl.cli.console import BAD_INPUT, NOT_CONVERGED, say, stop
from msahl.printable import printable, shown_path

if TYPE_CHECKING:
    from msahl.jit.progress import Progress


@contextmanager
def computing(deck: Path, quiet: bool = False) -> Iterator[None]:
    """Announce compiling, unless ``quiet``, while something is computed of a ``deck``; what its
    model does not allow ends the program.
    """
    try:
        with announced(not quiet):
            yield
    except _faults() as error:
        from msahl.analysis.equilibria.at import NoEquilibriumError
        from msahl.run.options import OptionError

        status = NOT_CONVERGED if isinstance(error, NoEquilibriumError) else BAD_INPUT
        faults = error.faults if isinstance(error, OptionError) else (str(error),)
        stop("\n".join(f"{shown_path(deck)}: {printable(fault)}" for fault in faults), status)


def _faults() -> tuple[type[Exception], ...]:
    """Return the exceptions of a deck and of what is asked for; imported when one was raised."""
    from msahl.analysis.inverse.drives import InverseError
    from msahl.deck import DeckError
    from msahl.jit.progress import CompileError
    from msahl.results.info import ResultError
    from msahl.run.options import OptionError
    from msahl.start.velocities import StartError

    return CompileError, DeckError, InverseError, OptionError, ResultError, StartError


@contextmanager
def announced(shown: bool) -> Iterator[None]:
    """Announce compiling within the context, if that is ``shown``; the progress on a terminal."""
    from msahl.jit.compiled import STOPWATCH

    begin, listen = STOPWATCH.tell, STOPWATCH.listen
    said: list[bool] = []

    def tell() -> None:
        if not said:
            said.append(True)
            say("compiling kernels for this kind of model (once)")

    if shown:
        STOPWATCH.tell = tell
        STOPWATCH.listen = show_progress if sys.stderr.isatty() else listen
    try:
        yield
    finally:
        STOPWATCH.tell, STOPWATCH.listen = begin, listen


def show_progress(progress: "Progress") -> None:
    """Write the progress over the last line of the terminal."""
    left = "" if progress.seconds_left < 1.0 else f", about {progress.seconds_left:.0f} s left"
    part = progress.names[0].split(".")[-1].strip("_") if progress.names else ""
    line = f"  {progress.done} of {progress.known} parts{left}  {part}"
    end = "\r" if progress.names else "\n"
    sys.stderr.write(f"\r{line[:78]:<78}{end}")
    sys.stderr.flush()
