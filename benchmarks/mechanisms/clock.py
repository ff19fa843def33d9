"""Measure loops in seconds of the processor, so that other processes on the machine count little.

Every loop is one thread, so on an idle machine these are the seconds of a clock on the wall.
"""

import time
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def processor_time() -> Iterator[None]:
    """Let all that reads ``time.perf_counter`` read the processor's time of this process."""
    wall = time.perf_counter
    time.perf_counter = time.process_time
    try:
        yield
    finally:
        time.perf_counter = wall
