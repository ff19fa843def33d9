"""Compiles kernels with numba and caches them on disk.

The cache belongs to the user (an installed package may be read-only) and has one folder per state
of the sources: numba checks only the file of the function that Python calls, not of those called
from it, so a cache shared between versions would run old equations. ``NUMBA_CACHE_DIR`` moves it,
``NUMBA_DISABLE_JIT=1`` runs everything as plain Python."""

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

import msahl.jit.struct_arguments  # noqa: F401 - registers groups with numba
from msahl.jit.kernel import APART, MARKED
from msahl.jit.kernel_store import Store
from msahl.jit.linking import Apart, Entered, Inlined

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}
"""Division by zero gives inf or nan, which the solver detects, instead of an exception. Without
numba's runtime (_nrt) a kernel cannot allocate, and arrays are passed without counting their
references, which took seven eighths of a step of a small system."""
SMALL = 800
"""Bytes of Python bytecode up to which a function is inlined. That makes small systems a tenth
faster; inlining larger functions gains nothing and takes longer to compile."""

KERNEL_PACKAGES = ("algebra", "elements", "jit", "joints", "linalg", "model", "schemes", "system")
KERNEL_MODULES = ("post/replay.py", "post/virtual.py", "study/dynamics.py")
"""Sources of the package on which compiled code depends."""
LAYOUT = 2
"""Version of the format of cached files."""

_registered: set[Callable[..., Any]] = set()


def cache_folder() -> Path:
    """Return the folder of the compiled kernels of the present sources."""
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
    """Whether the step of this ``kind`` is cached, or need not be compiled at all."""
    return bool(os.environ.get("NUMBA_DISABLE_JIT")) or STORE.load(kind) is not None


def keep(kind: str) -> None:
    """Record that the step of this ``kind`` is compiled and cached."""
    if not os.environ.get("NUMBA_DISABLE_JIT"):
        STORE.save(kind, b"")


def trouble() -> str:
    """Return why compiled code cannot be cached, and what to do; empty if it can."""
    if not STORE.trouble:
        return ""
    return (
        f"{STORE.trouble}: compiled code is not cached there, so every run compiles again. Make "
        "the folder writable for yourself only (chmod go-w), or set NUMBA_CACHE_DIR to another one"
    )


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return ``function`` compiled on its first call, or loaded from the cache."""
    options = {**OPTIONS, "pipeline_class": Entered}
    dispatcher: Any = numba.njit(**options)(function)
    if dispatcher is not function:  # it is the function itself with NUMBA_DISABLE_JIT
        dispatcher._cache = _Cache(function)
    entered: Callable[..., Any] = dispatcher
    return entered


class _Cache:
    """Cache of one compiled ``function``, with the methods that numba calls.

    numba's own cache prepares to compile before it loads (0.35 s), executes whatever bytes it
    finds, and loses entries when two processes save at the same time.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.cache_path = str(STORE.folder)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the code cached for a signature, None if there is none."""
        name = self._name(signature, context.codegen())
        content = STORE.load(name)
        if content is None:
            return None
        try:
            return cast(Any, CompileResult)._rebuild(context, *pickle.loads(content))
        except Exception:  # undamaged, but of a changed library with the same version
            STORE.discard(name)
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Cache the code compiled for a signature."""
        if not result.library.has_dynamic_globals:
            STORE.save(self._name(signature, result.codegen), cast(Any, dumps)(result._reduce()))

    def flush(self) -> None:
        """Do nothing: files are written at once."""

    def _name(self, signature: Any, code: Any) -> str:
        """Return the file name for the function, the types of its arguments, and the processor."""
        function = self.function
        key = (signature, code.magic_tuple(), function.__code__.co_code)
        told = hashlib.sha256(repr(key).encode()).hexdigest()
        return f"{function.__module__}.{function.__qualname__}-{told[:24]}"


class _Registrar(event.Listener):
    """Registers the marked functions with numba when it begins to compile; loading needs none."""

    def on_start(self, event: event.Event) -> None:
        for mark in MARKED:
            if mark not in _registered:
                small = len(mark.__code__.co_code) < SMALL and mark not in APART
                register_jitable(**OPTIONS, pipeline_class=Inlined if small else Apart)(mark)
                _registered.add(mark)

    def on_end(self, event: event.Event) -> None:
        pass


class _Stopwatch(event.Listener):
    """Counts the seconds of compiling in this process; calls ``tell`` when it begins."""

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
    """Return the seconds of a clock that stops while kernels are compiled."""
    return time.perf_counter() - STOPWATCH.seconds


STORE = Store(cache_folder())
# LLVM makes vector instructions of operations on tuples.
setattr(numba.config, "SLP_VECTORIZE", 1)  # noqa: B010 - missing in its type stub
event.register("numba:compile", _Registrar())  # type: ignore[no-untyped-call]
event.register("numba:compile", STOPWATCH)  # type: ignore[no-untyped-call]
