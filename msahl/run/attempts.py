"""Runs to a global tolerance: run, compare, and run again with smaller steps if that is needed.

A run by a local tolerance keeps the sum of its steps' own errors below it; what the motion makes of
these errors is found by a companion (``msahl.error_estimate``). The error goes with the local
tolerance, so where it is too large the next run has

    local tolerance  <-  AIM local tolerance (global tolerance / estimated error)

A first companion at half the step often is good enough to judge the second run as well.
"""

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.model import Model, order_of, tolerance_of
from msahl.run.error_estimate import ErrorEstimate, Known, Rows

if TYPE_CHECKING:
    from msahl.run.loop import Report

FIRST_SHARE = 0.5
"""Part of the global tolerance that the steps' own errors may add up to at first."""
AIM = 0.2
"""Part of the tolerance that a further run aims at."""
MOST_RUNS = 4
HELPS = 0.5
"""A further run whose error is above this part of the last one's shows that smaller steps do not
help: the motion amplifies round-off."""
FINEST = 1e-14
"""Smallest local tolerance, as a part of the model's size."""
KNOWN_SHARE = 0.1
"""Part of the tolerance up to which the error of an earlier companion lets it serve again."""
KNOWN_NUMBERS = 4_000_000
"""Most numbers of an earlier companion that are kept in memory."""


class Attempts:
    """The runs of ``model`` to its global tolerance ``goal`` [m]: those ``made``, the ``local``
    tolerance [m] of the present one, and rows ``known`` from an earlier companion, if they serve.
    """

    def __init__(self, model: Model) -> None:
        goal = tolerance_of(model)
        assert goal is not None
        self.goal, self.local = goal, FIRST_SHARE * goal
        self.order = order_of(model)
        self.made: list[dict[str, float]] = []
        self.known: Known | None = None
        self.seconds: dict[str, float] = {}

    def enter(self, report: "Report", estimate: ErrorEstimate) -> None:
        """Take in a run that has ended; its report tells of all of them."""
        made = {"localTolerance": self.local, "steps": report.steps, "error": estimate.error}
        self.made.append(made)
        assert report.step_control is not None
        report.step_control |= {"tolerance": self.goal, "runs": self.made}
        degrees = [int(chosen["degree"]) for chosen in report.step_control["degrees"]]
        self.order = 2 * min(degrees) if degrees else self.order
        for phase, seconds in self.seconds.items():
            report.seconds[phase] = report.seconds.get(phase, 0.0) + seconds
        self.seconds = dict(report.seconds)

    def goes_on(self, estimate: ErrorEstimate | None, size: float) -> bool:
        """Whether another run is to be made of a model of this ``size`` [m]; gets it ready."""
        if estimate is None or estimate.stopped or estimate.error <= self.goal:
            return False
        error, finest = estimate.error, FINEST * size
        helps = len(self.made) < 2 or error <= HELPS * self.made[-2]["error"]
        if not helps or len(self.made) == MOST_RUNS or self.local <= finest:
            return False
        self.local = max(AIM * self.local * self.goal / error, finest)
        # At half the step an error is 2^-order of itself.
        good = error * 0.5**self.order <= KNOWN_SHARE * self.goal
        self.known = estimate.known() if good and estimate.kept is not None else None
        return True

    def as_numbers(self) -> dict[str, Any]:
        """For a snapshot, what JSON can hold."""
        rows = self.known.rows if self.known else []
        shapes = [[list(table.shape) for table in tables] for tables in rows]
        given = self.known.first if self.known else 0
        return {"made": list(self.made), "local": self.local, "known": shapes, "given": given}

    def memory(self) -> np.ndarray:
        """For a snapshot, the rest (m,)."""
        rows = self.known.rows if self.known else []
        return np.concatenate([np.zeros(0), *(table.ravel() for r in rows for table in r)])

    def recall(self, numbers: dict[str, Any], memory: np.ndarray) -> None:
        """Go back to where a snapshot was made; the end of its ``memory`` is ours."""
        self.made, self.local = list(numbers["made"]), numbers["local"]
        rows: list[Rows] = []
        first = memory.size - sum(math.prod(shape) for r in numbers["known"] for shape in r)
        for shapes in numbers["known"]:
            tables = []
            for shape in shapes:
                tables.append(memory[first : first + math.prod(shape)].reshape(shape))
                first += math.prod(shape)
            rows.append(Rows(*tables))
        if rows:
            self.known = Known(rows)
            self.known.first = numbers["given"]
