"""The Jacobian's pattern of 3 x 3 blocks, while the elements ask for theirs."""

import numpy as np

from msahl.elements.frames import Frames, displacement_node, ground_of, rotation_node


class Blocks:
    """The Jacobian's pattern while it grows: a block's place by its row and column node."""

    def __init__(self, frames: Frames) -> None:
        ground = ground_of(frames)
        self.ground = {displacement_node(frames, ground), rotation_node(frames, ground)}
        self.starts: dict[tuple[int, int], int] = {(-1, -1): 0}
        self.constants: list[tuple[int, float]] = []
        self.varying: set[int] = set()

    def place(self, row: int, column: int) -> int:
        """Start of the block in the value array, to be filled in every step; 0 if it belongs to
        the ground or to nobody.
        """
        start = self._start(int(row), int(column))
        self.varying.add(start)
        return start

    def _start(self, row: int, column: int) -> int:
        if {row, column} & self.ground or min(row, column) < 0:
            return 0
        return self.starts.setdefault((row, column), 9 * len(self.starts))

    def constant(self, row: int, column: int, value: float) -> None:
        """A block ``value`` times the unit matrix."""
        self.constants.append((self._start(row, column), value))

    def nodes(self) -> np.ndarray:
        """(m, 2) row and column node of each block."""
        nodes = np.array(list(self.starts), dtype=np.int64)
        nodes[0] = 0
        return nodes

    def constant_values(self) -> np.ndarray:
        """The value array with nothing but the constant blocks."""
        values = np.zeros(9 * len(self.starts))
        for start, value in self.constants:
            if start:
                values[start : start + 9 : 4] = value
        return values

    def pattern(self) -> np.ndarray:
        """(9 m,) which values are not zero for ever."""
        pattern = self.constant_values() != 0.0
        for start in self.varying - {0}:
            pattern[start : start + 9] = True
        return pattern
