"""Entries of matrices by node and component, and the sparse matrices of them."""

from array import array
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import MOST_EQUATIONS, Matrices
from msahl.reduction.faults import ReductionError


@dataclass(slots=True)
class Entries:
    """Entries of a matrix: rows and columns as 8 label + component, and values."""

    rows: "array[int]" = field(default_factory=lambda: array("q"))
    columns: "array[int]" = field(default_factory=lambda: array("q"))
    values: "array[float]" = field(default_factory=lambda: array("d"))

    def add(self, row: tuple[int, int], column: tuple[int, int], value: float) -> None:
        """Add an entry by label and component, from 0, of its row and column."""
        self.rows.append(8 * row[0] + row[1])
        self.columns.append(8 * column[0] + column[1])
        self.values.append(value)


def assembled(source: str, given: Mapping[str, Entries]) -> Matrices:
    """Return the matrices of the entries of "mass", "stiffness" and, if there is one, "damping"."""
    sides = [side for one in given.values() for side in (one.rows, one.columns)]
    keys = [np.frombuffer(side, np.int64) for side in sides if len(side)]
    rows = np.unique(np.concatenate(keys)) if keys else np.zeros(0, np.int64)
    if not 0 < len(rows) <= MOST_EQUATIONS:
        raise ReductionError(
            source, f"{len(rows)} degrees of freedom; from 1 to {MOST_EQUATIONS} are accepted"
        )
    matrices = {what: _matrix(rows, one) for what, one in given.items()}
    return Matrices(
        rows // 8, rows % 8, matrices["mass"], matrices["stiffness"], matrices.get("damping")
    )


def _matrix(rows: np.ndarray, one: Entries) -> sparse.csr_array:
    values = np.frombuffer(one.values) if len(one.values) else np.zeros(0)
    i, j = (
        np.searchsorted(rows, np.frombuffer(side, np.int64)) if len(side) else np.zeros(0, np.int64)
        for side in (one.rows, one.columns)
    )  # fmt: skip
    return mirrored(sparse.csr_array(sparse.coo_array((values, (i, j)), shape=(len(rows),) * 2)))


def mirrored(A: sparse.csr_array) -> sparse.csr_array:
    """Return a matrix of which some entries are written on one side of the diagonal alone, with
    these on both sides."""
    A = sparse.csr_array(A)
    A.sum_duplicates()
    pattern = sparse.csr_array((np.ones(A.nnz), A.indices, A.indptr), shape=A.shape)
    alone = sparse.csr_array(pattern - pattern.multiply(pattern.T))
    alone.eliminate_zeros()
    return sparse.csr_array(A + sparse.csr_array(A.multiply(alone)).T)
