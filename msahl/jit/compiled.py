"""Gives Python the compiled forms of kernels: loaded from disk, or compiled on the first call.

Machine code is kept in object files (``files``), one for each kernel and set of argument types.
``NUMBA_CACHE_DIR`` moves the user's folder of them, ``NUMBA_DISABLE_JIT=1`` runs everything as
plain Python. No compiler is imported unless something has to be compiled; where numba's insides
differ from what ``machine_code`` extends, plain numba is used (``plain``).
"""

import os
import time
from collections.abc import Callable, Iterable, Sequence
from threading import Lock
from typing import Any

from msahl.jit.arguments import Blocks, describe, symbol_of
from msahl.jit.files import Files, source_table, user_folder, version_of
from msahl.jit.general import round_up
from msahl.jit.kernel_store import Store
from msahl.jit.object_file import Name, ObjectFile, Unit, name_of
from msahl.jit.progress import CompileError, Listener

DISABLED = bool(os.environ.get("NUMBA_DISABLE_JIT"))
PLAIN = "MSAHL_PLAIN_NUMBA"
"""Variable of the environment that demands plain numba."""

TESTED = ((0, 66), (0, 68))
"""First and last version of numba whose insides are those that ``machine_code`` extends."""
NO_COMPILER = (
    "this kind of model has no compiled code for this machine, and numba, which compiles it, is "
    "not installed; install it with: pip install numba"
)

Call = tuple[Any, Sequence[Any]]
"""A compiled function and the arguments of a call."""

STORE = Store(user_folder())
LOADED: list[Unit] = []
"""What was asked for in this process, and loaded or compiled."""
_loaded: dict[str, ObjectFile] = {}
_loading = Lock()
"""Code is loaded, or compiled, by one thread at a time: twice the same would be refused."""


def compiled(function: Callable[..., Any]) -> Any:
    """Return ``function`` compiled on its first call, or loaded from disk."""
    return function if DISABLED else Compiled(function)


class Compiled:
    """A kernel that Python calls as machine code."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        self.__doc__ = function.__doc__
        self._blocks = Blocks()
        self._entries: dict[str, Callable[..., Any]] = {}
        self._plain: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        """Run the machine code; compile or load it first if that was not done."""
        found = self._blocks.find(arguments)
        if found is None and self._plain is None:
            prepare([(self, arguments)])
            found = self._blocks.find(arguments)
        if found is None:
            return self._compiled_plainly(*arguments)
        block, enter = found
        return enter(block.address)

    def unit(self, arguments: Sequence[Any]) -> Unit:
        """Return the function's name with the types of the ``arguments``."""
        described = tuple(describe(argument) for argument in arguments)
        return self.function.__module__, self.function.__qualname__, round_up(described)

    def is_ready(self, arguments: Sequence[Any]) -> bool:
        """Whether a block of memory was prepared for calls with these ``arguments``."""
        return self._blocks.find(arguments) is not None

    def keep(self, arguments: Sequence[Any], unit: Unit) -> None:
        """Have the block of memory ready for calls with these ``arguments``, whose machine code is
        loaded.
        """
        symbol = symbol_of(*unit)
        if symbol not in self._entries:
            from msahl.jit.loading import entry

            self._entries[symbol] = entry(symbol, _loaded[symbol].result)
        self._blocks.add(arguments, unit[2], self._entries[symbol])

    def _compiled_plainly(self, *arguments: Any) -> Any:
        from msahl.jit.plain import plain

        self._plain = self._plain or plain(self.function)
        return self._plain(*arguments)


class _Stopwatch:
    """Counts the seconds of compiling in this process; calls ``tell`` when it begins, and
    ``listen`` with the progress.
    """

    def __init__(self) -> None:
        self.seconds = 0.0
        self.computed = 0.0  # of them, by the thread itself: other processes compile
        self.tell: Callable[[], Any] = lambda: None
        self.listen: Listener = lambda progress: None


STOPWATCH = _Stopwatch()


def working_clock() -> float:
    """Return the seconds that this thread has computed: a clock that stops while other programs
    have the processor, and while kernels are compiled.
    """
    return time.thread_time() - STOPWATCH.computed


def prepare(calls: Iterable[Call], stopped: Callable[[], bool] = lambda: False) -> None:
    """Load the code that ``calls`` need, and compile what is not on disk.

    The ``STOPWATCH`` reports it. Raises KeyboardInterrupt as soon as ``stopped`` says so, and
    ``CompileError`` where there is no compiler.
    """
    made = [
        (function, given, function.unit(given))
        for function, given in calls
        if isinstance(function, Compiled) and not function.is_ready(given)
    ]
    with _loading:
        loaded = _loads([unit for _, _, unit in made], stopped)
    if loaded:
        for function, given, unit in made:
            function.keep(given, unit)


def _loads(units: list[Unit], stopped: Callable[[], bool]) -> bool:
    """Load the code of ``units``; return whether they have code of ours."""
    if all(symbol_of(*unit) in _loaded for unit in units):
        return True
    files = Files(STORE)
    found: dict[str, ObjectFile] = {}
    if not _collect(files, map(name_of, units), found):
        if not _fits():
            STOPWATCH.tell()
            return False
        _build(files, units, found, stopped)
        complete = _collect(files, map(name_of, units), found)
        assert complete, "a kernel was compiled, but not found"
    _take(found)
    LOADED.extend(units)
    source_table().save()
    return True


def _take(found: dict[str, ObjectFile]) -> None:
    from msahl.jit.loading import load

    load(code.code for code in found.values())
    _loaded.update(found)


def load_in_advance(names: Iterable[Name]) -> None:
    """Load the code of kernels by their names, if it is on disk."""
    found: dict[str, ObjectFile] = {}
    with _loading:
        if _collect(Files(STORE), names, found) and found:
            _take(found)


def on_disk(calls: Iterable[Call]) -> bool:
    """Whether the code that ``calls`` need is there already."""
    return _collect(Files(STORE), map(name_of, _units(calls)), {})


def _units(calls: Iterable[Call]) -> list[Unit]:
    return [function.unit(given) for function, given in calls if isinstance(function, Compiled)]


def _collect(files: Files, wanted: Iterable[Name], found: dict[str, ObjectFile]) -> bool:
    """Add the code of kernels and of those that they call to ``found``; whether none is missing."""
    todo, seen = list(wanted), set(_loaded)
    while todo:
        name = todo.pop()
        symbol = name[2]
        if symbol in seen:
            continue
        seen.add(symbol)
        code = found.get(symbol) or files.find(name)
        if code is None:
            return False
        found[symbol] = code
        todo += code.calls
    return True


def _build(
    files: Files, units: list[Unit], found: dict[str, ObjectFile], stopped: Callable[[], bool]
) -> None:
    """Compile what is missing of ``units`` and those that they call."""
    from msahl.jit.building import Build, build

    began, computed = time.perf_counter(), time.thread_time()
    STOPWATCH.tell()

    def known(name: Name) -> ObjectFile | None:
        return _loaded.get(name[2]) or found.get(name[2]) or files.find(name)

    def keep(name: Name, code: ObjectFile) -> None:
        files.save(name, code)
        found[name[2]] = code

    try:
        build(Build(files, known, keep), units, STOPWATCH.listen, stopped)
    finally:
        STOPWATCH.seconds += time.perf_counter() - began
        STOPWATCH.computed += time.thread_time() - computed


def _fits() -> bool:
    """Whether the installed numba is one that ``machine_code`` extends; see ``TESTED``."""
    if os.environ.get(PLAIN):
        return False
    found = version_of("numba")
    if not found:
        raise CompileError(NO_COMPILER)
    major, minor = found.split(".")[:2]
    return TESTED[0] <= (int(major), int(minor)) <= TESTED[1]


def trouble() -> str:
    """Return why compiled code cannot be kept, and what to do; empty if it can."""
    if not STORE.trouble:
        return ""
    return (
        f"{STORE.trouble}: compiled code is not kept there, so every run compiles again. Make "
        "the folder writable for yourself only (chmod go-w), or set NUMBA_CACHE_DIR to another one"
    )
