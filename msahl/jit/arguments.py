"""Describes the arguments of compiled code, and lays them out in memory, without a compiler.

A kernel is compiled for types: a float, an int, a bool, None, an array of a number of dimensions,
a group (``NamedTuple``) or a tuple of these. Here a type is a nested tuple of words, its
*description*; two calls with equal descriptions run the same machine code. Compiled code is entered
with the address of one block of memory that holds all arguments one after the other, as a C struct:

    float, int       8 bytes
    bool             1 byte, aligned by what follows
    None             8 bytes without meaning
    array            two null pointers, number of entries, bytes of an entry, address of the first,
                     shape, strides: 8 bytes each (numba's layout of an array)
    group, tuple     its members, in place
"""

import ctypes
import hashlib
import struct
import typing
from collections import OrderedDict
from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Generic, TypeVar

import numpy as np

Description = tuple[Any, ...] | str

FLOAT, INT, BOOL, NONE = "float", "int", "bool", "none"
GROUP, ARRAY, TUPLE = "group", "array", "tuple"
_SCALARS: dict[type, str] = {
    float: FLOAT,
    np.float64: FLOAT,
    int: INT,
    np.int64: INT,
    bool: BOOL,
    np.bool_: BOOL,
    type(None): NONE,
}
_FORMATS = {FLOAT: "d", INT: "q", BOOL: "?", NONE: "q"}
_NOWHERE = np.zeros(8)
"""Memory whose address arrays without entries have."""
MOST_BLOCKS = 64
"""Largest number of blocks that are kept for repeated calls."""
MOST_KEPT = 2000
"""Groups of which descriptions and layouts are kept: those of some ten systems."""

Found = TypeVar("Found")


class _OfGroups(Generic[Found]):
    """What is computed of a group or tuple, by its identity, kept for others that contain it.

    Groups never change, and no array its place in memory, its shape or its type.
    """

    def __init__(self, compute: Callable[[Any], Found]) -> None:
        self._compute = compute
        self._known: dict[int, tuple[Any, Found]] = {}  # with the groups, kept alive

    def __call__(self, group: tuple[Any, ...]) -> Found:
        known = self._known
        found = known.get(id(group))
        if found is None:
            if len(known) >= MOST_KEPT:
                known = self._known = {}
            found = known[id(group)] = group, self._compute(group)
        return found[1]


def describe(value: Any) -> Description:
    """Return the description of a value; raise TypeError for what no kernel takes."""
    scalar = _SCALARS.get(type(value))
    if scalar is not None:
        return scalar
    if isinstance(value, np.ndarray):
        flags = value.flags
        order = "C" if flags.c_contiguous else "F" if flags.f_contiguous else "A"
        return (ARRAY, _name_of(value.dtype), value.ndim, order)
    if isinstance(value, tuple):
        return _description_of(value)
    raise TypeError(f"a kernel takes no {type(value).__name__}")


def _describe_group(group: Any) -> Description:
    members = tuple(map(describe, group))
    if hasattr(group, "_fields"):
        return (GROUP, type(group).__name__, tuple(zip(group._fields, members, strict=True)))
    return (TUPLE, members)


_description_of = _OfGroups(_describe_group)


@cache
def _name_of(dtype: np.dtype[Any]) -> str:
    """Return the name of an array's type; raise TypeError for another byte order."""
    if not dtype.isnative:
        raise TypeError(f"a kernel takes no array of {dtype.str}, of another byte order")
    return dtype.name


@cache
def digest(descriptions: tuple[Description, ...]) -> str:
    """Return a short name for the types of all arguments."""
    return hashlib.sha256(repr(descriptions).encode()).hexdigest()[:16]


@cache
def result_of(function: Callable[..., Any]) -> Description | None:
    """Return the description of what a kernel returns, by its annotation; None where that does not
    say it, or where the function cannot be found by its name.

    A kernel with such a description is compiled apart from those that call it.
    """
    if "<" in function.__qualname__:
        return None
    hints = typing.get_type_hints(function)
    return _described(hints["return"]) if "return" in hints else None


def _described(hint: Any) -> Description | None:
    """Return the description of an annotation; None if it has none."""
    if typing.get_origin(hint) is tuple:
        parts = tuple(_described(part) for part in typing.get_args(hint))
        return None if None in parts else (TUPLE, parts)
    return _SCALARS.get(hint) if isinstance(hint, type) else None


def symbol_of(module: str, name: str, arguments: Sequence[Description]) -> str:
    """Return the name under which the machine code of a kernel is found."""
    return f"{module}.{name}-{digest(tuple(arguments))}"


class Block:
    """The arguments of one kind of call in memory: groups for ever, numbers and arrays by call.

    ``described`` are the types that the machine code takes: groups without entries for some that
    are None.
    """

    def __init__(self, arguments: Sequence[Any], described: Sequence[Description]) -> None:
        self._groups = [value for value in arguments if isinstance(value, tuple)]  # kept alive
        self._changing: list[tuple[int, int, str]] = []  # number of the argument, place, format
        forms: list[str] = []
        numbers: list[Any] = []
        for number, value in enumerate(arguments):
            first = len(forms)
            _lay_out(value, described[number], forms, numbers)
            if not isinstance(value, tuple):
                size = struct.calcsize("".join(forms[:first]))
                place = size + -size % struct.calcsize(forms[first][-1])
                self._changing.append((number, place, forms[first]))
        layout = struct.Struct("".join(forms))
        self.memory = ctypes.create_string_buffer(max(8, layout.size + -layout.size % 8))
        layout.pack_into(self.memory, 0, *numbers)
        self.address = ctypes.addressof(self.memory)

    def update(self, arguments: Sequence[Any]) -> None:
        """Write the arguments that are numbers or arrays."""
        for number, place, form in self._changing:
            value = arguments[number]
            if isinstance(value, np.ndarray):
                struct.pack_into(form, self.memory, place, *_array(value))
            else:
                struct.pack_into(form, self.memory, place, 0 if value is None else value)


def _lay_out(value: Any, described: Description, forms: list[str], numbers: list[Any]) -> None:
    """Append the format, as of ``struct``, and the values of all numbers that stand for an array, a
    number or a group in memory. The native layout of ``struct`` aligns each number by its own size.
    """
    if isinstance(value, tuple):
        own = described == describe(value)
        of_group, its_numbers = _layout_of(value) if own else _lay_out_members(value, described)
        forms += of_group
        numbers += its_numbers
    elif isinstance(value, np.ndarray):
        forms.append(f"{5 + 2 * value.ndim}q")
        numbers += _array(value)
    elif value is None and described != NONE:
        _lay_out_empty(described, forms, numbers)
    else:
        forms.append(_FORMATS[_SCALARS[type(value)]])
        numbers.append(0 if value is None else value)


def _lay_out_members(group: tuple[Any, ...], described: Description) -> tuple[list[str], list[Any]]:
    """Return what ``_lay_out`` appends of all members of a group or tuple."""
    forms: list[str] = []
    numbers: list[Any] = []
    for value, one in zip(group, members_of(described), strict=True):
        _lay_out(value, one, forms, numbers)
    return forms, numbers


def _lay_out_own(group: tuple[Any, ...]) -> tuple[list[str], list[Any]]:
    return _lay_out_members(group, describe(group))


_layout_of = _OfGroups(_lay_out_own)


def members_of(described: Description) -> tuple[Description, ...]:
    """Return the descriptions of the members of a group or tuple."""
    assert isinstance(described, tuple)
    kind, members = described[0], described[-1]
    return tuple(members) if kind == TUPLE else tuple(one for _, one in members)


def _lay_out_empty(described: Description, forms: list[str], numbers: list[Any]) -> None:
    """Append what ``_lay_out`` would of a group whose arrays have no entries and whose numbers are
    zero.
    """
    if isinstance(described, str):
        forms.append(_FORMATS[described])
        numbers.append(0)
    elif described[0] == ARRAY:
        dimensions, size = int(described[2]), np.dtype(described[1]).itemsize
        forms.append(f"{5 + 2 * dimensions}q")
        numbers += (0, 0, 0, size, _NOWHERE.ctypes.data, *(0,) * (2 * dimensions))
    else:
        for one in members_of(described):
            _lay_out_empty(one, forms, numbers)


def _array(value: np.ndarray) -> tuple[int, ...]:
    """Return the numbers that stand for an array in memory."""
    address = value.__array_interface__["data"][0]
    return 0, 0, value.size, value.itemsize, address, *value.shape, *value.strides


class Blocks:
    """The blocks of the last calls, by the identity of their groups, each with the function that
    takes it.
    """

    def __init__(self) -> None:
        self._known: OrderedDict[tuple[Any, ...], tuple[Block, Callable[..., Any]]] = OrderedDict()

    def find(self, arguments: Sequence[Any]) -> tuple[Block, Callable[..., Any]] | None:
        """Return the block of an earlier call with the same groups, with the present numbers and
        arrays; None if there is none.
        """
        key = tuple(map(_identity, arguments))
        found = self._known.get(key)
        if found is not None:
            self._known.move_to_end(key)
            found[0].update(arguments)
        return found

    def add(
        self,
        arguments: Sequence[Any],
        described: Sequence[Description],
        enter: Callable[..., Any],
    ) -> tuple[Block, Callable[..., Any]]:
        """Return a new block for a function that takes arguments so ``described``, with it, and
        keep them for calls to come.
        """
        block = Block(arguments, described)
        block.update(arguments)
        known = self._known[tuple(map(_identity, arguments))] = block, enter
        if len(self._known) > MOST_BLOCKS:
            self._known.popitem(last=False)
        return known


def _identity(value: Any) -> Any:
    """Return what distinguishes an argument from others: the type of a number or an array, else the
    identity.
    """
    if isinstance(value, tuple):
        return id(value)
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.c_contiguous, value.flags.f_contiguous
    return type(value)
