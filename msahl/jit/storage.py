"""Keeps the groups of arrays of a run, so that the next run of the same kind fills them again.

Compiled code takes its arguments from a block of memory that holds the address of every array of
every group (``arguments.Block``). Laying out the blocks of a small model takes longer than a
thousand of its steps. They are found again by the identity of the groups, so a run that puts its
numbers into the groups of an earlier run needs no new blocks.

A group can be filled again if types, shapes and plain numbers are equal, and all indices in it:
those of a topology are shared by all systems that have it, so nothing may be written into them.
Otherwise the new group is used.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from threading import Lock
from typing import Any, TypeVar

import numpy as np

from msahl.jit.by_size import compiled_once
from msahl.jit.compiled import Compiled, on_disk

Group = TypeVar("Group", bound=tuple[Any, ...])

MOST_BYTES = 64_000_000
"""Largest sum of the sizes of the arrays that ``Storages`` keeps."""


PLAIN_RUNS = 2
"""Runs of one storage in which kernels that are called once stay plain Python."""


class Storage:
    """The groups of one subsystem, by name, for one run at a time.

    Indices in groups of the types ``constant`` are compared, all other arrays are filled. ``kind``
    is that of the runs that can use it.
    """

    def __init__(self, constant: tuple[type, ...] = (), kind: Hashable = None) -> None:
        self.kind, self._constant = kind, constant
        self._groups: dict[Hashable, tuple[Any, ...]] = {}
        self._owned: set[int] | None = None  # identities of their arrays, once they were asked for
        self._bytes = 0  # of these arrays
        self.runs = 0  # begun so far
        self._slow: set[Callable[..., Any]] = set()  # kernels without code at hand
        self._doubles: dict[int, tuple[Any, list[np.ndarray]]] = {}  # by the group's identity
        self.step_time = 0.0  # seconds that a step of the last run took; 0 before the first run

    def place(self, name: Hashable, fresh: Group) -> Group:
        """Return the group of this ``name`` from an earlier run with the numbers of the ``fresh``
        one, or ``fresh`` itself where the earlier one does not fit.
        """
        kept: Any = self._groups.get(name)
        into: list[tuple[np.ndarray, np.ndarray]] = []
        if type(kept) is type(fresh) and self._fits((kept,), (fresh,), False, into):
            for array, numbers in into:
                array[...] = numbers
            return kept  # type: ignore[no-any-return]
        self._groups[name] = fresh
        self._doubles.clear()
        self._owned = None
        return fresh

    @property
    def owned(self) -> set[int]:
        """Identities of all arrays, which live as long as they do."""
        if self._owned is None:  # most groups come one after the other before it is asked for
            groups = self._groups.values()
            arrays = {id(one): one for group in groups for one in arrays_in(group)}
            self._owned, self._bytes = set(arrays), sum(one.nbytes for one in arrays.values())
        return self._owned

    @property
    def size(self) -> int:
        """Bytes of all arrays."""
        return self._bytes if self.owned else 0

    def call(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a ``kernel`` that a run needs once or twice, with groups of this storage: as plain
        Python in the first runs, compiled in later ones if there is code for it. Both give the same
        digits; to load the code takes as long as some calls do.
        """
        if self.runs <= PLAIN_RUNS or kernel in self._slow:
            return kernel(*arguments)
        fast = compiled_once(kernel)
        ready = not isinstance(fast, Compiled) or fast.is_ready(arguments)
        if ready or on_disk([(fast, arguments)]):
            return fast(*arguments)
        self._slow.add(kernel)
        return kernel(*arguments)

    def doubles(self, value: Any) -> list[np.ndarray]:
        """Return the arrays of doubles in nested tuples of groups, in order."""
        if not isinstance(value, tuple):
            return doubles_in((value,))
        if not hasattr(value, "_fields"):
            return [array for part in value for array in self.doubles(part)]
        found = self._doubles.get(id(value))
        if found is None:
            found = self._doubles[id(value)] = value, doubles_in(value)
        return found[1]

    def _fits(
        self, kept: Any, fresh: Any, constant: bool, into: list[tuple[np.ndarray, np.ndarray]]
    ) -> bool:
        """Return whether ``fresh`` can be written into ``kept``, a part of a ``constant`` group or
        not; add the arrays that take numbers, and those that give them, to ``into``.
        """
        for old, new in zip(kept, fresh, strict=True):
            if old is new:
                continue
            if isinstance(new, np.ndarray):
                # An array of another group must be that group's own: both are changed together.
                if id(new) in self.owned or not _same_form(old, new):
                    return False
                if not constant or new.dtype == float:
                    into.append((old, new))
                elif old.tobytes() != new.tobytes():
                    return False
            elif not isinstance(new, tuple):
                if not _same_number(old, new):
                    return False
            elif type(old) is not type(new) or len(old) != len(new):
                return False
            else:
                inside = constant or isinstance(new, self._constant)
                if not self._fits(old, new, inside, into):
                    return False
        return True


def _same_form(kept: Any, fresh: np.ndarray) -> bool:
    return (
        isinstance(kept, np.ndarray)
        and kept.shape == fresh.shape
        and kept.dtype == fresh.dtype
        and kept.flags.c_contiguous == fresh.flags.c_contiguous
        and kept.flags.f_contiguous == fresh.flags.f_contiguous
    )


def _same_number(kept: Any, fresh: Any) -> bool:
    """Return whether plain numbers are equal in every bit; nan never is."""
    if type(kept) is not type(fresh):
        return False
    if isinstance(fresh, float) and kept == fresh == 0.0:
        return math.copysign(1.0, kept) == math.copysign(1.0, fresh)
    return bool(kept == fresh)


def arrays_in(value: Any) -> Iterator[np.ndarray]:
    """Yield the arrays in nested tuples, in order."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for part in value:
            yield from arrays_in(part)


def doubles_in(value: Any) -> list[np.ndarray]:
    """Return the arrays of doubles in nested tuples, in order."""
    # Parts of a group may be None, and arrays of whole numbers be indices.
    return [array for array in arrays_in(value) if array.dtype == float]


def with_own_doubles(group: Group) -> Group:
    """Return a group with copies of all arrays of doubles in it, and the same indices."""
    parts: list[Any] = []
    for part in group:
        if isinstance(part, np.ndarray) and part.dtype == float:
            part = part.copy()
        elif isinstance(part, tuple):
            part = with_own_doubles(part)
        parts.append(part)
    return type(group)(*parts) if hasattr(group, "_fields") else type(group)(parts)  # type: ignore[return-value]


class Storages:
    """Storage that no run uses at present, by the kind of the run."""

    def __init__(self, constant: tuple[type, ...] = ()) -> None:
        self._constant = constant
        self._free: OrderedDict[Hashable, list[Storage]] = OrderedDict()
        self._lock = Lock()

    def take(self, kind: Hashable) -> Storage:
        """Return storage for a run of this ``kind``; it is used by nobody else."""
        with self._lock:
            found = self._free.get(kind)
            storage = found.pop() if found else Storage(self._constant, kind)
        storage.runs += 1
        return storage

    def give_back(self, storage: Storage) -> None:
        """Keep the ``storage`` of a run that has ended; what was not used for longest is dropped
        where there is too much.
        """
        with self._lock:
            self._free.setdefault(storage.kind, []).append(storage)
            self._free.move_to_end(storage.kind)
            while sum(one.size for kept in self._free.values() for one in kept) > MOST_BYTES:
                self._free.popitem(last=False)
