"""Loads object files into this process and enters the functions in them.

Only llvmlite's loader is used: neither numba nor any compiler is imported.
"""

import ctypes
from collections.abc import Callable, Iterable
from functools import cache
from typing import Any

from llvmlite import binding as llvm

from msahl.jit.arguments import BOOL, FLOAT, NONE, Description

MOST_RESULTS = 8
"""Largest number of numbers that a kernel returns."""


@cache
def _engine() -> Any:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    machine = llvm.Target.from_default_triple().create_target_machine()
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)


def load(files: Iterable[bytes]) -> None:
    """Load the code of object files that refer to each other or to files loaded before."""
    engine = _engine()
    for code in files:
        engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()


def entry(symbol: str, result: Description) -> Callable[[int], Any]:
    """Return a function that enters loaded code, given the address of the arguments' block."""
    address = _engine().get_function_address(f"{symbol}.entry")
    if not address:
        raise RuntimeError(f"{symbol}: not in the code that was loaded")
    native = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(address)
    words = [word for word in ([result] if isinstance(result, str) else result[1]) if word != NONE]
    kinds = [ctypes.c_double if kind == FLOAT else ctypes.c_int64 for kind in words]
    assert len(kinds) <= MOST_RESULTS

    def enter(address: int) -> Any:
        memory = (ctypes.c_double * MOST_RESULTS)()
        native(address, memory)
        place = ctypes.addressof(memory)
        parts = [kind.from_address(place + 8 * k).value for k, kind in enumerate(kinds)]
        values = [bool(x) if words[k] == BOOL else x for k, x in enumerate(parts)]
        return None if not values else values[0] if len(values) == 1 else tuple(values)

    return enter
