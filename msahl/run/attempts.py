"""Runs to a global tolerance: run, estimate the error, and run again with smaller steps if needed.

A run with a local tolerance keeps the sum of the local errors of its steps below it. The global
error that follows from them is estimated by a companion run (``error_estimate``). It is about
proportional to the local tolerance, so where it is too large the next run has

    local tolerance  <-  AIM local tolerance (global tolerance / estimated error)

An auxiliary state may be wrong by a part of its largest value, as a position may of the longest
body's length; steps are chosen by the same measure (``step_control``). Other signals and the loads
of actuators follow from positions, rates and states; a run is made again where the verdict would
not pass them (``signal_errors``).

The first companion, at half the step, is often accurate enough to judge the second run as well.
"""

import math
from typing import Any

import numpy as np

from msahl.model import RunSettings
from msahl.run.companion import EarlierRun, Rows
from msahl.run.error_estimate import ErrorEstimate
from msahl.run.report import Report

AIM = 0.2
"""Fraction of the global tolerance that the local errors of the first run may add up to, as motions
let errors grow, and that a further run aims at. Steps for a fifth of the error are a fifth shorter
at order 8; a further run costs as much as the first."""
MOST_RUNS = 4
HELPS = 0.5
"""A further run whose error is above this fraction of the previous one shows that smaller steps do
not help: the motion amplifies round-off."""
FEW = 100
"""Steps in which no motion amplifies round-off to an error that matters."""
BOLDER = 0.01
"""Further factor of the local tolerance where a run took the same steps as the one before: local
errors that do not see what is wrong, such as a state between its steps, say little of how small it
must be."""
FINEST = 1e-14
"""Smallest local tolerance, relative to the size of the model."""
KNOWN_SHARE = 0.1
"""Largest error of an earlier companion, relative to the tolerance, with which it is used again."""
KNOWN_NUMBERS = 4_000_000
"""Most numbers of an earlier companion that are kept in memory."""


class Attempts:
    """The runs to the global tolerance ``goal`` [m]: those ``made``, the ``local`` tolerance [m] of
    the present one, and the ``earlier`` companion, if it is accurate enough to be used again.
    """

    def __init__(self, settings: RunSettings) -> None:
        assert settings.tolerance is not None
        self.goal = settings.tolerance
        self.local, self.order = AIM * self.goal, settings.order
        self.made: list[dict[str, float]] = []
        self.earlier: EarlierRun | None = None
        self.seconds: dict[str, float] = {}

    def add(self, report: Report, estimate: ErrorEstimate) -> None:
        """Add a run that has ended; its report is completed by those before."""
        self.made.append(
            {
                "localTolerance": self.local,
                "steps": report.steps,
                "error": estimate.error,
                "overTolerance": estimate.over_tolerance(self.goal),
            }
        )
        assert report.step_control is not None
        report.step_control |= {"tolerance": self.goal, "runs": self.made}
        degrees = [int(chosen["degree"]) for chosen in report.step_control["degrees"]]
        self.order = 2 * min(degrees) if degrees else self.order
        for phase, seconds in self.seconds.items():
            report.add_seconds(phase, seconds)
        self.seconds = dict(report.seconds)

    def prepare_next(self, estimate: ErrorEstimate | None, size: float) -> bool:
        """Whether another run is needed of a model of this ``size`` [m]; if so, prepare it."""
        if estimate is None or estimate.stopped:
            return False
        over, finest = estimate.over_tolerance(self.goal), FINEST * size
        if over <= 1.0:
            return False
        helps = len(self.made) < 2 or over <= HELPS * self.made[-2]["overTolerance"]
        helps = helps or self.made[-1]["steps"] < FEW
        again = self._took_the_same_steps()
        if not (helps or again) or self._finer_runs() == MOST_RUNS or self.local <= finest:
            return False
        self.local = max(AIM * self.local / over * (BOLDER if again else 1.0), finest)
        # At half the step the error is 2^-order of itself.
        good = over * 0.5**self.order <= KNOWN_SHARE
        self.earlier = estimate.as_earlier_run() if good and estimate.kept is not None else None
        return True

    def _took_the_same_steps(self) -> bool:
        """Whether the last run is that before it, which says nothing of smaller steps."""
        return len(self.made) > 1 and self.made[-1]["steps"] == self.made[-2]["steps"]

    def _finer_runs(self) -> int:
        """Number of runs, those of the same steps counted once."""
        return len({made["steps"] for made in self.made})

    def numbers(self) -> dict[str, Any]:
        """For a snapshot, what JSON can hold."""
        rows = self.earlier.rows if self.earlier else []
        shapes = [[list(table.shape) for table in tables] for tables in rows]
        used = self.earlier.used if self.earlier else 0
        return {"made": list(self.made), "local": self.local, "shapes": shapes, "used": used}

    def memory(self) -> np.ndarray:
        """For a snapshot, the rest (m,)."""
        rows = self.earlier.rows if self.earlier else []
        return np.concatenate([np.zeros(0), *(table.ravel() for row in rows for table in row)])

    def restore(self, numbers: dict[str, Any], memory: np.ndarray) -> None:
        """Restore what ``numbers`` and ``memory`` returned; this is the end of a snapshot's."""
        self.made, self.local = list(numbers["made"]), numbers["local"]
        rows: list[Rows] = []
        first = memory.size - sum(math.prod(shape) for row in numbers["shapes"] for shape in row)
        for shapes in numbers["shapes"]:
            tables = []
            for shape in shapes:
                tables.append(memory[first : first + math.prod(shape)].reshape(shape))
                first += math.prod(shape)
            rows.append(Rows(*tables))
        if rows:
            self.earlier = EarlierRun(rows, numbers["used"])
