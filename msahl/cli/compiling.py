"""Announces that kernels are compiled, and shows the progress: one line that is written again."""

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from msahl.cli.console import say

if TYPE_CHECKING:
    from msahl.jit.progress import Progress


@contextmanager
def announced(shown: bool) -> Iterator[None]:
    """Announce compiling within the context, if that is ``shown``; the progress on a terminal."""
    from msahl.jit.compiled import STOPWATCH

    begin, listen = STOPWATCH.tell, STOPWATCH.listen
    announced_before: list[bool] = []

    def tell() -> None:
        if not announced_before:
            announced_before.append(True)
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
