"""Runs a kernel compiled for a large system, and as plain Python for a small one.

What is done once in a run takes plain Python a tenth of a millisecond a body. Compiling takes
seconds, and a compiled kernel takes milliseconds to load: worth it from some hundred bodies on.
Both give the same digits.
"""

from collections import Counter
from collections.abc import Callable
from functools import cache
from typing import Any

from msahl.jit.compiled import compiled

LARGE = 400
MANY = 10_000
"""Elements of all calls of a kernel that take about as long as to compile it."""
_used: Counter[Callable[..., Any]] = Counter()
"""Bodies, or other elements, from which a kernel is run compiled."""


def by_size(function: Callable[..., Any], size: int) -> Callable[..., Any]:
    """Return the kernel ``function`` as it is for fewer than ``LARGE`` elements, else compiled."""
    return compiled_once(function) if size >= LARGE else function


def by_use(function: Callable[..., Any], size: int) -> Callable[..., Any]:
    """Do likewise, and return it compiled as soon as its calls had ``MANY`` elements together: for
    kernels whose code is the same for all models.
    """
    _used[function] += size
    return compiled_once(function) if size >= LARGE or _used[function] > MANY else function


@cache
def compiled_once(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the compiled form of a kernel, always the same one."""
    return compiled(function)
