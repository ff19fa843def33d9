"""Groups of arrays by reference: how compiled kernels are handed what they work on.

numba takes a ``NamedTuple`` apart into its scalars, seven and more an array, and hands on all of
them at every call: a thousand for a scene, which took a third of the time of compiling. Here a
group lies in memory while a kernel runs and its address is handed on. A group never changes while a
kernel runs (its arrays' entries do), and the compiler is told so.
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
    """Type of the address of a group, by the names and types of its members."""

    def __init__(self, kind: str, names: tuple[str, ...], members: tuple[types.Type, ...]) -> None:
        self.names, self.members = names, members
        told = " ".join(f"{name}:{member}" for name, member in zip(names, members, strict=True))
        # A part of the name of every function: the whole would be half of the text of the code.
        super().__init__(f"{kind}.{hashlib.sha256(told.encode()).hexdigest()[:12]}")


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
    """How a group or a member lies in memory."""
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
    """What lies at a ``place``, said never to change: only of single numbers can that be said."""
    kind = place.type.pointee
    if isinstance(kind, ir.Aggregate):
        whole = ir.Constant(kind, ir.Undefined)
        for k in range(len(kind)):
            part = builder.gep(place, [_INT(0), _INT(k)], inbounds=True)
            whole = builder.insert_value(whole, _load(builder, part), k)
        return whole
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
    # For the compiler another address, of memory it has not seen being filled: what lies there has
    # never changed.
    identity = ir.FunctionType(address.type, [address.type])
    address = c.builder.asm(identity, "", "=r,0,~{memory}", [address], side_effect=True)
    return NativeValue(address, is_error=failed)


def _fill(group: Group, value: Any, memory: Any, c: Any) -> Any:
    """Write the members of ``value``, a Python object, to ``memory``; whether that failed."""
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
