"""Steps of higher degree of one island, for ``solve.island``; loaded only where they are asked for.

Where a tolerance is given the steps are those of ``solve.pace``, and, unless the degree is given as
well, it is the one whose steps take the least work for a second of motion. From time to time, after
so many pairs, the degrees beside the present one are tried where the scene then stands. Work is
counted and not timed, so a run comes out the same on every machine.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.jit.compiled import compiled
from msahl.model.scheme import HIGHER
from msahl.run.output_schedule import OutputSchedule
from msahl.schemes.collocation import dense_output, newton, step_control
from msahl.schemes.collocation.newton import CollocationWorkspace, new_collocation_workspace
from msahl.schemes.collocation.workspace import Stages
from msahl.schemes.midpoint.workspace import Workspace
from msahl.schemes.outcome import Outcome

_march = compiled(newton.march)
_publish = compiled(newton.publish)
_march_adaptive = compiled(step_control.march)

NO_ROWS = (np.zeros(0, dtype=np.int64), np.zeros(0))

FIRST_REVIEW, LONGEST_PAUSE = 8, 128
"""Pairs until the degree is looked at again: each time twice as many, to a few in a hundred."""
TRIES = 3
"""Pairs that it takes at most to find the size of one at a degree."""
WORTH = 0.9
"""Part of the present work below which another degree is turned to."""


class Higher:
    """Steps by the ``scheme`` of a ``degree`` of one ``scene``."""

    def __init__(self, workspace: Workspace, scheme: str, degree: int) -> None:
        self.workspace, self.scheme = workspace, scheme
        self.highs: dict[int, CollocationWorkspace] = {}
        self.turn_to(degree)

    @property
    def counters(self) -> dict[str, Any]:
        """What must be known to go on, beside the memory."""
        return {"degree": self.degree}

    def recall(self, counters: dict[str, Any]) -> None:
        """Go back to what ``counters`` told."""
        self.turn_to(counters["degree"])

    def go_like(self, other: object) -> None:
        """Turn to the degree of the ``other`` steps."""
        if isinstance(other, Higher) and self.degree != other.degree:
            self.turn_to(other.degree)

    def turn_to(self, degree: int) -> None:
        """Go on with steps of this ``degree``."""
        self.degree = degree
        if degree not in self.highs:
            self.highs[degree] = new_collocation_workspace(self.workspace, self.scheme, degree)
        self.high = self.highs[degree]
        newton.forget(self.high)

    @property
    def kind(self) -> str:
        """Which compiled step the scene needs."""
        kind = "points" if self.high.workspace.system.along is None else "along"
        rubs = "" if self.high.pressed is None else "-friction"
        return f"{kind}{rubs}-high"

    def march(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """As ``high.march``."""
        return int(_march(self.high, h, first, last, schedule.due, schedule.share))

    def show(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """As ``high.publish``."""
        _publish(self.high, h, step, schedule.due, schedule.share)

    def forget(self) -> None:
        """Let the next step, from where the scene stands, be guessed from its accelerations."""
        newton.forget(self.high)
        dense_output.mark(self.high.between.begin, self.high.workspace)

    @property
    def memory(self) -> Stages:
        """What advances beside the scene."""
        return self.high.stages

    def take(self, h: float, share: float) -> Outcome:
        """A step ``h``, whatever ``share`` it is of the whole one, by the compiled solver."""
        _march(self.high, h, 0, 1, *NO_ROWS)
        residual, worst = self.high.outcome
        return self._told(Outcome(float(residual), int(worst)))

    def take_by_root(self, h: float, share: float, after: Callable[[int], None]) -> Outcome:
        """Likewise by scipy."""
        from msahl.schemes.collocation import scipy_root

        return self._told(scipy_root.take(self.high, h, after))

    def _told(self, outcome: Outcome) -> Outcome:
        """The ``outcome`` of a step, after which, if it failed, the unknowns are none to follow."""
        if not outcome.converged:
            newton.forget(self.high)
        return outcome


class AdaptiveStepper(Higher):
    """Steps whose sizes follow from a ``tolerance`` [m], of those ``degrees`` that may be chosen.

    ``chosen`` tells the degrees, each with the time since when and the work, in iterations of the
    lowest one, that a second of motion then took by it and by those it was compared with.
    """

    def __init__(
        self,
        workspace: Workspace,
        scheme: str,
        degrees: tuple[int, ...],
        tolerance: float,
        dt: float,
        t_final: float,
    ) -> None:
        # The first review begins in the middle of the degrees.
        super().__init__(workspace, scheme, degrees[len(degrees) // 2])
        self.degrees, self.tolerance = degrees, tolerance
        steps = len(workspace.monitor.rows)
        self.control = step_control.new_step_control(self.high, steps, dt, tolerance, t_final)
        self.sizes: dict[int, float] = {}
        self.chosen: list[dict[str, Any]] = []
        self.review, self.pause = 0, FIRST_REVIEW

    @property
    def kind(self) -> str:
        """Which compiled step the scene needs."""
        return f"{super().kind}-paced"

    @property
    def memory(self) -> Any:
        """What advances beside the scene."""
        return self.high.stages, self.control.figures

    @property
    def counters(self) -> dict[str, Any]:
        """What must be known to go on, beside the memory."""
        return {
            "degree": self.degree,
            "chosen": self.chosen,
            "review": [self.review, self.pause],
            "pairs": self.control.counts.tolist(),
        }

    def recall(self, counters: dict[str, Any]) -> None:
        """Go back to what ``counters`` told."""
        self.turn_to(counters["degree"])
        self.chosen = counters["chosen"]
        self.review, self.pause = counters["review"]
        self.control.counts[:] = counters["pairs"]

    def go(self, times: np.ndarray, end: float, most: int) -> tuple[int, int, Outcome]:
        """Take about ``most`` steps, until the ``times`` of all rows, and never past the ``end``
        [s]: how many steps and rows that made. No step: the outcome says why.
        """
        self.control.figures[step_control.END] = end
        accepted = int(self.control.counts[step_control.ACCEPTED])
        most = min(most, len(self.control.sizes))
        if len(self.degrees) > 1:
            if accepted >= self.review:
                self._review()
                self.review = accepted + self.pause
                self.pause = min(2 * self.pause, LONGEST_PAUSE)
            most = min(most, 2 * (self.review - accepted))
        done = int(_march_adaptive(self.high, self.control, self.order, max(2, most), times))
        residual, worst = self.high.outcome
        return (
            done,
            int(self.control.counts[step_control.ROWS]),
            Outcome(float(residual), int(worst)),
        )

    @property
    def smallest_tried(self) -> float:
        """Size of the steps [s] that were tried last."""
        return 0.5 * float(self.control.figures[step_control.NEXT])

    @property
    def order(self) -> int:
        """Order of the steps of the present degree."""
        return HIGHER[self.scheme].order(self.degree)

    def as_json(self) -> tuple[dict[str, Any], dict[str, float]]:
        """How the steps were chosen, as ``run.json`` tells it [m, s], and the extremes of their own
        errors.
        """
        figures, counts = self.control.figures, self.control.counts
        told = {
            "localTolerance": self.tolerance,
            "pairs": int(counts[step_control.ACCEPTED]),
            "refused": int(counts[step_control.REFUSED]),
            "stepMin": float(figures[step_control.SMALLEST]),
            "stepMax": float(figures[step_control.WIDEST]),
            "degrees": self.chosen,
        }
        local = {
            "localErrorMax": float(figures[step_control.LARGEST]),
            "localErrorSum": float(figures[step_control.ERROR]),
        }
        return told, local

    def _review(self) -> None:
        """Turn to the degree that takes the least work, if that is worth it."""
        present = self.degree
        self.sizes[present] = float(self.control.figures[step_control.NEXT])
        work = {present: self._work(present, present)}
        for way in (1, -1):
            degree = present + way
            while degree in self.degrees:
                work[degree] = self._work(degree, degree - way)
                if work[degree] > work[degree - way]:
                    break
                degree += way
        best = min(work, key=lambda degree: work[degree])
        if self.chosen and work[best] > WORTH * work[present]:
            best = present
        if best != self.degree:
            self.turn_to(best)
        self.control.figures[step_control.NEXT] = self.sizes[best]
        if not self.chosen or self.chosen[-1]["degree"] != best:
            told = {str(degree): work[degree] for degree in sorted(work)}
            since = float(self.workspace.state.time[0])
            self.chosen.append({"degree": best, "since": since, "work": told})

    def _work(self, degree: int, like: int) -> float:
        """Work for a second by steps of this ``degree``, first tried at the size of those ``like``
        it.
        """
        figures, counts = self.control.figures, self.workspace.counts
        size, spent = self.sizes[like], counts.copy()
        if degree != self.degree:
            self.turn_to(degree)
        for _ in range(TRIES):
            spent, figures[step_control.NEXT] = counts.copy(), size
            _march_adaptive(self.high, self.control, self.order, 0, NO_ROWS[1])
            tried, size = size, float(figures[step_control.BEST])
            if 0.5 <= size / tried <= 2.0:
                break
        self.sizes[degree] = size
        return work_of(degree, *(counts - spent).tolist()) / tried


def work_of(degree: int, iterations: int, factorisations: int) -> float:
    """Work of solved steps, in iterations of the lowest degree.

    Measured, of pendulums, tops and four-bars: an iteration costs as 1 + s, a derivative with its
    factors as 2 + s^2/2; of degree 1 the two are as 1 to 2.5.
    """
    return 0.5 * (1 + degree) * iterations + (2.0 + 0.5 * degree**2) * factorisations
