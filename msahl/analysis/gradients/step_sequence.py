"""The steps that a run took, with the output times in each of them."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from msahl.events.margins import AT_ENDS
from msahl.run.companion import Steps
from msahl.schemes.output_schedule import OutputSchedule

MERGED = 1e-3
"""Fraction of a margin's change by which merged steps may miss its level, by their errors."""
SAME_SIZE = 1e-6
"""Relative difference of the sizes of two steps that count as equal."""


class Step(NamedTuple):
    """A step of ``size`` [s], by polynomials of a ``degree`` (0 of order 2), with the numbers of
    the output ``rows`` in it and their times as fractions of the step, ``shares``; ``is_part`` of a
    step that is divided at its end. A margin at its end is at a level if it is ``near``, a fraction
    of its change."""

    size: float
    degree: int
    rows: tuple[int, ...]
    shares: tuple[float, ...]
    is_part: bool = False
    near: float = AT_ENDS


@dataclass
class StepRecord:
    """Receives the accepted steps of a run; the row at t = 0 has the number 0."""

    steps: list[Step] = field(default_factory=list)
    times: list[float] = field(default_factory=lambda: [0.0])
    complete: bool = True  # whether the run began at t = 0

    def add(self, steps: Steps, schedule: OutputSchedule, times: np.ndarray, degree: int) -> None:
        """Add the ``steps`` of a chunk, each part that ends at an event as one; a chunk that begins
        at t = 0 begins the run anew.
        """
        if steps.begin == 0.0:
            self.steps, self.times, self.complete = [], [0.0], True
        elif not self.steps:
            self.complete = False
        first = len(self.times)
        for k, size in enumerate(steps.sizes):
            due = slice(int(schedule.due[k]), int(schedule.due[k + 1]))
            rows, share, begin = first + np.arange(due.start, due.stop), schedule.share[due], 0.0
            for end in (*steps.parts.get(k, ()), 1.0):
                kept, h = (share > begin) & (share <= end), end - begin
                shares = tuple(((share[kept] - begin) / h).tolist())
                own = tuple(rows[kept].tolist())
                self.steps.append(Step(float(size) * h, degree, own, shares, end < 1.0))
                begin = end
        self.times += times.tolist()


def of_rows(steps: Sequence[Step], wanted: set[int]) -> list[Step]:
    """Return the steps with the ``wanted`` rows only."""
    found = []
    for step in steps:
        kept = [(row, s) for row, s in zip(step.rows, step.shares, strict=True) if row in wanted]
        rows, shares = tuple(row for row, _ in kept), tuple(share for _, share in kept)
        found.append(step._replace(rows=rows, shares=shares))
    return found


def after(step: Step, share: float) -> Step:
    """Return the rest of a ``step`` after a ``share`` of it that has no rows."""
    shares = tuple((s - share) / (1.0 - share) for s in step.shares)
    return step._replace(size=(1.0 - share) * step.size, shares=shares)


def merged(steps: Sequence[Step]) -> list[Step]:
    """Return steps of twice the size, where two of equal size and degree follow each other; of
    order 2 they have the rows at their ends only.
    """
    found: list[Step] = []
    k = 0
    while k < len(steps):
        pair = steps[k : k + 2]
        same = len(pair) == 2 and abs(pair[1].size - pair[0].size) <= SAME_SIZE * pair[0].size
        if same and pair[0].degree == pair[1].degree and not pair[0].is_part:
            found.append(_merged(*pair))
            k += 2
        else:
            found.append(pair[0]._replace(near=MERGED))
            k += 1
    return found


def _merged(first: Step, second: Step) -> Step:
    rows = (*first.rows, *second.rows)
    shares = (*(0.5 * s for s in first.shares), *(0.5 + 0.5 * s for s in second.shares))
    if not first.degree:
        kept = [k for k, share in enumerate(shares) if share == 1.0]
        rows, shares = tuple(rows[k] for k in kept), tuple(shares[k] for k in kept)
    return Step(first.size + second.size, first.degree, rows, shares, second.is_part, MERGED)


def undivided(steps: Sequence[Step]) -> list[Step]:
    """Return the steps with all parts of each that is divided as one step again."""
    found: list[Step] = []
    parts: list[Step] = []
    for step in steps:
        parts.append(step)
        if not step.is_part:
            found.append(_joined(parts))
            parts = []
    return found + parts


def _joined(parts: Sequence[Step]) -> Step:
    if len(parts) == 1:
        return parts[0]
    ends = np.cumsum([part.size for part in parts])
    rows = tuple(row for part in parts for row in part.rows)
    shares = tuple(
        float((end - part.size * (1.0 - share)) / ends[-1])
        for part, end in zip(parts, ends, strict=True)
        for share in part.shares
    )
    return Step(float(ends[-1]), parts[0].degree, rows, shares)


def halved(steps: Sequence[Step]) -> list[Step]:
    """Return the two halves of each step."""
    found = []
    for step in steps:
        for half in range(2):
            kept = [k for k, share in enumerate(step.shares) if (share > 0.5) == bool(half)]
            rows = tuple(step.rows[k] for k in kept)
            shares = tuple(2.0 * step.shares[k] - half for k in kept)
            found.append(Step(0.5 * step.size, step.degree, rows, shares))
    return found
