"""Runs a kernel compiled for a large system, and as plain Python for a small one.

What is done once in a run takes plain Python a tenth of a millisecond a body. Compiling takes
seconds, and a compiled kernel takes milliseconds to load: worth it from some hundred bodies on.
Both give the same digits.
"""

from collections.abc import Callable
from threading import local
from typing import Any

from msahl.jit.compiled import compiled

LARGE = 400
"""Bodies, or other elements, from which a kernel is run compiled."""
_of_thread = local()


def by_size(function: Callable[..., Any], size: int) -> Callable[..., Any]:
    """Return the kernel ``function`` as it is for fewer than ``LARGE`` elements, else compiled."""
    return compiled_once(function) if size >= LARGE else function


def compiled_once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the compiled form of a kernel, always the same one in a thread: its calls share memory
    for their arguments.
    """
    known: dict[Any, Any] = _of_thread.__dict__.setdefault("known", {})
    if function not in known:
        known[function] = compiled(function)
    return known[function]
