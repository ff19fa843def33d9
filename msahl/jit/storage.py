"""Keeps the groups of arrays of a run, so that the next run of the same kind fills them again.

Compiled code takes its arguments from a block of memory that holds the address of every array of
every group (``arguments.Block``). Laying out the blocks of a small model takes longer than a
thousand of its steps. They are found again by the identity of the groups, so a run that puts its
numbers into the groups of an earlier run needs no new blocks.

A group can be filled again if types, shapes and plain numbers are equal, and all indices in it:
those of a topology are shared by all systems that have it, so nothing may be written into them.
Otherwise the new group is used.

Work arrays follow from the groups that they serve. They need not even be made again: they become
what they were when they were made (``again``).
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


Image = tuple[np.ndarray, np.ndarray | None]
"""An array with what it was when it was made; None for zeros."""

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
        self._made: dict[Hashable, tuple[tuple[Any, ...], list[Image]]] = {}  # parts, and the rest
        self._owned: set[int] = set()  # identities of their arrays, which live as long as they do
        self.size = 0  # bytes of all arrays
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
        self._keep(name, fresh)
        return fresh

    def again(self, name: Hashable, parts: tuple[Any, ...], make: Callable[[], Group]) -> Group:
        """Return the group of this ``name`` that an earlier run made of the very same ``parts``,
        or a new one. All arrays but those of the parts are what they were when they were made: what
        follows from the numbers of the parts is for the caller to set.
        """
        known = self._made.get(name)
        if known is not None and _are_same(known[0], parts):
            for array, image in known[1]:
                array[...] = 0 if image is None else image
            return self._groups[name]  # type: ignore[return-value]
        group = make()
        others = {id(one) for one in arrays_in(parts)}
        own = {id(one): one for one in arrays_in(group) if id(one) not in others}
        images = [(one, one.copy() if one.any() else None) for one in own.values()]
        self._made[name] = parts, images
        self._keep(name, group)
        return group

    def _keep(self, name: Hashable, group: tuple[Any, ...]) -> None:
        self._groups[name] = group
        self._doubles.clear()
        arrays = {id(one): one for group in self._groups.values() for one in arrays_in(group)}
        self._owned, self.size = set(arrays), sum(one.nbytes for one in arrays.values())

    def call(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Call a ``kernel`` that a run needs once or twice, with groups of this storage: as plain
        Python in the first runs, compiled in later ones if there is code for it. Both give the same
        digits; to load the code takes as long as some calls do.
        """
        if self.runs <= PLAIN_RUNS or kernel in self._slow:
            return kernel(*arguments)
        fast = compiled_once(kernel)
        if not isinstance(fast, Compiled):
            return fast(*arguments)
        ready = fast.ready(arguments)
        if ready is not None:
            return ready()
        if on_disk([(fast, arguments)]):
            return fast(*arguments)
        self._slow.add(kernel)
        return kernel(*arguments)

    def doubles(self, value: Any) -> list[np.ndarray]:
        """Return the doubles of all arrays in nested tuples of groups, in order: a flat view of
        each array.
        """
        if not isinstance(value, tuple):
            return _flat((value,))
        if not hasattr(value, "_fields"):
            return [array for part in value for array in self.doubles(part)]
        found = self._doubles.get(id(value))
        if found is None:
            found = self._doubles[id(value)] = value, _flat(value)
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
                if id(new) in self._owned or not _same_form(old, new):
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


def _are_same(known: Any, given: Any) -> bool:
    """Return whether nested tuples have the very same arrays, and equal plain numbers."""
    if known is given:
        return True
    if isinstance(given, np.ndarray) or type(known) is not type(given):
        return False
    if not isinstance(given, tuple):
        return _same_number(known, given)
    return len(known) == len(given) and all(map(_are_same, known, given))


def _same_form(kept: Any, fresh: np.ndarray) -> bool:
    return (
        isinstance(kept, np.ndarray)
        and kept.shape == fresh.shape
        and kept.dtype == fresh.dtype
        and (kept.strides == fresh.strides or _order_of(kept) == _order_of(fresh))
    )


def _order_of(array: np.ndarray) -> tuple[bool, bool]:
    """Return in which orders its numbers lie in memory without gaps."""
    return array.flags.c_contiguous, array.flags.f_contiguous


def _same_number(kept: Any, fresh: Any) -> bool:
    """Return whether plain numbers are equal in every bit; nan never is."""
    if type(kept) is not type(fresh):
        return False
    if isinstance(fresh, float) and kept == fresh == 0.0:
        return math.copysign(1.0, kept) == math.copysign(1.0, fresh)
    return bool(kept == fresh)


def _flat(value: Any) -> list[np.ndarray]:
    """Return flat views of the arrays of doubles in nested tuples; numbers of an array that is not
    in the order of its rows come in the order in which they are in memory.
    """
    flat = []
    for array in doubles_in(value):
        rows = array if array.flags.c_contiguous else array.T
        assert rows.flags.c_contiguous, "the flat form of other arrays would be a copy"
        flat.append(rows.reshape(-1))
    return flat


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
