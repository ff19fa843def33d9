"""Which rows of results a chunk of steps is to leave."""

from dataclasses import dataclass

import numpy as np

ROUND_OFF = 1e-9
"""Part of a step by which rows and ends that are meant to be at one time may differ."""


@dataclass(frozen=True)
class OutputSchedule:
    """Rows of a chunk of equal steps, in the order of time.

    ``due`` (steps + 1,) counts the rows up to each step's end, from 0; ``share`` (rows,) says where
    in its step each one stands, in parts of it: 1 is its end.
    """

    due: np.ndarray
    share: np.ndarray

    @classmethod
    def at_ends(cls, shown: np.ndarray) -> "OutputSchedule":
        """Rows at the ends of those steps that are ``shown`` (steps,)."""
        due = np.concatenate([[0], np.cumsum(shown)])
        return cls(due, np.ones(int(due[-1])))

    @classmethod
    def passed(cls, times: np.ndarray, begin: float, ends: np.ndarray) -> "OutputSchedule":
        """Rows at the ``times`` that steps from ``begin`` to the ``ends`` (steps,) have passed."""
        sizes = np.diff(ends, prepend=begin)
        step = np.minimum(np.searchsorted(ends + ROUND_OFF * sizes, times), len(ends) - 1)
        share = (times - (ends - sizes)[step]) / sizes[step]
        share[share > 1.0 - ROUND_OFF] = 1.0
        return cls(np.searchsorted(step, np.arange(len(ends) + 1)), share)

    def until(self, steps: int) -> "OutputSchedule":
        """The rows of the first ``steps``."""
        due = self.due[: steps + 1]
        return OutputSchedule(due, self.share[: due[-1]])

    @property
    def steps(self) -> int:
        """How many steps the chunk has."""
        return len(self.due) - 1

    def ends(self) -> np.ndarray:
        """(steps,) the row at each step's end, -1 where there is none."""
        last = self.due[1:] - 1
        shown = np.diff(self.due) > 0
        shown[shown] = self.share[last[shown]] == 1.0
        return np.where(shown, last, -1)

    def halves(self) -> "OutputSchedule":
        """The same rows, of twice as many steps of half the size."""
        step = np.repeat(np.arange(self.steps), np.diff(self.due))
        half = 2 * step + (self.share > 0.5)
        due = np.searchsorted(half, np.arange(2 * self.steps + 1))
        return OutputSchedule(due, 2.0 * self.share - (self.share > 0.5))

    def both_halves(self) -> "OutputSchedule":
        """Two rows for each row at a step's end, of twice as many steps of half the size: at the
        middle and at the end of that step.
        """
        return OutputSchedule.at_ends(np.repeat(np.diff(self.due) > 0, 2))
