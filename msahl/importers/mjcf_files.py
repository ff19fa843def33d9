"""Files of MJCF that include others: each ``<include>`` is replaced by what the file contains.

Files lie below the folder of the main one, or below those that the user gives; no file is included
twice. Depth, number and size are bounded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from msahl.deck.faults import DeckError, Element, Faults, attribute
from msahl.deck.parse import parse, read_bytes
from msahl.importers.meshes import below
from msahl.importers.reading import Log

ROOTS = ("mujoco", "mujocoinclude")
FOREIGN_ATTRIBUTES = 64
"""Attributes accepted in an element of a foreign file: joints of MJCF have up to 26."""
MOST_FILES = 200
MOST_BYTES = 64 * 2**20
"""Size of all included files."""


@dataclass
class _Included:
    """Files that are included so far, and their size."""

    folders: Sequence[Path]
    files: set[Path] = field(default_factory=set)
    size: int = 0


def merge_includes(root: Element, path: Path, packages: Sequence[Path], log: Log) -> None:
    """Replace every ``<include>`` in the tree of the file at ``path``; what cannot be read is a
    fault."""
    done = _Included((path.parent, *packages), {path.resolve()})
    waiting = list(root.iter("include"))
    for include in waiting:
        found = _read(include, done, log)
        if found is None:
            continue
        part, file = found
        holder = include.getparent()
        assert holder is not None  # the root is no include
        place = holder.index(include)
        children = list(part)
        waiting += [e for child in children for e in child.iter("include")]
        for child in children:
            log.origins[child] = str(file)
        holder[place : place + 1] = children


def _read(include: Element, done: _Included, log: Log) -> tuple[Element, Path] | None:
    """Return the root of a file that is included, and its path."""
    name = attribute(include, "file")
    places = (below(folder / name, folder) for folder in done.folders) if name else ()
    file = next((place for place in places if place is not None), None)
    if file is None:
        message = f"'{name}' is no file below the folder of this one; give its folder by --packages"
        log.fault(include, message)
        return None
    if file in done.files:
        log.fault(include, f"'{name}' is included twice, or includes itself; delete one of these")
        return None
    done.files.add(file)
    faults = Faults(str(file))
    try:
        data = read_bytes(file, faults)
        done.size += len(data)
        if len(done.files) > MOST_FILES or done.size > MOST_BYTES:
            log.stop(include, f"more than {MOST_FILES} files or {MOST_BYTES // 2**20} MiB")
        return parse(data, faults, ROOTS, FOREIGN_ATTRIBUTES), file
    except DeckError as error:
        if log.faults and error.faults[-1] is log.faults[-1]:
            raise
        log.faults += error.faults
        return None
