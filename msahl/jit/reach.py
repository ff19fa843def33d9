"""Finds the source files on which a compiled function depends, and their digest.

A function depends on its own module, on the modules of all functions that it reaches by the names
in its code, and on constants that these import. Where it reaches a function that is compiled on
its own (``kernel.unit``), only the type of that one's result matters.
"""

import functools
import hashlib
import importlib
import sys
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, cast

import numpy as np

from msahl.jit.arguments import result_of
from msahl.jit.kernel import APART, UNITS

COMPILER = (
    "arguments",
    "kernel",
    "lanes_machine",
    "linking",
    "machine_code",
    "object_file",
    "struct_arguments",
)
"""Modules of this package that decide what is compiled, and how."""
PACKAGE = Path(__file__).parent.parent
CONSTANTS = (bool, int, float, str, bytes, tuple)

STARTED = time.time()
changed: set[str] = set()
"""Modules whose files changed since this process began, so that their digests are not those of the
code that was imported: what is compiled then must not be kept."""

Function = Callable[..., Any]


@functools.cache
def resolve(module: str, name: str) -> Function:
    """Return the function of that name."""
    found: Any = importlib.import_module(module)
    for part in name.split("."):
        found = getattr(found, part)
    return cast(Function, found)


def source_digest(function: Function) -> str:
    """Return the SHA-256 of everything in the package that the machine code depends on."""
    files, constants = _reached(function)
    digest = hashlib.sha256()
    for name in sorted({*files, *(f"msahl.jit.{name}" for name in COMPILER)}):
        digest.update(f"{name} {_file_digest(name)}\n".encode())
    for text in sorted(constants):
        digest.update(f"{text}\n".encode())
    return digest.hexdigest()


def own_digest(function: Function) -> str:
    """Return the SHA-256 of what the code of one function depends on, without those that it calls:
    of its bytecode, not of its text, so comments do not count.
    """
    digest = hashlib.sha256()
    modules = {f"msahl.jit.{name}" for name in COMPILER}
    for included in sorted(_included(function), key=_signature):
        classes, functions, constants = _uses(included)
        modules |= classes
        called = sorted(map(_signature, functions))
        parts = _bytecode(included), sorted(constants), called, included in UNITS | {*APART}
        digest.update(repr(parts).encode())
    for name in sorted(modules):
        digest.update(_file_digest(name).encode())
    return digest.hexdigest()


def package_digest() -> str:
    """Return the SHA-256 of all sources of the package."""
    digest = hashlib.sha256()
    for source in sorted(PACKAGE.rglob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()


def _signature(function: Function) -> str:
    """Return what a caller's code depends on: which function it is, and what it returns."""
    result = function.__annotations__.get("return")
    return f"{function.__module__}.{function.__qualname__} -> {result}"


def _included(function: Function) -> set[Function]:
    """Return ``function`` and those that are compiled as a part of it."""
    found, todo = {function}, [function]
    while todo:
        inner = {f for f in _uses(todo.pop())[1] if result_of(f) is None} - found
        todo += inner
        found |= inner
    return found


def _bytecode(function: Any) -> tuple[Any, ...]:
    """Return everything of a function's code but its text."""
    code = function.__code__
    constants = tuple(
        x for x in code.co_consts if x != function.__doc__ and not isinstance(x, types.CodeType)
    )
    return code.co_code, repr(constants), code.co_names, code.co_varnames, code.co_freevars


@functools.cache
def code_size(function: Function) -> int:
    """Return the bytes of bytecode compiled with a function, to which the time is proportional."""
    functions = (f for f in _functions(function) if f is function or f not in UNITS)
    return sum(len(f.__code__.co_code) for f in functions)


def _reached(entry: Function) -> tuple[set[str], set[str]]:
    """Return the modules of all functions that ``entry`` reaches, and constants in words."""
    files: set[str] = set()
    constants: set[str] = set()
    for function in _functions(entry):
        if function in UNITS and function is not entry:
            constants.add(_signature(function))
        else:
            modules, _, values = _uses(function)
            files |= modules | {function.__module__}
            constants |= values
    return files, constants


def _functions(entry: Function) -> set[Function]:
    """Return ``entry`` and all functions that it reaches, as far as units."""
    found, todo = {entry}, [entry]
    while todo:
        function = todo.pop()
        if function is entry or function not in UNITS:
            _, functions, _ = _uses(function)
            todo += functions - found
            found |= functions
    return found


@functools.cache
def _uses(function: Function) -> tuple[frozenset[str], frozenset[Function], frozenset[str]]:
    """Return the modules of classes, the functions and the constants that a function names."""
    modules, functions, constants = set(), set(), set()
    enclosed = function.__code__.co_freevars
    for name, value in _named(function):
        if isinstance(value, types.FunctionType):
            if value.__module__.split(".")[0] in ("msahl", function.__module__.split(".")[0]):
                functions.add(value)
                if name in enclosed:  # no source says which function this is
                    place = f"{function.__qualname__}.{name}"
                    constants.add(f"{place} = {_signature(value)}")
        elif isinstance(value, type):
            if value.__module__.startswith("msahl."):
                modules.add(value.__module__)
        elif isinstance(value, np.ndarray):
            constants.add(f"{name} = {value.dtype} {value.shape} {value.tobytes()!r}")
        elif isinstance(value, CONSTANTS):
            constants.add(f"{name} = {value!r}")
    return frozenset(modules), frozenset(functions), frozenset(constants)


def _named(function: Any) -> Iterator[tuple[str, Any]]:
    """Yield the names in the code of a function with what they stand for."""
    names = set(_names(function.__code__))
    for name in names & function.__globals__.keys():
        value = function.__globals__[name]
        yield name, value
        if isinstance(value, types.ModuleType) and value.__name__.startswith("msahl"):
            yield from ((part, vars(value)[part]) for part in names & vars(value).keys())
    for name, cell in zip(function.__code__.co_freevars, function.__closure__ or (), strict=True):
        yield name, cell.cell_contents
    for value in function.__defaults__ or ():
        yield "default", value


def _names(code: types.CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _names(constant)


@functools.cache
def _file_digest(module: str) -> str:
    """Return the SHA-256 of a module's file; see ``changed``."""
    loaded = sys.modules.get(module)
    path = Path(str(loaded.__file__)) if loaded else PACKAGE / "jit" / f"{module.split('.')[-1]}.py"
    if path.stat().st_mtime > STARTED:
        changed.add(module)
    return hashlib.sha256(path.read_bytes()).hexdigest()
