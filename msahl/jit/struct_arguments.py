"""Passes NamedTuples of arrays to compiled kernels by reference, as a C struct.

numba passes a ``NamedTuple`` as all of its scalars, seven and more for an array: a thousand for a
system, at every call, which took a third of the compile time. Here such a group of arrays is stored
in memory while a kernel runs, and its address is passed. The group itself never changes while a
kernel runs (only entries of its arrays do), and the loads are marked invariant.
"""

import hashlib
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_getattr_generic,
    models,
    register_model,
    typeof_impl,
    unbox,
)

_INT = ir.IntType(32)


class Group(types.Type):
    """Type of the address of a group; it depends on the names and types of the members."""

    def __init__(self, kind: str, names: tuple[str, ...], members: tuple[types.Type, ...]) -> None:
        self.names, self.members = names, members
        layout = " ".join(f"{name}:{member}" for name, member in zip(names, members, strict=True))
        # Types are part of every function's name: written in full they would be half of the code.
        super().__init__(f"{kind}.{hashlib.sha256(layout.encode()).hexdigest()[:12]}")


_typeof_tuple = typeof_impl.dispatch(tuple)


@typeof_impl.register(tuple)
def _typeof(value: Any, context: Any) -> Any:
    """Return the type of a tuple: a ``Group`` for one of our NamedTuples, else numba's type."""
    if not type(value).__module__.startswith("msahl."):
        return _typeof_tuple(value, context)
    members = tuple(typeof_impl(part, context) for part in value)
    return Group(type(value).__name__, value._fields, members)


@register_model(Group)
class _Address(models.OpaqueModel):
    pass


@infer_getattr
class _Members(AttributeTemplate):
    key = Group

    def generic_resolve(self, value: Any, attr: str) -> Any:  # type: ignore[override]
        return value.members[value.names.index(attr)] if attr in value.names else None


def _in_memory(context: Any, kind: types.Type) -> ir.Type:
    """Return the memory layout of a group or a member."""
    if isinstance(kind, Group):
        return ir.LiteralStructType([_in_memory(context, member) for member in kind.members])
    return context.get_data_type(kind)


@lower_getattr_generic(Group)
def _member(context: Any, builder: Any, group: Group, address: Any, name: str) -> Any:
    k = group.names.index(name)
    kind = group.members[k]
    place = builder.bitcast(address, _in_memory(context, group).as_pointer())
    place = builder.gep(place, [_INT(0), _INT(k)], inbounds=True)
    if isinstance(kind, Group):
        return builder.bitcast(place, address.type)
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


@unbox(Group)
def _unbox(group: Group, value: Any, c: Any) -> NativeValue:
    memory = cgutils.alloca_once(c.builder, _in_memory(c.context, group))
    failed = _fill(group, value, memory, c)
    with c.builder.if_then(failed, likely=False):
        c.pyapi.err_set_string("PyExc_TypeError", f"not the {group} this kernel is compiled for")
    address = c.builder.bitcast(memory, c.context.get_value_type(group))
    # Launder the pointer through an empty asm so that LLVM cannot connect the stores above with the
    # invariant loads below.
    identity = ir.FunctionType(address.type, [address.type])
    address = c.builder.asm(identity, "", "=r,0,~{memory}", [address], side_effect=True)
    return NativeValue(address, is_error=failed)


def _fill(group: Group, value: Any, memory: Any, c: Any) -> Any:
    """Write the members of the Python object ``value`` to ``memory``; return if it failed."""
    failed = cgutils.false_bit
    for k, kind in enumerate(group.members):
        part = c.pyapi.tuple_getitem(value, k)
        place = c.builder.gep(memory, [_INT(0), _INT(k)], inbounds=True)
        if isinstance(kind, Group):
            wrong = _fill(kind, part, place, c)
        elif isinstance(kind, types.Array):
            place = c.builder.bitcast(place, c.pyapi.voidptr)
            wrong = cgutils.is_not_null(c.builder, c.pyapi.numba_array_adaptor(part, place))
        else:
            native = c.unbox(kind, part)
            model = c.context.data_model_manager[kind]
            c.builder.store(model.as_data(c.builder, native.value), place)
            wrong = native.is_error
        failed = c.builder.or_(failed, wrong)
    return failed
