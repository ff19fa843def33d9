"""The progress of compiling, and its failure."""

from collections.abc import Callable
from typing import Any

from msahl.records import record


class CompileError(RuntimeError):
    """Kernels that cannot be compiled."""


@record(slots=False)
class Progress:
    """How far compiling is: parts done and known, the names of those in work, time left [s]."""

    done: int
    known: int
    names: tuple[str, ...]
    seconds_left: float


Listener = Callable[[Progress], Any]
