"""Passes NamedTuples of arrays to compiled kernels by reference, as a C struct.

numba passes a ``NamedTuple`` as all of its scalars, seven and more for an array: a thousand for a
system, at every call, which took a third of the compile time. Here such a group of arrays lies in
memory while a kernel runs (``arguments.Block``), and its address is passed. The group itself never
changes while a kernel runs (only entries of its arrays do), and the loads are marked invariant.
"""

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model

from msahl.jit.arguments import ARRAY, BOOL, FLOAT, GROUP, INT, NONE, TUPLE, Description, digest
from msahl.jit.lanes_machine import lanes

_INT = ir.IntType(32)
_SCALARS = {
    FLOAT: types.float64,
    INT: types.int64,
    BOOL: types.boolean,
    NONE: types.none,
    "lanes": lanes,  # between kernels; Python passes none
}


class Group(types.Type):
    """Type of the address of a group; it depends on the names and types of the members."""

    def __init__(self, description: tuple[Any, ...]) -> None:
        _, kind, members = description
        self.description = description
        self.names = tuple(name for name, _ in members)
        self.members = tuple(type_of(member) for _, member in members)
        # Types are part of every function's name: written in full they would be half of the code.
        super().__init__(f"{kind}.{digest((description,))}")


def type_of(description: Description) -> types.Type:
    """Return numba's type for a description."""
    if isinstance(description, str):
        return _SCALARS[description]
    kind = description[0]
    if kind == GROUP:
        return Group(description)
    if kind == TUPLE:
        return types.Tuple([type_of(part) for part in description[1]])
    assert kind == ARRAY
    _, dtype, dimensions, order = description
    return types.Array(getattr(types, dtype if dtype != "bool" else "boolean"), dimensions, order)


def description_of(kind: types.Type) -> Description:
    """Return the description of one of numba's types."""
    kind = types.unliteral(kind)
    if isinstance(kind, Group):
        return kind.description
    if isinstance(kind, types.Array):
        return (ARRAY, str(kind.dtype), kind.ndim, kind.layout)
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        return (TUPLE, tuple(description_of(part) for part in parts))
    for word, scalar in _SCALARS.items():
        if kind == scalar:
            return word
    raise TypeError(f"units take no {kind}")


@register_model(Group)
class _Address(models.OpaqueModel):
    pass


@infer_getattr
class _Members(AttributeTemplate):
    key = Group

    def generic_resolve(self, value: Any, attr: str) -> Any:  # type: ignore[override]
        return value.members[value.names.index(attr)] if attr in value.names else None


def _in_memory(context: Any, kind: types.Type) -> ir.Type:
    """Return the memory layout of a group or a member; groups and tuples hold theirs in place."""
    if isinstance(kind, Group | types.BaseTuple):
        parts: Any = kind.members if isinstance(kind, Group) else kind
        return ir.LiteralStructType([_in_memory(context, part) for part in parts])
    return context.get_data_type(kind)


@lower_getattr_generic(Group)
def member(context: Any, builder: Any, group: Group, address: Any, name: str) -> Any:
    """Return a member of the group at an address: its address if it is a group, else its value."""
    k = group.names.index(name)
    place = builder.bitcast(address, _in_memory(context, group).as_pointer())
    place = builder.gep(place, [_INT(0), _INT(k)], inbounds=True)
    return _value(context, builder, group.members[k], place)


def _value(context: Any, builder: Any, kind: types.Type, place: Any) -> Any:
    """Return the value at a place in memory, of a group its address."""
    if isinstance(kind, Group):
        return builder.bitcast(place, ir.IntType(8).as_pointer())
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        values = [
            _value(context, builder, part, builder.gep(place, [_INT(0), _INT(k)], inbounds=True))
            for k, part in enumerate(parts)
        ]
        return context.make_tuple(builder, kind, values)
    return context.data_model_manager[kind].from_data(builder, _load(builder, place))


def _load(builder: Any, place: Any) -> Any:
    """Load the value at ``place`` and declare it invariant; LLVM allows this for scalars only."""
    kind = place.type.pointee
    if isinstance(kind, ir.Aggregate):
        aggregate = ir.Constant(kind, ir.Undefined)
        for k in range(len(kind)):
            part = builder.gep(place, [_INT(0), _INT(k)], inbounds=True)
            aggregate = builder.insert_value(aggregate, _load(builder, part), k)
        return aggregate
    value = builder.load(place)
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value
