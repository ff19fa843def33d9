"""Elastic models of ``.npz`` files.

nodes (n, 3)            places [m]
labels (n,)             numbers of the nodes; by default 1 to n
dofs (m, 2)             label and component (1 to 6) of each row; by default three or six of each
                        node, in the order of nodes
mass, stiffness (m, m)  matrices; or of each, such as of the mass, the entries mass_rows,
                        mass_columns (from 0) and mass_values, on both sides of the diagonal or
                        on one
damping                 likewise, may be missing
interface               labels of the interface nodes, may be missing
"""

from pathlib import Path

import numpy as np
from scipy import sparse

from msahl.reduction.arrays import read_arrays
from msahl.reduction.elastic_model import MOST_EQUATIONS, Matrices, Nodes
from msahl.reduction.entries import mirrored
from msahl.reduction.faults import ReductionError, shown

PARTS = ("rows", "columns", "values")
MATRICES = ("mass", "stiffness", "damping")
KEYS = {"nodes", "labels", "dofs", "interface", *MATRICES} | {
    f"{what}_{part}" for what in MATRICES for part in PARTS
}


def read_npz(path: Path) -> tuple[Nodes, Matrices, tuple[int, ...]]:
    """Return nodes, matrices and interface of a file; raises ``ReductionError``."""
    arrays = read_arrays(path)
    strange = sorted(set(arrays) - KEYS)
    if strange:
        raise ReductionError(
            str(path), f"array '{shown(strange[0])}' is none of an elastic model: {sorted(KEYS)}"
        )
    nodes = _numbers(path, arrays, "nodes", (None, 3), float)
    count = len(nodes)
    default = np.arange(1, count + 1)
    labels = _numbers(path, arrays, "labels", (count,), int) if "labels" in arrays else default
    size = _size(path, arrays, count)
    dofs = (
        _numbers(path, arrays, "dofs", (size, 2), int)
        if "dofs" in arrays
        else _all_components(path, labels, size)
    )
    if not np.isin(dofs[:, 1], range(1, 7)).all():
        raise ReductionError(str(path), "dofs: components (second column) are from 1 to 6")
    mass, stiffness = _matrix(path, arrays, "mass", size), _matrix(path, arrays, "stiffness", size)
    has_damping = "damping" in arrays or "damping_values" in arrays
    damping = _matrix(path, arrays, "damping", size) if has_damping else None
    interface = (
        _numbers(path, arrays, "interface", (None,), int) if "interface" in arrays else np.zeros(0)
    )
    return (
        Nodes(labels, nodes),
        Matrices(dofs[:, 0], dofs[:, 1] - 1, mass, stiffness, damping),
        tuple(int(label) for label in interface),
    )


def _size(path: Path, arrays: dict[str, np.ndarray], count: int) -> int:
    """Return the number of rows: of ``dofs``, of a dense stiffness, or by the largest entry."""
    if "dofs" in arrays:
        return int(np.shape(arrays["dofs"])[0]) if np.ndim(arrays["dofs"]) else 0
    if "stiffness" in arrays:
        return int(np.shape(arrays["stiffness"])[0]) if np.ndim(arrays["stiffness"]) else 0
    largest = _numbers(path, arrays, "stiffness_rows", (None,), int).max(initial=-1) + 1
    return 3 * count if largest <= 3 * count else 6 * count


def _all_components(path: Path, labels: np.ndarray, size: int) -> np.ndarray:
    count = len(labels)
    if count == 0 or size not in (3 * count, 6 * count):
        raise ReductionError(
            str(path), f"{size} rows for {count} nodes; without 'dofs' each node has three or six"
        )
    each = size // count
    return np.column_stack([np.repeat(labels, each), np.tile(np.arange(1, each + 1), count)])


def _numbers(
    path: Path, arrays: dict[str, np.ndarray], name: str, shape: tuple[int | None, ...], kind: type
) -> np.ndarray:
    """Return an array of this shape (None: any number)."""
    if name not in arrays:
        raise ReductionError(str(path), f"there is no array '{name}'; an elastic model has it")
    array = arrays[name]
    fits = array.ndim == len(shape) and all(
        want in (None, have) for want, have in zip(shape, array.shape, strict=True)
    )
    if not fits or array.dtype.kind not in ("iu" if kind is int else "fiu"):
        expected = "(" + ", ".join("any" if n is None else str(n) for n in shape) + ")"
        what = "whole numbers" if kind is int else "numbers"
        raise ReductionError(
            str(path), f"{name} is {array.dtype.name} {array.shape}; expected {what} {expected}"
        )
    return array.astype(np.int64 if kind is int else float)


def _matrix(path: Path, arrays: dict[str, np.ndarray], what: str, size: int) -> sparse.csr_array:
    """Return a matrix (size, size), given densely or by its entries."""
    if what in arrays:
        return sparse.csr_array(_numbers(path, arrays, what, (size, size), float))
    values = _numbers(path, arrays, f"{what}_values", (None,), float)
    count = (len(values),)
    rows, columns = (_numbers(path, arrays, f"{what}_{part}", count, int) for part in PARTS[:2])
    if size > MOST_EQUATIONS or not all(
        ((side >= 0) & (side < size)).all() for side in (rows, columns)
    ):
        raise ReductionError(
            str(path), f"{what}_rows and {what}_columns are from 0 to {size - 1}, the last row"
        )
    return mirrored(
        sparse.csr_array(sparse.coo_array((values, (rows, columns)), shape=(size, size)))
    )
