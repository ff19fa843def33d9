"""Pack numbers and their description into a GLB file, the binary form of glTF 2.0."""

import json
import struct
from typing import Any

import numpy as np

FLOAT, SHORT, INT = 5126, 5123, 5125
"""glTF's numbers of the types of components: float32, uint16, uint32."""
VERTICES, INDICES = 34962, 34963
JOINTS = -1
"""Stands for vertices whose numbers are those of joints of a skin, as unsigned integers."""
"""glTF's numbers of what a view of the buffer is for."""
TYPES = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
MAGIC, VERSION, JSON_CHUNK, BINARY_CHUNK = 0x46546C67, 2, 0x4E4F534A, 0x004E4942


class Numbers:
    """The buffer of a file: arrays one behind the other, each with its accessor."""

    def __init__(self) -> None:
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self._pieces: list[bytes] = []
        self._size = 0

    def add(self, values: np.ndarray, target: int | None = None, bounds: bool = False) -> int:
        """Add an array (n,) or (n, k) as float32, or as unsigned integers for ``INDICES``; return
        the index of its accessor. ``bounds`` states the least and greatest values."""
        if target == INDICES:
            kind, form = (SHORT, "<u2") if values.max() < 0xFFFF else (INT, "<u4")
        elif target == JOINTS:
            kind, form, target = SHORT, "<u2", VERTICES
        else:
            kind, form = FLOAT, "<f4"
        data = np.ascontiguousarray(values, form)
        view: dict[str, Any] = {"buffer": 0, "byteOffset": self._size, "byteLength": data.nbytes}
        if target is not None:
            view["target"] = target
        width = 1 if data.ndim == 1 else data.shape[1]
        accessor = {
            "bufferView": len(self.views),
            "componentType": kind,
            "count": len(data),
            "type": TYPES[width],
        }
        if bounds:
            table = data.reshape(len(data), width)
            accessor |= {"min": table.min(axis=0).tolist(), "max": table.max(axis=0).tolist()}
        self.views.append(view)
        self.accessors.append(accessor)
        self._append(data.tobytes())
        return len(self.accessors) - 1

    def _append(self, data: bytes) -> None:
        padded = data + b"\0" * (-len(data) % 4)
        self._pieces.append(padded)
        self._size += len(padded)

    @property
    def data(self) -> bytes:
        """The bytes of the buffer."""
        return b"".join(self._pieces)


def glb(document: dict[str, Any], numbers: Numbers) -> bytes:
    """Return the bytes of a GLB file of a glTF ``document`` without its buffer, and ``numbers``."""
    data = numbers.data
    complete = document | {
        "buffers": [{"byteLength": len(data)}],
        "bufferViews": numbers.views,
        "accessors": numbers.accessors,
    }
    text = json.dumps(complete, allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = [
        struct.pack("<II", len(text), JSON_CHUNK) + text,
        struct.pack("<II", len(data), BINARY_CHUNK) + data,
    ]
    size = 12 + sum(map(len, chunks))
    return struct.pack("<III", MAGIC, VERSION, size) + b"".join(chunks)
