"""Shows the progress of compiling: one line on a terminal that is written again and again."""

import sys
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from msahl.jit.progress import Listener, Progress


def show_compiling(shown: bool) -> "Listener":
    """Return a function that shows the progress on a terminal, and does nothing elsewhere."""
    return _show if shown and sys.stderr.isatty() else lambda progress: None


def _show(progress: "Progress") -> None:
    left = "" if progress.seconds_left < 1.0 else f", about {progress.seconds_left:.0f} s left"
    part = progress.names[0].split(".")[-1].strip("_") if progress.names else ""
    line = f"  {progress.done} of {progress.known} parts{left}  {part}"
    end = "\r" if progress.names else "\n"
    sys.stderr.write(f"\r{line[:78]:<78}{end}")
    sys.stderr.flush()
