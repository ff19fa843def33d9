"""Runs a kernel compiled for a large system, and as plain Python for a small one.

What is done once in a run takes plain Python a tenth of a millisecond a body. Compiling takes
seconds, and a compiled kernel takes milliseconds to load: worth it from some hundred bodies on.
Both give the same digits.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import local
from typing import Any

from msahl.jit.compiled import compiled

LARGE = 400
"""Bodies, or other elements, from which a kernel is run compiled."""
PRODUCTS = 300
"""Products of numbers that take plain Python as long as an element: a tenth of a millisecond."""
_of_thread = local()


def by_size(function: Callable[..., Any], size: int, products: int = 0) -> Callable[..., Any]:
    """Return the kernel ``function`` as it is for fewer than ``LARGE`` elements, else compiled.

    ``products`` are those that it computes beside its work for each element, if they are many.
    """
    large = size + products // PRODUCTS >= LARGE or "any_size" in _of_thread.__dict__
    return compiled_once(function) if large else function


@contextmanager
def compiled_at_any_size() -> Iterator[None]:
    """Let this thread run small systems compiled, too.

    No constant changes for this: machine code is kept by the constants of its sources, and code
    compiled with another one is not found by processes that have the usual one.
    """
    _of_thread.__dict__["any_size"] = True
    try:
        yield
    finally:
        del _of_thread.__dict__["any_size"]


def compiled_once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the compiled form of a kernel, always the same one in a thread: its calls share memory
    for their arguments.
    """
    known: dict[Any, Any] = _of_thread.__dict__.setdefault("known", {})
    if function not in known:
        known[function] = compiled(function)
    return known[function]
