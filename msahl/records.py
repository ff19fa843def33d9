"""Records: frozen dataclasses whose methods are not generated at every start of the program.

``dataclasses`` writes and compiles the source of six functions for each frozen class, half a
millisecond of every start. A command imports a hundred such classes and makes objects of a few.
``@record`` is ``@dataclass(frozen=True, slots=True)`` in all that a user of the class sees, but all
records share their methods, and ``dataclasses`` makes a constructor when it is first called.
"""

from collections.abc import Callable
from dataclasses import FrozenInstanceError, dataclass, field, fields, make_dataclass
from functools import cache
from operator import attrgetter
from reprlib import recursive_repr
from typing import Any, NoReturn, TypeAlias, TypeVar, dataclass_transform, overload

Record = TypeVar("Record")
Kind: TypeAlias = Any
"""A class; mypy has no word for one whose objects have a hash of their own."""


@overload
def record(cls: type[Record], /) -> type[Record]: ...
@overload
def record(*, slots: bool = True) -> Callable[[type[Record]], type[Record]]: ...
@dataclass_transform(frozen_default=True, field_specifiers=(field,))
def record(cls: Kind | None = None, /, *, slots: bool = True) -> Any:
    """Make a class a record; with ``slots=False`` it can have cached properties.

    Methods that the class, or a base of it, defines itself are kept.
    """
    return _record(cls, slots) if cls else lambda one: _record(one, slots)


def _record(cls: Kind, slots: bool) -> Kind:
    made = dataclass(init=False, repr=False, eq=False, slots=slots)(cls)
    made.__init__ = _constructor(made)
    shared = SHARED | (STATE if slots else {})
    for name, method in shared.items():
        if getattr(made, name, None) is getattr(object, name, None):
            setattr(made, name, method)
    return made


def _constructor(cls: Kind) -> Callable[..., None]:
    """Return the constructor of a record: it has ``dataclasses`` make the real one, once."""

    def construct(self: Any, *given: Any, **named: Any) -> None:
        twin: Any = make_dataclass(
            cls.__name__,
            [(one.name, one.type, one) for one in fields(cls)],
            namespace={name: hook for name in HOOKS if (hook := getattr(cls, name, None))},
            repr=False,
            eq=False,
            frozen=True,
        )
        cls.__init__ = twin.__init__
        twin.__init__(self, *given, **named)

    return construct


HOOKS = ("__post_init__",)
"""Methods of a record that its constructor calls."""


@cache
def _compared(cls: Kind) -> Callable[[Any], tuple[Any, ...]]:
    """Return the function that gives the compared values of a record of class ``cls``."""
    names = [one.name for one in fields(cls) if one.compare]
    if len(names) > 1:
        return attrgetter(*names)
    return lambda one: tuple(getattr(one, name) for name in names)


def _is_equal(self: Any, other: object) -> bool:
    if other.__class__ is not self.__class__:
        return NotImplemented
    values = _compared(self.__class__)
    return values(self) == values(other)


def _hash(self: Any) -> int:
    return hash(_compared(self.__class__)(self))


@recursive_repr()
def _words(self: Any) -> str:
    values = (f"{one.name}={getattr(self, one.name)!r}" for one in fields(self) if one.repr)
    return f"{self.__class__.__qualname__}({', '.join(values)})"


def _refuse_change(self: Any, name: str, value: Any) -> NoReturn:
    raise FrozenInstanceError(f"cannot assign to field {name!r}")


def _refuse_removal(self: Any, name: str) -> NoReturn:
    raise FrozenInstanceError(f"cannot delete field {name!r}")


def _state(self: Any) -> list[Any]:
    return [getattr(self, one.name) for one in fields(self)]


def _restore(self: Any, state: list[Any]) -> None:
    for one, value in zip(fields(self), state, strict=True):
        object.__setattr__(self, one.name, value)


SHARED = {
    "__eq__": _is_equal,
    "__hash__": _hash,
    "__repr__": _words,
    "__setattr__": _refuse_change,
    "__delattr__": _refuse_removal,
}
STATE = {"__getstate__": _state, "__setstate__": _restore}
"""What pickles of records with slots contain."""
