"""A second run at half the step beside the first: how far the two are apart, and since when.

The step is of order 2, so where halving it changes little, the run's own error is about 4/3 of the
change. Where a motion is chaotic the two part sooner or later; the *trust horizon* is the time up
to which they agree.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from msahl.model import Model, scheme_of
from msahl.rotations import angles
from msahl.solve.island import Runner
from msahl.solve.plan import Plan


class Shadow:
    """The islands of a run at half its step; ``tolerance`` [m] is for positions, and for turns
    times the bodies' lengths.
    """

    def __init__(self, runners: Sequence[Runner], full: bool, chunk: int, tolerance: float) -> None:
        self.tolerance = tolerance
        self.runners = [Runner(_unpaced(r.model), r.solver, full, 2 * chunk) for r in runners]
        for runner in self.runners:
            runner.show_start()
        self.horizon = self.position = self.turn = 0.0
        self.stopped = self.parted = False

    def follow(
        self, runners: Sequence[Runner], sizes: np.ndarray, plan: Plan, times: np.ndarray
    ) -> None:
        """Go the steps of these ``sizes`` that the run has gone, and compare the rows of ``plan``,
        which are those of ``times``.
        """
        halves = plan.halves()
        apart = np.zeros((len(times), 2))
        for runner, own in zip(runners, self.runners, strict=True):
            if self.stopped:
                return
            own.steps.go_like(runner.steps)
            self.stopped = not _go(own, 0.5 * sizes, halves)
            rows = own.scene.tables.states[: len(times)]
            if not self.stopped and np.isfinite(rows).all():
                lengths = own.scene.system.bodies.length[:-1]
                known = runner.scene.tables.states[: len(times)]
                apart = np.maximum(apart, _apart(rows, known, lengths))
            else:
                self.stopped = True
        self._take_in(apart, times)

    def _take_in(self, apart: np.ndarray, times: np.ndarray) -> None:
        if self.stopped or not len(times):
            return
        self.position = max(self.position, float(apart[:, 0].max()))
        self.turn = max(self.turn, float(apart[:, 1].max()))
        beyond = np.flatnonzero(apart.max(axis=1) > self.tolerance)
        if not self.parted:
            good = beyond[0] if len(beyond) else len(times)
            self.horizon = float(times[good - 1]) if good else self.horizon
            self.parted = bool(len(beyond))

    def figures(self) -> dict[str, float | bool]:
        """All that it has found so far."""
        return {name: value for name, value in vars(self).items() if name != "runners"}

    def as_json(self) -> dict[str, float | bool]:
        """The figures by name; times in s, differences in m."""
        return {
            "tolerance": self.tolerance,
            "trustHorizon": self.horizon,
            "positionApartMax": self.position,
            "turnApartMax": self.turn,
            "agrees": not (self.parted or self.stopped),
        }


def _unpaced(model: Model) -> Model:
    """The same, at steps that are given."""
    given = replace(model.simulation, scheme=scheme_of(model), tolerance=None)
    return replace(model, simulation=given)


def _go(runner: Runner, sizes: np.ndarray, plan: Plan) -> bool:
    """Take two steps of each of the ``sizes``; whether all were solved."""
    first = 0
    for last in [*(np.flatnonzero(np.diff(sizes)) + 1), len(sizes)]:
        done, _ = runner.advance(float(sizes[first]), 2 * first, 2 * last, plan)
        if done < 2 * last:
            return False
        first = last
    return True


def _apart(rows: np.ndarray, others: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """(m, 2) distance of the bodies, and their turn times ``lengths`` (n,), the largest of all, in
    published states (m, 12 n) [m].
    """
    a, b = (table.reshape(len(table), len(lengths), 4, 3) for table in (rows, others))
    way = np.sqrt(((a[:, :, 0] - b[:, :, 0]) ** 2).sum(axis=2)).max(axis=1)
    turn = (angles(a[:, :, 1], b[:, :, 1]) * lengths).max(axis=1)
    return np.stack([way, turn], axis=1)
