"""Errors that last: what differs at one output time only, where a value jumps, does not count.

Run and companion may differ at one time by all of a jump, though they only jump a little before and
after it. The median of the errors at three output times in succession does not know that one.
"""

import numpy as np


class Lasting:
    """The medians of errors at three output times in succession, as they come in."""

    def __init__(self, count: int) -> None:
        self.last = np.zeros((2, count))
        """Errors at the last two output times; before t = 0 there are none."""

    def add(self, errors: np.ndarray) -> np.ndarray:
        """Add ``errors`` (m, count); return their medians (m, count)."""
        every = np.concatenate([self.last, errors])
        self.last = every[-2:]
        return np.median(np.stack([every[:-2], every[1:-1], every[2:]]), axis=0)
