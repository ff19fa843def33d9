"""Say that kernels are compiled, and how far that is.

On a terminal that is one line, which is rewritten, elsewhere a few lines.
"""

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager

from msahl.jit.compiled import STOPWATCH
from msahl.jit.progress import Progress
from msahl.terminal import SparseLines, say

NOTABLE = 3.0
"""Seconds of a compilation from which a line says, at its end, how long it took."""


@contextmanager
def announced(shown: bool) -> Iterator[None]:
    """Announce compiling within the context, if that is ``shown``; the progress as well."""
    begin, listen = STOPWATCH.tell, STOPWATCH.listen
    said: list[bool] = []

    def tell() -> None:
        if not said:
            said.append(True)
            say("compiling kernels for this kind of model (once)")

    if shown:
        STOPWATCH.tell = tell
        STOPWATCH.listen = show_progress if sys.stderr.isatty() else ProgressLines()
    try:
        yield
    finally:
        STOPWATCH.tell, STOPWATCH.listen = begin, listen


def show_progress(progress: Progress) -> None:
    """Write the progress over the last line of the terminal."""
    left = "" if progress.seconds_left < 1.0 else f", about {progress.seconds_left:.0f} s left"
    part = progress.names[0].split(".")[-1].strip("_") if progress.names else ""
    line = f"  {progress.done} of {progress.known} parts{left}  {part}"
    end = "\r" if progress.names else "\n"
    sys.stderr.write(f"\r{line[:78]:<78}{end}")
    sys.stderr.flush()


class ProgressLines:
    """Prints a few lines on each compilation: now and then how far it is, at its end how long it
    took."""

    def __init__(self) -> None:
        self.lines: SparseLines | None = None

    def __call__(self, progress: Progress) -> None:
        """Listen to the progress."""
        self.lines = lines = self.lines or SparseLines(clock=time.monotonic)
        if progress.names:
            left = f", about {progress.seconds_left:.0f} s left"
            lines.show(0.0, f"compiled {progress.done} of {progress.known} parts{left}")
            return
        passed = lines.clock() - lines.began
        if progress.done and passed >= NOTABLE:
            say(f"  compiled {progress.done} parts in {passed:.0f} s")
        self.lines = None
