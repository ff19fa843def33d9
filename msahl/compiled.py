"""The kernels, compiled by numba and kept on disk.

The cache is the user's own (an installed package may be read-only), one folder per state of our
sources: numba looks only at the file of the function it enters, not at those it calls, so a cache
shared between versions would run old physics. ``NUMBA_CACHE_DIR`` moves it, ``NUMBA_DISABLE_JIT=1``
runs everything as plain Python.
"""

import hashlib
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import platformdirs
from numba.core import event
from numba.core.caching import FunctionCache
from numba.extending import register_jitable

import msahl.by_reference  # noqa: F401 - tells numba what a group is
from msahl.kernel import APART, MARKED
from msahl.part import Apart, Entered, Inlined

OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False, "no_cfunc_wrapper": True}
"""Division by zero gives inf or nan, which the solver sees, instead of an exception. Without
numba's runtime (_nrt) a kernel cannot allocate, and arrays are passed without counting their
references, which took seven eighths of a small scene's step."""
SMALL = 800
"""Bytes of Python code up to which a function is made part of its callers. Small scenes gain a
tenth; with larger functions they gain nothing and compiling takes longer."""

KERNEL_ROOMS = ("bodies", "forces", "joints", "post", "schemes", "solve", "system")
SHARED = ("law.py", "rotation.py", "study/dynamics.py", "vector.py")
COMPILER = ("by_reference.py", "compiled.py", "kernel.py", "part.py")
KERNELS = (*SHARED, *COMPILER, *(f"{r}/*.py" for r in KERNEL_ROOMS))
"""The sources of the package that compiled code depends on."""

_registered: set[Callable[..., Any]] = set()


def cache_folder() -> Path:
    """Where the compiled kernels of these very sources are kept."""
    kept = os.environ.get("NUMBA_CACHE_DIR")
    root = kept or platformdirs.user_cache_dir("msahl", appauthor=False)
    package = Path(__file__).parent
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(s for pattern in KERNELS for s in package.glob(pattern)):
        stat = source.stat()
        digest.update(f"{source} {stat.st_mtime_ns} {stat.st_size}\n".encode())
    return Path(root) / digest.hexdigest()[:16]


def is_kept(kind: str) -> bool:
    """Whether the step of this ``kind`` of scene is on disk, or need not be compiled at all."""
    return bool(os.environ.get("NUMBA_DISABLE_JIT")) or (cache_folder() / kind).exists()


def keep(kind: str) -> None:
    """Note that the step of this ``kind`` of scene is compiled and kept."""
    folder = cache_folder()
    if folder.is_dir():
        (folder / kind).touch()


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """``function`` compiled on its first call (or loaded from the cache), with all it calls."""
    options = {**OPTIONS, "pipeline_class": Entered}
    dispatcher: Any = numba.njit(**options)(function)
    if dispatcher is not function:  # it is, where nothing is to be compiled
        dispatcher._cache = _Kept(function)  # type: ignore[no-untyped-call]
    entered: Callable[..., Any] = dispatcher
    return entered


class _Kept(FunctionCache):
    """numba's cache on disk, which loads what is there and no more.

    numba itself first gets ready to compile, with all it knows of Python and numpy: 0.35 s.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """What is kept for a signature, None where nothing is."""
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]


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


# Sums of tuples become sums of the processor's own vectors.
setattr(numba.config, "SLP_VECTORIZE", 1)  # noqa: B010 - missing in its type stub
event.register("numba:compile", _Registrar())  # type: ignore[no-untyped-call]
event.register("numba:compile", STOPWATCH)  # type: ignore[no-untyped-call]
setattr(numba.config, "CACHE_DIR", str(cache_folder()))  # noqa: B010 - missing in its type stub
