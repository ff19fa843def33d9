"""Which functions may be compiled.

``@kernel`` marks a function of floats, tuples and arrays that the time loop needs compiled. It is
returned as it is: an element's module stays plain Python, imports no compiler, and *is* the
uncompiled twin of its own kernel. ``msahl.jit.compiled`` hands the marked functions to numba.
"""

from collections.abc import Callable
from typing import Any, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])

MARKED: list[Callable[..., Any]] = []
APART: list[Callable[..., Any]] = []


def kernel(function: Function) -> Function:
    """Mark ``function`` as compilable; it stays callable as plain Python."""
    MARKED.append(function)
    return function


def apart(function: Function) -> Function:
    """As ``kernel``, but never made part of its callers: compiled once, however many they are.

    For what is called from several places and does much in a call.
    """
    APART.append(function)
    return kernel(function)
