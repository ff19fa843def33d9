"""The kernels, compiled by numba and kept on disk.

The cache is the user's own (an installed package may be read-only), one folder per state of our
sources: numba looks only at the file of the function it enters, not at those it calls, so a cache
shared between versions would run old physics. ``NUMBA_CACHE_DIR`` moves it, ``NUMBA_DISABLE_JIT=1``
runs everything as plain Python.
"""

import hashlib
import os
import pickle
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import llvmlite
import numba
import platformdirs
from numba.core import event
from numba.core.compiler import CompileResult
from numba.core.serialize import dumps
from numba.extending import register_jitable

import msahl.jit.struct_arguments  # noqa: F401 - tells numba what a group is
from msahl.jit.kernel import APART, MARKED
from msahl.jit.kernel_store import Store
from msahl.jit.linking import Apart, Entered, Inlined

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}
"""Division by zero gives inf or nan, which the solver sees, instead of an exception. Without
numba's runtime (_nrt) a kernel cannot allocate, and arrays are passed without counting their
references, which took seven eighths of a small scene's step."""
SMALL = 800
"""Bytes of Python code up to which a function is made part of its callers. Small scenes gain a
tenth; with larger functions they gain nothing and compiling takes longer."""

KERNEL_PACKAGES = ("algebra", "elements", "jit", "joints", "linalg", "model", "schemes", "system")
KERNEL_MODULES = ("post/replay.py", "post/virtual.py", "study/dynamics.py")
"""The sources of the package that compiled code depends on."""
LAYOUT = 2
"""Of the kept files; counted up when it changes."""

_registered: set[Callable[..., Any]] = set()


def cache_folder() -> Path:
    """Where the compiled kernels of these very sources are kept."""
    kept = os.environ.get("NUMBA_CACHE_DIR")
    root = kept or platformdirs.user_cache_dir("msahl", appauthor=False)
    package = Path(__file__).parent.parent
    compilers = (numba.__version__, llvmlite.__version__, sys.implementation.cache_tag)
    digest = hashlib.sha256(f"{LAYOUT} {compilers}\n".encode())
    packages = (s for name in KERNEL_PACKAGES for s in (package / name).rglob("*.py"))
    for source in sorted((*packages, *(package / name for name in KERNEL_MODULES))):
        content = source.read_bytes()
        digest.update(f"{source.relative_to(package)} {len(content)}\n".encode() + content)
    return Path(root) / digest.hexdigest()[:16]


def is_kept(kind: str) -> bool:
    """Whether the step of this ``kind`` of scene is on disk, or need not be compiled at all."""
    return bool(os.environ.get("NUMBA_DISABLE_JIT")) or STORE.load(kind) is not None


def keep(kind: str) -> None:
    """Note that the step of this ``kind`` of scene is compiled and kept."""
    if not os.environ.get("NUMBA_DISABLE_JIT"):
        STORE.save(kind, b"")


def trouble() -> str:
    """Why compiled code cannot be kept on disk, and what to do; empty if it can."""
    if not STORE.trouble:
        return ""
    return (
        f"{STORE.trouble}: compiled code is not kept there, so every run compiles anew. Give the "
        "folder to yourself alone (chmod go-w), or let NUMBA_CACHE_DIR name another one"
    )


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """``function`` compiled on its first call (or loaded from the cache), with all it calls."""
    options = {**OPTIONS, "pipeline_class": Entered}
    dispatcher: Any = numba.njit(**options)(function)
    if dispatcher is not function:  # it is, where nothing is to be compiled
        dispatcher._cache = _Kept(function)
    entered: Callable[..., Any] = dispatcher
    return entered


class _Kept:
    """What numba asks of the cache of one ``function``.

    numba's own gets ready to compile before it loads, with all it knows of Python and numpy (0.35
    s), executes whatever bytes it finds, and loses entries when two processes save at a time.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.cache_path = str(STORE.folder)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """The code kept for a signature, None where there is none."""
        name = self._name(signature, context.codegen())
        content = STORE.load(name)
        if content is None:
            return None
        try:
            return cast(Any, CompileResult)._rebuild(context, *pickle.loads(content))
        except Exception:  # whole, but of a library that has changed under the same version
            STORE.discard(name)
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Keep the code compiled for a signature."""
        if not result.library.has_dynamic_globals:
            STORE.save(self._name(signature, result.codegen), cast(Any, dumps)(result._reduce()))

    def flush(self) -> None:
        """Nothing waits to be written."""

    def _name(self, signature: Any, code: Any) -> str:
        """A file's name for the function, the types of its arguments, and the processor."""
        function = self.function
        key = (signature, code.magic_tuple(), function.__code__.co_code)
        told = hashlib.sha256(repr(key).encode()).hexdigest()
        return f"{function.__module__}.{function.__qualname__}-{told[:24]}"


class _Registrar(event.Listener):
    """Tells numba of the marked functions when it comes to compile: what is loaded needs none."""

    def on_start(self, event: event.Event) -> None:
        for mark in MARKED:
            if mark not in _registered:
                small = len(mark.__code__.co_code) < SMALL and mark not in APART
                register_jitable(**OPTIONS, pipeline_class=Inlined if small else Apart)(mark)
                _registered.add(mark)

    def on_end(self, event: event.Event) -> None:
        pass


class _Stopwatch(event.Listener):
    """Seconds that compiling has taken in this process; ``tell`` is called when it begins."""

    def __init__(self) -> None:
        self.seconds, self.began, self.depth = 0.0, 0.0, 0
        self.tell: Callable[[], Any] = lambda: None

    def on_start(self, event: event.Event) -> None:
        if self.depth == 0:
            self.began = time.perf_counter()
            self.tell()
        self.depth += 1

    def on_end(self, event: event.Event) -> None:
        self.depth -= 1
        if self.depth == 0:
            self.seconds += time.perf_counter() - self.began


STOPWATCH = _Stopwatch()


def working_clock() -> float:
    """Seconds of a clock that stands still while kernels are compiled."""
    return time.perf_counter() - STOPWATCH.seconds


STORE = Store(cache_folder())
# Sums of tuples become sums of the processor's own vectors.
setattr(numba.config, "SLP_VECTORIZE", 1)  # noqa: B010 - missing in its type stub
event.register("numba:compile", _Registrar())  # type: ignore[no-untyped-call]
event.register("numba:compile", STOPWATCH)  # type: ignore[no-untyped-call]
