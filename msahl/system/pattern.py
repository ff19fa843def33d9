"""Pattern of the Jacobian: its 3 x 3 blocks by row and column node, as the elements ask for them.

The values of the blocks stand one after the other in one array, 9 each; block 0 takes what belongs
to the ground and is never read.
"""

import numpy as np


class Blocks:
    """The pattern while it grows."""

    def __init__(self, displacement: np.ndarray, rotation: np.ndarray) -> None:
        """Without blocks; the ground's nodes are the last of ``displacement`` and ``rotation``."""
        self.ground = {int(displacement[-1]), int(rotation[-1])}
        self.starts: dict[tuple[int, int], int] = {(-1, -1): 0}
        self.varying: set[int] = set()
        self.diagonal: set[int] = set()

    def place(self, row: int, column: int) -> int:
        """Return where a block starts in the value array, to be set in every step; 0 if it belongs
        to the ground or to no node (-1).
        """
        start = self._start(int(row), int(column))
        self.varying.add(start)
        return start

    def constant(self, row: int, column: int) -> int:
        """Return where a block starts that is always a number times the unit matrix; likewise 0."""
        start = self._start(int(row), int(column))
        self.diagonal.add(start)
        return start

    def _start(self, row: int, column: int) -> int:
        if {row, column} & self.ground or min(row, column) < 0:
            return 0
        return self.starts.setdefault((row, column), 9 * len(self.starts))

    def nodes(self) -> np.ndarray:
        """(m, 2) row and column node of each block."""
        nodes = np.array(list(self.starts), dtype=np.int64)
        nodes[0] = 0
        return nodes

    def pattern(self) -> np.ndarray:
        """(9 m,) which values are not always zero."""
        pattern = np.zeros(9 * len(self.starts), dtype=bool)
        for start in self.diagonal - {0}:
            pattern[start : start + 9 : 4] = True
        for start in self.varying - {0}:
            pattern[start : start + 9] = True
        return pattern
