"""Arrays of ``.npz`` files, read safely: no objects, no more memory than the file announces."""

import zipfile
import zlib
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.lib import format as npy

from msahl.input_files import open_input
from msahl.reduction.faults import ReductionError, shown

MOST_BYTES = 2**32
"""Of all arrays of a file, unpacked."""
MOST_ARRAYS = 100
DAMAGED = (
    *(ValueError, SyntaxError, EOFError, NotImplementedError, RuntimeError, KeyError),
    *(zipfile.BadZipFile, zlib.error),
)
"""What reading a damaged archive, or a header of numpy, raises."""
MOST_DIMENSIONS = 4


def read_arrays(path: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a file by name, of numbers or text; raises ``ReductionError``."""
    try:
        with open_input(path) as stream:
            return arrays_of(str(path), stream)
    except OSError as error:
        raise ReductionError(str(path), f"cannot be read: {error.strerror or error}") from error


def arrays_of(name: str, stream: BinaryIO) -> dict[str, np.ndarray]:
    """Return the arrays of an open file, which messages call ``name``, likewise."""
    try:
        with zipfile.ZipFile(stream) as archive:
            entries = archive.infolist()
            _require_small(name, entries)
            return {one.filename.removesuffix(".npy"): _array(archive, one) for one in entries}
    except DAMAGED as error:
        reason = shown(str(error)) or "it is damaged"
        raise ReductionError(name, f"is no .npz of numbers: {reason}") from error


def _require_small(name: str, entries: list[zipfile.ZipInfo]) -> None:
    size = sum(one.file_size for one in entries)
    if len(entries) > MOST_ARRAYS or size > MOST_BYTES:
        raise ReductionError(
            name, f"it has {len(entries)} arrays of {size} bytes; {MOST_BYTES} are accepted"
        )


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo) -> np.ndarray:
    """Return one array, whose header is compared with the size that it has."""
    with archive.open(entry) as stream:
        version = npy.read_magic(stream)
        header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, by_columns, kind = header(stream)
        if kind.kind not in "biufU" or len(shape) > MOST_DIMENSIONS:
            raise ValueError(f"{entry.filename} has no numbers")
        count = int(np.prod(shape, dtype=object)) if shape else 1
        size = count * kind.itemsize
        if size > entry.file_size:
            raise ValueError(f"{entry.filename} is shorter than its header says")
        data = stream.read(size)
    if len(data) < size:
        raise ValueError(f"{entry.filename} is shorter than its header says")
    array = np.frombuffer(data, kind, count) if size else np.zeros(count, kind)
    return array.reshape(shape, order="F" if by_columns else "C")
