"""Marks the functions that may be compiled.

``@kernel`` marks a function of floats, tuples and arrays that the time loop needs compiled, and
returns it unchanged. So an element's module stays plain Python, imports no compiler, and is its own
uncompiled reference. ``msahl.jit.compiled`` registers the marked functions with numba.
"""

from collections.abc import Callable, Sequence
from typing import Any, Concatenate, ParamSpec, TypeVar

Function = TypeVar("Function", bound=Callable[..., Any])
Group = TypeVar("Group")
Rest = ParamSpec("Rest")
Result = TypeVar("Result")

MARKED: list[Callable[..., Any]] = []
APART: list[Callable[..., Any]] = []
UNITS: set[Callable[..., Any]] = set()


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


def unit(function: Function) -> Function:
    """Mark a kernel that is compiled on its own, into machine code that all its callers share.

    Units are compiled side by side, and a model of another kind needs only those that it changes.
    A call costs some nanoseconds more, so this is for the few large parts of a step. The types of
    the result follow from the annotation: None, float, int, bool or a tuple of these.
    """
    UNITS.add(function)
    return kernel(function)


def optional(
    otherwise: Any = None,
) -> Callable[
    [Callable[Concatenate[Group, Rest], Result]], Callable[Concatenate[Group | None, Rest], Result]
]:
    """Mark a function whose first argument may be None as compilable; return ``otherwise`` then.

    This is the one place where systems without such a group are treated differently. numba
    compiles a version of each function for the types of its arguments; where the first is None it
    compiles nothing of the function itself.
    """

    def mark(
        function: Callable[Concatenate[Group, Rest], Result],
    ) -> Callable[Concatenate[Group | None, Rest], Result]:
        given: Any = kernel(function)
        name = function.__qualname__

        def called(group: Any, *arguments: Any) -> Any:
            if group is None:
                return otherwise
            return given(group, *arguments)

        for attribute in ("__module__", "__name__", "__qualname__", "__doc__", "__annotations__"):
            setattr(called, attribute, getattr(function, attribute))
        marked: Any = kernel(called)
        # Each is found by its qualified name, where kernels are compiled in other processes.
        marked.given, given.__qualname__ = given, f"{name}.given"
        return marked

    return mark


def choice(
    module: str, name: str, functions: Sequence[Callable[..., Result]]
) -> Callable[..., Result]:
    """Return a kernel that takes a number and calls that one of the ``functions``, kernels with
    equal arguments and results, with the remaining arguments.

    ``module`` and ``name`` are where it is found. So code that is the same for many functions is
    written, and compiled, once. Which function is called is decided by comparisons of the number;
    the functions themselves are known when the code is compiled, and inlined if they are small.
    """
    first, *others = functions
    rest: Any = choice(module, f"{name}.rest", others) if others else None

    def only(number: int, *arguments: Any) -> Any:
        return first(*arguments)

    def called(number: int, *arguments: Any) -> Any:
        if number == 0:
            return first(*arguments)
        return rest(number - 1, *arguments)

    marked: Any = only if rest is None else called
    marked.__module__, marked.__qualname__, marked.__name__ = module, name, name.split(".")[-1]
    marked.__annotations__ = {"return": first.__annotations__["return"]}
    marked.rest = rest
    return kernel(marked)
