"""Assigns output times to the steps of a chunk: which rows of the tables each step has to fill."""

import numpy as np

from msahl.records import record

ROUND_OFF = 1e-9
"""Fraction of a step within which an output time counts as the end of that step."""


@record(slots=False)
class OutputSchedule:
    """Output rows of a chunk of steps, in the order of time.

    ``due`` (steps + 1,) counts the rows up to each step's end, from 0; ``share`` (rows,) is the
    position of each row within its step as a fraction of it: 1 is the end of the step.
    """

    due: np.ndarray
    share: np.ndarray

    @classmethod
    def at_ends(cls, shown: np.ndarray) -> "OutputSchedule":
        """One row at the end of each step that is ``shown`` (steps,)."""
        due = np.concatenate([[0], np.cumsum(shown)])
        return cls(due, np.ones(int(due[-1])))

    @classmethod
    def passed(cls, times: np.ndarray, begin: float, ends: np.ndarray) -> "OutputSchedule":
        """One row at each of the ``times`` that steps from ``begin`` to the ``ends`` (steps,)
        have passed.
        """
        sizes = np.diff(ends, prepend=begin)
        step = np.minimum(np.searchsorted(ends + ROUND_OFF * sizes, times), len(ends) - 1)
        share = (times - (ends - sizes)[step]) / sizes[step]
        share[share > 1.0 - ROUND_OFF] = 1.0
        return cls(np.searchsorted(step, np.arange(len(ends) + 1)), share)

    def until(self, steps: int) -> "OutputSchedule":
        """The rows of the first ``steps`` steps."""
        due = self.due[: steps + 1]
        return OutputSchedule(due, self.share[: due[-1]])

    def part(self, step: int, begin: float, end: float) -> "OutputSchedule":
        """The rows from the fraction ``begin`` to ``end`` of a ``step``, as if this part were the
        step.
        """
        due = self.due.copy()
        rows = self.share[due[step] : due[step + 1]]
        due[step : step + 2] = due[step] + np.searchsorted(rows, [begin, end], "right")
        share = (self.share - begin) / (end - begin)
        share[share > 1.0 - ROUND_OFF] = 1.0
        return OutputSchedule(due, share)

    @property
    def steps(self) -> int:
        """Number of steps of the chunk."""
        return len(self.due) - 1

    @property
    def between(self) -> np.ndarray:
        """The rows that are at no step's end."""
        return np.flatnonzero(self.share[: self.due[-1]] < 1.0)

    def ends(self) -> np.ndarray:
        """(steps,) the row at each step's end, -1 where there is none."""
        last = self.due[1:] - 1
        shown = np.diff(self.due) > 0
        shown[shown] = self.share[last[shown]] == 1.0
        return np.where(shown, last, -1)

    def halves(self) -> "OutputSchedule":
        """The same rows for twice as many steps of half the size."""
        step = np.repeat(np.arange(self.steps), np.diff(self.due))
        half = 2 * step + (self.share > 0.5)
        due = np.searchsorted(half, np.arange(2 * self.steps + 1))
        return OutputSchedule(due, 2.0 * self.share - (self.share > 0.5))

    def both_halves(self) -> "OutputSchedule":
        """Rows for twice as many steps of half the size, with two rows for each row at a step's
        end: at the middle and at the end of that step.
        """
        return OutputSchedule.at_ends(np.repeat(np.diff(self.due) > 0, 2))


NO_OUTPUT = OutputSchedule(np.zeros(1, dtype=np.int64), np.zeros(0))
"""The schedule of a chunk without output times."""
