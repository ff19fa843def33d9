"""Files of SDF that include others: models in files below the folder of the main one.

A ``<uri>`` names a file, or a folder with a file model.sdf, with ``model://`` or without, in the
folder of the main file, that of the including one, or one that the user gives. Depth, number
and size are bounded.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

from msahl.deck.faults import DeckError, Element, Faults
from msahl.deck.parse import parse, read_bytes
from msahl.importers.meshes import below
from msahl.importers.mjcf_files import FOREIGN_ATTRIBUTES, MOST_BYTES, MOST_FILES
from msahl.importers.reading import Log
from msahl.importers.sdf_values import text_of

ROOT = "sdf"
MODEL_FILE = "model.sdf"
DEEPEST = 32
"""Models within models."""


@dataclass
class SdfFiles:
    """Included files: the ``folders`` in which they lie, how many there are and their size."""

    folders: Sequence[Path]
    count: int = 0
    size: int = 0
    open: list[Path] = field(default_factory=list)
    """Files that include one another, the main one first."""


def included(element: Element, files: SdfFiles, log: Log) -> Element | None:
    """Return the root of the file that an ``<include>`` names, which is pushed to those that are
    open; None with a fault."""
    uri = text_of(element, "uri")
    path = _find(uri, files)
    if path is None:
        log.fault(
            element, f"'{uri[:100]}' is no file, nor a folder with {MODEL_FILE}, below the folder "
            "of this one; give its folder by --packages",
        )  # fmt: skip
        return None
    if path in files.open or len(files.open) > DEEPEST:
        log.fault(element, f"'{uri[:100]}' includes itself, through others; delete one of these")
        return None
    faults = Faults(str(path))
    try:
        data = read_bytes(path, faults)
        files.count, files.size = files.count + 1, files.size + len(data)
        if files.count > MOST_FILES or files.size > MOST_BYTES:
            log.stop(element, f"more than {MOST_FILES} files or {MOST_BYTES // 2**20} MiB")
        root = parse(data, faults, (ROOT,), FOREIGN_ATTRIBUTES)
    except DeckError as error:
        if log.faults and error.faults[-1] is log.faults[-1]:
            raise
        log.faults += error.faults
        return None
    log.origins[root] = str(path)
    files.open.append(path)
    return root


def _find(uri: str, files: SdfFiles) -> Path | None:
    """Return the file that a ``<uri>`` means; None if there is none below the folders."""
    name = uri.removeprefix("model://").removeprefix("file://")
    parts = PurePosixPath(name).parts
    if "://" in name or not parts or not name.isprintable() or PurePosixPath(name).is_absolute():
        return None
    beside = files.open[-1].parent
    for start, folder in ((beside, files.folders[0]), *((one, one) for one in files.folders)):
        for ending in ((), (MODEL_FILE,)):
            found = below(start.joinpath(*parts, *ending), folder)
            if found is not None:
                return found
    return None
