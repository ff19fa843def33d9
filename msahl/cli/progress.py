"""How far a command is: a bar on a terminal, a few lines in a file or a pipe."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import click

from msahl.terminal import SparseLines

PARTS = 1000
"""Parts of the length of a bar."""


@contextmanager
def progress(
    shown: bool, line: str, bar: str | None = None
) -> Iterator[Callable[[float, str], Any]]:
    """A function that shows the part of the work that is done, in words too, if it is ``shown``.
    Lines begin with ``line``, the bar with ``bar`` (default: the same).
    """
    if not shown:
        yield lambda part, words: None
        return
    if not sys.stderr.isatty():
        lines = SparseLines()
        yield lambda part, words: lines.show(part, f"{line}: {words}")
        return
    made: Any = click.progressbar(
        length=PARTS, label=bar or line, file=sys.stderr, item_show_func=lambda words: words or ""
    )
    with made:
        yield lambda part, words: made.update(int(PARTS * part) - made.pos, words)


@contextmanager
def progress_in_time(
    shown: bool, end: float, line: str, bar: str | None = None
) -> Iterator[Callable[[float], Any]]:
    """A function that shows the time [s] that a motion has reached, which ends at ``end``."""
    with progress(shown, line, bar) as show:
        yield lambda t: show(t / end, f"t = {t:.4g} of {end:g} s")
