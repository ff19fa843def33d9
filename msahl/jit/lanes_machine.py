"""Defines lanes for numba: a vector type of LLVM, with its arithmetic, loads and stores.

Source: LLVM Language Reference, vector type; numba, Extending numba: low-level API.
"""

import operator
from typing import Any

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.imputils import lower_builtin
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import models, register_model

from msahl.jit.lanes import LANES, load, spread, store

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
ALIGNMENT = 8
"""Bytes: arrays of numpy are aligned to one double."""


class LanesType(types.Type):
    """Type of a value of four doubles."""


lanes = LanesType("lanes")


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: types.Type) -> None:
        super().__init__(manager, kind, VECTOR)


def _spread(builder: Any, value: Any) -> Any:
    """Return lanes that all have a ``value``."""
    index = ir.IntType(32)
    one = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, index(0))
    every = ir.Constant(ir.VectorType(index, LANES), [0] * LANES)
    return builder.shuffle_vector(one, ir.Constant(VECTOR, ir.Undefined), every)


def _operation(operator_: Any, instruction: str) -> None:
    """Register an operation between two lanes, or lanes and a float."""

    @infer_global(operator_)
    class _Operation(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            if lanes in args and all(kind in (lanes, types.float64) for kind in args):
                return signature(lanes, *args)
            return None

    for kinds in ((lanes, lanes), (lanes, types.float64), (types.float64, lanes)):

        @lower_builtin(operator_, *kinds)
        def _lower(context: Any, builder: Any, sig: Any, args: Any) -> Any:
            a, b = (
                value if kind == lanes else _spread(builder, value)
                for kind, value in zip(sig.args, args, strict=True)
            )
            return getattr(builder, instruction)(a, b)


for _operator, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _operation(_operator, _instruction)


@infer_global(operator.neg)
class _Negative(AbstractTemplate):
    def generic(self, args: Any, kws: Any) -> Any:
        return signature(lanes, lanes) if args == (lanes,) else None


@lower_builtin(operator.neg, LanesType)
def _negative(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.fneg(args[0])


def _function(function: Any, result: types.Type, given: tuple[Any, ...], lower: Any) -> None:
    """Register a ``function`` of arguments of the types ``given``, an Array for any rows."""

    @infer_global(function)
    class _Called(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            wanted = (
                kind if isinstance(expected, type) else expected
                for kind, expected in zip(args, given, strict=True)
            )
            return signature(result, *wanted)

    infer_global(function, types.Function(_Called))
    lower_builtin(function, *given)(lower)


def _place(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Return the address of row ``args[1]`` of the array ``args[0]``, as one of lanes."""
    rows = context.make_array(sig.args[0])(context, builder, args[0])
    first = [args[1], context.get_constant(types.intp, 0)]
    place = cgutils.get_item_pointer(
        context, builder, sig.args[0], rows, first, wraparound=False, boundscheck=False
    )
    return builder.bitcast(place, VECTOR.as_pointer())


def _load(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return builder.load(_place(context, builder, sig, args), align=ALIGNMENT)


def _store(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    builder.store(args[2], _place(context, builder, sig, args), align=ALIGNMENT)
    return context.get_dummy_value()


def _spread_number(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    return _spread(builder, args[0])


_function(load, lanes, (types.Array, types.intp), _load)
_function(store, types.none, (types.Array, types.intp, LanesType), _store)
_function(spread, lanes, (types.float64,), _spread_number)
