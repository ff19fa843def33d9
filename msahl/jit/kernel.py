"""Marks the functions that may be compiled.

``@kernel`` marks a function of floats, tuples and arrays that the time loop needs compiled, and
returns it unchanged. So an element's module stays plain Python, imports no compiler, and is its own
uncompiled reference. ``msahl.jit.compiled`` registers the marked functions with numba.
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
    """Mark a kernel that is never inlined: it is compiled once, however many callers it has.

    This is for functions that are called from several places and do much work in a call.
    """
    APART.append(function)
    return kernel(function)
