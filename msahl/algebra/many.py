"""Numbers of many models in the place of one number: a deck is read once for all of them.

    Many((a, b, ...)) + c  ->  Many((a + c, b + c, ...))

Each member is computed as it would be alone, to the last digit. What is decided by a number must be
decided alike for all members, else ``Unlike`` is raised. Functions that take no more than one
number raise TypeError; those that readers use are here for many (``hypot`` and others).
"""

import math
import operator
from collections.abc import Callable, Iterable, Iterator
from dataclasses import fields, is_dataclass, replace
from functools import wraps
from typing import Any, NoReturn

Member = Callable[[int], Any]
"""A function that returns the value of a member by its number."""


class Unlike(Exception):  # noqa: N818 - no error: these models are read one by one
    """Raised where many models cannot be read at once."""


class Many:
    """The ``values`` of a number in many models."""

    __slots__ = ("values",)

    def __init__(self, values: Iterable[Any]) -> None:
        self.values = tuple(values)

    def __repr__(self) -> str:
        raise TypeError("no text stands for many numbers")

    def __array__(self, *_: Any, **__: Any) -> NoReturn:
        # Products of matrices of objects are summed in another order than those of numbers.
        raise TypeError("many numbers are no entry of an array")

    def __bool__(self) -> bool:
        return _agreed(map(bool, self.values))

    def __abs__(self) -> "Many":
        return Many(map(abs, self.values))

    def __neg__(self) -> "Many":
        return Many(map(operator.neg, self.values))


def _agreed(outcomes: Iterable[bool]) -> bool:
    """Return the outcome that is the same for all members."""
    found = set(outcomes)
    if len(found) != 1:
        raise Unlike
    return found.pop()


def each(function: Callable[..., Any], *given: Any) -> Many:
    """Return the ``function`` of each member's arguments, of which some are ``Many``."""
    size = next(len(one.values) for one in given if isinstance(one, Many))
    rows = [one.values if isinstance(one, Many) else (one,) * size for one in given]
    return Many(map(function, *rows))


def apart(function: Callable[..., Any], *given: Any) -> Any:
    """Return the ``function`` of arguments, which may have ``Many`` in nested tuples: then it is
    computed for each member apart.
    """
    found = next(_many_in(given), None)
    member = None if found is None else member_of(given)
    if found is None or member is None:
        return function(*given)
    return Many(function(*member(k)) for k in range(len(found.values)))


def _many_in(value: Any) -> Iterator[Many]:
    """Yield the ``Many`` in nested tuples."""
    if isinstance(value, Many):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from _many_in(part)


def for_many(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a ``function`` of numbers, which takes no others, for many numbers as well."""

    @wraps(function)
    def called(*given: Any) -> Any:
        try:
            return function(*given)
        except TypeError:
            if any(isinstance(one, Many) for one in given):
                return each(function, *given)
            raise

    return called


def _add_operators() -> None:
    """Give ``Many`` the operators of a number."""
    for name in ("add", "sub", "mul", "truediv"):
        function = getattr(operator, name)

        def forward(self: Many, other: Any, apply: Any = function) -> Any:
            return each(apply, self, other)

        def backward(self: Many, other: Any, apply: Any = function) -> Any:
            return each(apply, other, self)

        setattr(Many, f"__{name}__", forward)
        setattr(Many, f"__r{name}__", backward)
    for name in ("lt", "le", "gt", "ge", "eq", "ne"):
        function = getattr(operator, name)

        def compared(self: Many, other: Any, apply: Any = function) -> bool:
            return _agreed(each(apply, self, other).values)

        setattr(Many, f"__{name}__", compared)
    Many.__hash__ = object.__hash__  # type: ignore[method-assign, assignment]


_add_operators()

hypot = for_many(math.hypot)
tan = for_many(math.tan)
remainder = for_many(math.remainder)
atan2 = for_many(math.atan2)
degrees = for_many(math.degrees)
copysign = for_many(math.copysign)
isfinite = for_many(math.isfinite)
isnan = for_many(math.isnan)


@for_many
def nearest(x: float) -> float:
    """Return the whole number next to ``x``."""
    return float(round(x))


def dist(a: Any, b: Any) -> Any:
    """Return the distance of two points."""
    return _dist(*a, *b)


@for_many
def _dist(*places: float) -> float:
    half = len(places) // 2
    return math.dist(places[:half], places[half:])


def largest(*values: Any) -> Any:
    """Return the largest of several numbers."""
    return each(max, *values) if any(isinstance(one, Many) for one in values) else max(values)


def member_of(value: Any) -> Member | None:
    """Return the function that gives a member's value of nested records, tuples and dictionaries
    with ``Many``; None if all members have this ``value``. Raises ``Unlike`` for what may have
    ``Many`` within it unseen.
    """
    import numpy as np  # which reading one model need not import

    if isinstance(value, Many):
        return value.values.__getitem__
    if isinstance(value, tuple):
        return _of_tuple(value)
    if isinstance(value, dict):
        keys, of_values = tuple(value), member_of(tuple(value.values()))
        return of_values and (lambda k: dict(zip(keys, of_values(k), strict=True)))
    if is_dataclass(value) and not isinstance(value, type):
        return _of_record(value)
    if isinstance(value, np.ndarray) and value.dtype != object:
        return None
    if value is None or isinstance(value, str | bytes | int | float | type) or callable(value):
        return None
    raise Unlike


def _of_tuple(value: tuple[Any, ...]) -> Member | None:
    parts = list(map(member_of, value))
    if not any(parts):
        return None
    make = getattr(value, "_make", tuple)
    pairs = list(zip(value, parts, strict=True))
    return lambda k: make([part(k) if part else same for same, part in pairs])


def _of_record(value: Any) -> Member | None:
    parts = {one.name: member_of(getattr(value, one.name)) for one in fields(value)}
    changing = {name: part for name, part in parts.items() if part}
    if not changing:
        return None
    return lambda k: replace(value, **{name: part(k) for name, part in changing.items()})
