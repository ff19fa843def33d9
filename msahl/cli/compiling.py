"""What surrounds a computation: its faults, and lines on the progress of compiling kernels."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from msahl.cli.console import BAD_INPUT, NOT_CONVERGED, stop
from msahl.printable import printable, shown_path


@contextmanager
def computing(deck: Path, quiet: bool = False) -> Iterator[None]:
    """Announce compiling, unless ``quiet``, while something is computed of a ``deck``; what its
    model does not allow ends the program.
    """
    from msahl.jit.announced import announced

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
