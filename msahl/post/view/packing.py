"""Pack arrays of numbers into text that ``packing.js`` reads: small, and exact."""

import base64
import zlib
from typing import Any

import numpy as np

from msahl.post.web import packed

ORDERS = (1, 2, 3, 4)
"""Orders of the differences of which the smallest is taken."""


def pack_integers(values: np.ndarray) -> dict[str, Any]:
    """Pack integers (rows, columns) below 2**31: differences along the rows, of the order that
    packs best, whose four bytes stand apart, because those of smooth series are mostly zeros."""
    smallest = min(
        ((order, _planes(values, order)) for order in ORDERS), key=lambda made: len(made[1])
    )
    return {
        "rows": values.shape[0],
        "columns": values.shape[1],
        "order": smallest[0],
        "data": base64.b64encode(smallest[1]).decode(),
    }


def pack_numbers(values: np.ndarray) -> str:
    """Pack doubles."""
    return packed(np.ascontiguousarray(values, dtype="<f8").tobytes())


def _planes(values: np.ndarray, order: int) -> bytes:
    differences = values.astype(np.int64)
    for done in range(min(order, len(values))):
        differences[done + 1 :] = np.diff(differences[done:], axis=0)
    # Small numbers of both signs become small numbers: 0, -1, 1, -2, ... -> 0, 1, 2, 3, ...
    folded = ((differences << 1) ^ (differences >> 63)).T.astype("<u8")
    planes = np.ascontiguousarray(folded).view(np.uint8).reshape(*folded.shape, 8)
    used = 5 if planes[..., 4:].any() else 4
    return zlib.compress(bytes([used]) + np.moveaxis(planes[..., :used], -1, 0).tobytes(), 9)
