"""Requests to stop a command by SIGINT or SIGTERM."""

import signal
import threading
from _thread import interrupt_main
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

GRACE = 0.5
"""Seconds within which a loop of steps answers a signal."""


class Interruption:
    """Whether the user asked to stop. A second request stops at once, as KeyboardInterrupt. So does
    the first if nobody has asked for it after ``GRACE`` seconds, outside a loop of steps.
    """

    def __init__(self) -> None:
        self.signal = 0

    def __call__(self) -> bool:
        """Whether a stop was requested."""
        if self.signal:
            set_alarm(0.0)
        return self.signal != 0

    def note(self, number: int, frame: FrameType | None) -> None:
        """Handle SIGINT and SIGTERM."""
        if self.signal:
            raise KeyboardInterrupt
        self.signal = number
        set_alarm(GRACE)

    def insist(self, number: int, frame: FrameType | None) -> None:
        """Handle the alarm."""
        raise KeyboardInterrupt


def set_alarm(seconds: float) -> None:
    """Let the process receive SIGALRM after so many seconds; 0 for never. Windows has no SIGALRM:
    there it is a second SIGINT.
    """
    global _timer
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, seconds)
        return
    if _timer:
        _timer.cancel()
    _timer = threading.Timer(seconds, interrupt_main) if seconds else None
    if _timer:
        _timer.daemon = True
        _timer.start()


_timer: threading.Timer | None = None


@contextmanager
def stoppable() -> Iterator[Interruption]:
    """Make the first SIGINT or SIGTERM a request that the loop honours between chunks."""
    interruption = Interruption()
    handlers = dict.fromkeys((signal.SIGINT, signal.SIGTERM), interruption.note)
    if hasattr(signal, "setitimer"):
        handlers[signal.SIGALRM] = interruption.insist
    before = {number: signal.signal(number, handle) for number, handle in handlers.items()}
    try:
        yield interruption
    finally:
        set_alarm(0.0)
        for number, handler in before.items():
            signal.signal(number, handler)
