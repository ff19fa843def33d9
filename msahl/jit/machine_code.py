"""Translates kernels into object files, by numba; the only module that does so.

``front_end`` translates one function, for one set of argument types, into LLVM's intermediate code.
Of the functions that it calls it needs only the names and what they return, by their annotations
(``arguments.result_of``), so all functions can be translated side by side, and each only once.
``link`` makes an object file of a function with all that it calls, except for units
(``kernel.unit``), which have files of their own. The file holds two functions: SYMBOL, with numba's
calling convention, for other kernels, and SYMBOL.entry(arguments, result), for Python (see
``arguments.Block``).
"""

import inspect
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.compiler import Flags, compile_extra
from numba.core.compiler_lock import global_compiler_lock
from numba.core.imputils import lower_builtin
from numba.core.registry import cpu_target
from numba.core.typing.templates import AbstractTemplate, signature
from numba.extending import register_jitable

from msahl.jit.arguments import GROUP, Description, result_of, symbol_of
from msahl.jit.kernel import APART, MARKED, UNITS
from msahl.jit.linking import Included, Library, ObjectLibrary, Separate
from msahl.jit.object_file import Name, ObjectFile, Unit, name_of
from msahl.jit.struct_arguments import Group, description_of, member, type_of

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
"""Division by zero gives inf or nan, which the solver detects, instead of an exception. Without
numba's runtime (_nrt) a kernel cannot allocate, and arrays are passed without counting their
references, which took seven eighths of a step of a small system."""
SMALL = 800
"""Bytes of Python bytecode up to which a function is inlined. That makes small systems a tenth
faster; inlining larger functions gains nothing and takes longer to compile."""

Function = Callable[..., Any]
_registered: set[Function] = set()

# LLVM makes vector instructions of operations on tuples.
setattr(numba.config, "SLP_VECTORIZE", 1)  # noqa: B010 - missing in its type stub


class _Calls:
    """The functions that the one in translation calls."""

    def __init__(self) -> None:
        self.units: list[Unit] = []

    def add(self, unit: Unit) -> None:
        """Add a call."""
        if unit not in self.units:
            self.units.append(unit)


_calls = _Calls()


@global_compiler_lock
def front_end(function: Function, arguments: Sequence[Description]) -> ObjectFile:
    """Return the intermediate code of ``function`` for these types of arguments, and what it
    calls.
    """
    _register_all()
    _calls.units = []
    typing_context, context = cpu_target.typing_context, cpu_target.target_context
    typing_context.refresh()
    context.refresh()
    kinds = tuple(type_of(argument) for argument in arguments)
    if function.__code__.co_flags & inspect.CO_VARARGS:
        named = function.__code__.co_argcount
        kinds = (*kinds[:named], types.StarArgTuple(kinds[named:]))
    expected = result_of(function)
    flags: Any = Flags()
    flags.error_model, flags.nrt = OPTIONS["error_model"], OPTIONS["_nrt"]
    flags.no_cpython_wrapper = flags.no_cfunc_wrapper = True
    result = None if expected is None else type_of(expected)
    done: Any = compile_extra(
        typing_context, context, function, kinds, result, flags, {}, pipeline_class=Separate
    )
    library: Library = done.library
    library.finalize()
    symbol = symbol_of(function.__module__, function.__qualname__, arguments)
    small = len(function.__code__.co_code) < SMALL
    inline = small and function not in APART and function not in UNITS
    code = library.emit_bitcode(done.fndesc.mangled_name, symbol, inline)
    returned = description_of(done.signature.return_type)
    return ObjectFile.of(code, returned, _calls.units)


@global_compiler_lock
def link(unit: Unit, codes: Mapping[Name, ObjectFile]) -> ObjectFile:
    """Return the machine code of a function, given the intermediate ``codes`` of it and of those
    that it calls; units stay outside.
    """
    context, name = cpu_target.target_context, name_of(unit)
    symbol = name[2]
    library = ObjectLibrary(context.codegen(), symbol)
    for key in sorted(codes):
        library.add_bitcode(codes[key].code)
    library.exported = (symbol, f"{symbol}.entry")
    result = codes[name].result
    _add_entry(library, context, unit, type_of(result))
    library.finalize()
    called = {
        call: words
        for code in codes.values()
        for call, words in zip(code.calls, code.types, strict=True)
        if call not in codes
    }
    outside = tuple(sorted(called))
    return ObjectFile(
        library.emit_object(), result, outside, tuple(called[call] for call in outside)
    )


def _register_all() -> None:
    """Register the marked functions with numba."""
    for function in MARKED:
        if function in _registered:
            continue
        _registered.add(function)
        if result_of(function) is None:
            register_jitable(**OPTIONS, pipeline_class=Included)(function)
        else:
            _register_separate(function)


def _register_separate(function: Function) -> None:
    """Let kernels call a function by its symbol, without translating it."""
    described = result_of(function)
    assert described is not None
    result = type_of(described)
    module, name = function.__module__, function.__qualname__

    class _Called(AbstractTemplate):
        key = function

        def generic(self, args: Any, kws: Any) -> Any:
            assert not kws, f"{name} is called with keywords"
            return signature(result, *(types.unliteral(kind) for kind in args))

    cpu_target.typing_context.insert_global(function, types.Function(_Called))

    @lower_builtin(function, types.VarArg(types.Any))
    def _call(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        called = module, name, tuple(description_of(kind) for kind in sig.args)
        _calls.add(called)
        convention = context.call_conv
        kind = convention.get_function_type(sig.return_type, sig.args)
        callee = cgutils.get_or_insert_function(builder.module, kind, symbol_of(*called))
        _, value = convention.call_function(builder, callee, sig.return_type, sig.args, args)
        return value


def _add_entry(library: ObjectLibrary, context: Any, unit: Unit, result: types.Type) -> None:
    """Add the function that Python calls: it loads the arguments and stores the result."""
    parts: Any = result if isinstance(result, types.BaseTuple) else (result,)
    if any(isinstance(part, types.BaseTuple | types.Array) for part in parts):
        return  # of use to kernels alone
    symbol = symbol_of(*unit)
    module = library.create_ir_module(f"{symbol}.module")
    convention, address = context.call_conv, ir.IntType(8).as_pointer()
    entry = ir.Function(
        module, ir.FunctionType(ir.VoidType(), [address, address]), f"{symbol}.entry"
    )
    builder = ir.IRBuilder(entry.append_basic_block())
    members = tuple((f"a{k}", argument) for k, argument in enumerate(unit[2]))
    group = Group((GROUP, "arguments", members))
    kinds = [type_of(argument) for argument in unit[2]]
    given = [member(context, builder, group, entry.args[0], name) for name in group.names]
    kind = convention.get_function_type(result, kinds)
    function = cgutils.get_or_insert_function(module, kind, symbol)
    function.attributes.add("noinline")
    _, value = convention.call_function(builder, function, result, kinds, given)
    for k, part in enumerate(parts):
        if isinstance(part, types.NoneType):
            continue
        number = builder.extract_value(value, k) if isinstance(result, types.BaseTuple) else value
        number = builder.zext(number, ir.IntType(64)) if part == types.boolean else number
        place = builder.gep(entry.args[1], [ir.IntType(64)(8 * k)])
        builder.store(number, builder.bitcast(place, number.type.as_pointer()))
    builder.ret_void()
    library.add_ir_module(module)
