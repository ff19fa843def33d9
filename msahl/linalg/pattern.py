"""Pattern of the Jacobian: its 3 x 3 blocks by row and column node.

The values of the blocks stand one after the other in one array, 9 each; block 0 takes what belongs
to the ground and is never read.
"""

from typing import NamedTuple

import numpy as np

SIZE = 9
"""Values of a block."""


class Pattern(NamedTuple):
    """Which entries of a matrix of m - 1 blocks are not always zero; block 0 is not one of it."""

    nodes: int  # rows and columns of the matrix by three
    blocks: np.ndarray  # (m, 2) row node and column node of each block
    entries: np.ndarray  # (9 m,) which values of the blocks are not zero for ever


class Blocks:
    """The pattern while elements ask for blocks, which are numbered in the order of asking."""

    def __init__(self, displacement: np.ndarray, rotation: np.ndarray) -> None:
        """Without blocks; the ground's nodes are the last of ``displacement`` and ``rotation``."""
        self.ground = np.array([displacement[-1], rotation[-1]])
        self._known = np.zeros(0, dtype=np.int64)  # sorted; row and column as one number
        self._number = np.zeros(0, dtype=np.int64)  # of each known block, from 1 on
        self._varying: list[np.ndarray] = []
        self._diagonal: list[np.ndarray] = []

    def place(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return where blocks start in the value array, to be set in every step; 0 of those that
        belong to the ground or to no node (-1). Rows and columns are broadcast.
        """
        start = self._start(rows, columns)
        self._varying.append(start.reshape(-1))
        return start

    def place_some(self, rows: np.ndarray, columns: np.ndarray, kept: np.ndarray) -> np.ndarray:
        """Do as ``place``; only the blocks ``kept`` enter the pattern, the others are zero until
        what they belong to is active (``system.graph.pattern_of``).
        """
        start = self._start(rows, columns)
        self._varying.append(start[np.broadcast_to(kept, start.shape)])
        return start

    def constant(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Return where blocks start that are always numbers times the unit matrix; likewise 0."""
        start = self._start(rows, columns)
        self._diagonal.append(start.reshape(-1))
        return start

    def mixed(self, rows: np.ndarray, columns: np.ndarray, varying: np.ndarray) -> np.ndarray:
        """Return where blocks start of which those ``varying`` are set in every step."""
        start = self._start(rows, columns)
        self._varying.append(start[np.broadcast_to(varying, start.shape)])
        self._diagonal.append(start[~np.broadcast_to(varying, start.shape)])
        return start

    def _start(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        rows, columns = np.broadcast_arrays(rows, columns)
        exists = (np.minimum(rows, columns) >= 0) & ~np.isin([rows, columns], self.ground).any(0)
        start = np.zeros(rows.shape, dtype=np.int64)
        start[exists] = SIZE * self._numbers((rows[exists] << 32) + columns[exists])
        return start

    def _numbers(self, keys: np.ndarray) -> np.ndarray:
        """Return the numbers of blocks; new ones are numbered as they come."""
        unique, first, place = np.unique(keys, return_index=True, return_inverse=True)
        new = ~np.isin(unique, self._known, assume_unique=True)
        number = np.zeros(unique.size, dtype=np.int64)
        number[np.flatnonzero(new)[np.argsort(first[new])]] = (
            self._known.size + 1 + np.arange(np.count_nonzero(new))
        )
        number[~new] = self._number[np.searchsorted(self._known, unique[~new])]
        known = np.concatenate([self._known, unique[new]])
        order = np.argsort(known, kind="stable")
        self._known = known[order]
        self._number = np.concatenate([self._number, number[new]])[order]
        numbers: np.ndarray = number[place.reshape(-1)]
        return numbers

    def nodes(self) -> np.ndarray:
        """(m, 2) row and column node of each block."""
        nodes = np.zeros((1 + self._known.size, 2), dtype=np.int64)
        nodes[self._number, 0] = self._known >> 32
        nodes[self._number, 1] = self._known & (2**32 - 1)
        return nodes

    def pattern(self) -> np.ndarray:
        """(9 m,) which values are not always zero."""
        pattern = np.zeros((1 + self._known.size, SIZE), dtype=bool)
        none = np.zeros(0, dtype=np.int64)
        pattern[np.concatenate([none, *self._diagonal]) // SIZE, ::4] = True
        pattern[np.concatenate([none, *self._varying]) // SIZE] = True
        pattern[0] = False
        return pattern.reshape(-1)
