"""Takes the steps of a run once more, with the derivatives of states and rows by parameters."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from msahl.analysis.gradients.arrays import Copy, blocks_of, degrees_of, places_in_state
from msahl.analysis.gradients.start import NotDifferentiable, Shape, Variation
from msahl.analysis.gradients.step_sequence import Step, after
from msahl.analysis.gradients.switches import switches_of
from msahl.events.expressions import jumps_by_reactions
from msahl.jit.compiled import compiled
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation import newton as collocation_newton
from msahl.schemes.collocation import tangent as collocation_tangent
from msahl.schemes.collocation.tangent import CollocationPair
from msahl.schemes.common.accelerations import new_instant
from msahl.schemes.common.tangents import FIRST_MEAN, FIRST_P, FIRST_X, FRAMES, LAST_MEAN, Tangents
from msahl.schemes.fixed_stepper import LARGEST_DENSE, MAX_SUBDIVISIONS
from msahl.schemes.midpoint import newton as midpoint_newton
from msahl.schemes.midpoint import tangent as midpoint_tangent
from msahl.schemes.midpoint.tangent import Pair
from msahl.schemes.outcome import Outcome
from msahl.system import evaluate
from msahl.system.arrays import Tables
from msahl.system.nonfinite import names_of_users

_take_step = compiled(midpoint_newton.take_step)
_take_steps = compiled(collocation_newton.take_steps)
_differentiate = compiled(midpoint_tangent.differentiate)
_differentiate_collocation = compiled(collocation_tangent.differentiate)

NEARBY = 1e-4
"""Fraction of a step after its end at which a margin is evaluated for its rate."""
_NO_RATE = "the step to the change of an expression at t = {:g} s could not be solved beyond it"
END_SHIFT = 1.0
"""Largest shift of the end of a run [s]; the size of the last step limits it further."""
NO_ROWS, NO_SHARES = np.zeros(0, dtype=np.int64), np.zeros(0)


class TangentRun:
    """One subsystem of a run with its derivatives by n parameters, and by the end of the run as the
    last one if that is ``free``.
    """

    def __init__(
        self,
        part: SubsystemIntegrator,
        variations: Sequence[Variation],
        shape: Shape,
        free: bool,
    ) -> None:
        blocks, settings = blocks_of(part), shape.settings
        by_degree, solver = degrees_of(part), part.solver
        unknowns = part.workspace.unknowns.free.size
        self.by_scipy = solver != "newton" and unknowns * max(settings.degree, 1) <= LARGEST_DENSE
        instant = new_instant(part.workspace.system, None, settings.instantaneous)
        groups = part.workspace, instant, tuple(by_degree.values())
        self.base, member = Copy(groups, blocks), Copy(groups, blocks)
        self.workspace, self.member = self.base.groups[0], member.groups[0]
        self.switches = switches_of(self.workspace, settings.t_final)
        # End of the first step in which an expression jumps at a time that is not followed [s].
        by_reactions = jumps_by_reactions(self.workspace.system.forces.signals)
        self.jumped, self.jumping = np.inf, ""  # ... and what has this expression
        self.model = part.model
        self._note_jumps(by_reactions, 0.0)
        self.length = float(part.workspace.system.frames.length[:-1].max(initial=1e-300))
        places = places_in_state(part.workspace)
        shared = _shared(self.base, member, variations, free, places)
        shared["duration"] = np.array([settings.t_final])
        self.free, self.places, self.slope = free, places, shared["slope"]
        self.result_slope, self.worst = shared["result_slope"], shared["worst"]
        self.size_slope, self.before = shared["size_slope"], shared["before"]
        self.tangents: dict[int, Tangents] = {}
        self.pairs: dict[int, Any] = {}
        if not by_degree:
            instants = self.base.groups[1], member.groups[1]
            self.pairs[0] = Pair(self.workspace, member.groups[0], *instants)
            self.tangents[0] = _tangents(shared, self.workspace.Z, self.workspace.factor)
        for degree, of_base, of_member in zip(
            by_degree, self.base.groups[2], member.groups[2], strict=True
        ):
            due, share = np.zeros(2, dtype=np.int64), np.zeros(max(shape.rows, 1))
            load_scale = of_base.stages.last_load_scale.copy()
            self.pairs[degree] = CollocationPair(of_base, of_member, due, share, load_scale)
            self.tangents[degree] = _tangents(shared, of_base.stages.Z, of_base.factor)
        self.sizes: list[np.ndarray] = []  # of the tangents, after each step

    def steps(self, steps: Sequence[Step]) -> Iterator[tuple[Step, Tables, np.ndarray]]:
        """Take the ``steps``; yield those with rows, the tables with these as their first rows, and
        their derivatives (n, ...), each a view that the next step changes.

        Raises ``NotDifferentiable`` if one of them cannot be solved.
        """
        degree, moved = None, np.zeros_like(self.size_slope)  # the start, by the parameters
        for k, step in enumerate(steps):
            if step.degree != degree and step.degree:
                collocation_newton.reset_prediction(self.pairs[step.degree].base)
            degree, share = step.degree, 0.5 * min(step.shares, default=1.0)
            if moved.any() and share < 0.5:  # so that all rows are at times that do not move
                self.size_slope[:] = -moved
                self._take_on_sides(step._replace(rows=(), shares=()), share * step.size)
                step, moved = after(step, share), np.zeros_like(moved)
            self.size_slope[:] = -moved
            if self.free:
                self.size_slope[-1] += _end_share(steps, k)
            begin = self.base.state.copy(), self.slope.copy()
            reached = self._take_on_sides(step, step.size)
            self.sizes.append(self._largest())
            if step.rows:
                yield step, self.workspace.tables, self.result_slope
            moved = np.zeros_like(moved)
            if reached >= 0 and k + 1 < len(steps):
                moved = self._move_end(reached, step, begin)
            self._clear_means()

    def _note_jumps(self, switches: Sequence[int], time: float) -> None:
        """Note that these ``switches`` jump by a ``time`` [s] and are not followed."""
        if switches and time < self.jumped:
            system = self.workspace.system
            names = {n: None for k in switches for n in names_of_users(self.model, system, k)}
            self.jumped, self.jumping = time, " and of ".join([*names][:3])

    def _clear_means(self) -> None:
        mean = slice(self.places[FIRST_MEAN], self.places[LAST_MEAN])
        self.base.state[mean] = 0.0
        self.slope[:, mean] = 0.0

    def _take_on_sides(self, step: Step, h: float) -> int:
        """Take and differentiate a step ``h`` with the switches on the sides where they are in its
        middle; return the one that changes at its end, or -1.
        """
        found, reached = self.switches, -1
        if not found:
            self._take(step, h, 1.0, MAX_SUBDIVISIONS)
            return reached
        state, slope = self.base.state.copy(), self.slope.copy()
        found.hold(self.workspace)
        solved = self._solve_only(step, 0.5 * h)
        sides, within = found.sides(self.workspace), found.distances(self.workspace)
        if solved:
            self._return_to(state, step)
            found.hold(self.workspace, sides)
            self._take(step, h, 1.0, MAX_SUBDIVISIONS)
            reached, passed = found.reached(self.workspace, within, sides, step.near)
            jumps = found.number[passed[found.jumps[passed]]]
            self._note_jumps(jumps.tolist(), float(self.workspace.state.time[0]))
        if not solved or passed.size:  # the motion slides, or the run did not divide its step
            self._return_to(state, step)
            self.slope[:] = slope
            found.hold(self.workspace)
            self._take(step, h, 1.0, MAX_SUBDIVISIONS)
            return -1
        return reached

    def _move_end(
        self, switch: int, step: Step, begin: tuple[np.ndarray, np.ndarray]
    ) -> np.ndarray:
        """Take a step from its ``begin`` again, state and derivatives, such that its end moves with
        the time of the jump of a ``switch``; return by how much.
        """
        found, own = self.switches, self.size_slope.copy()
        assert found
        held = self.workspace.state.held.copy()
        self.before[:] = self.base.state
        by_parameters = found.slopes(
            switch, self.workspace, self.member, self.tangents[step.degree]
        )
        d, g = NEARBY * step.size, []
        for k in range(3):
            self._return_to(begin[0], step, held)
            if not self._solve_only(step, step.size + k * d):
                raise NotDifferentiable(_NO_RATE.format(float(self.workspace.state.time[0])))
            g.append(found.values(self.workspace)[found.margin[switch]])
        rate = (4.0 * g[1] - 3.0 * g[0] - g[2]) / (2.0 * d)
        moved = -by_parameters / rate if rate != 0.0 else np.zeros_like(own)
        self._return_to(begin[0], step, held)
        self.slope[:] = begin[1]
        self.size_slope[:] = own + moved
        self._take(step._replace(rows=(), shares=()), step.size, 1.0, MAX_SUBDIVISIONS)
        return moved

    def _return_to(self, state: np.ndarray, step: Step, held: np.ndarray | None = None) -> None:
        """Bring the base back to a ``state`` at the start of a ``step``."""
        self.base.state[:] = state
        if held is not None:
            self.workspace.state.held[:] = held
        evaluate.prepare(self.workspace.system, self.workspace.state, self.workspace.start)
        if step.degree:
            collocation_newton.reset_prediction(self.pairs[step.degree].base)

    def _solve_only(self, step: Step, h: float) -> bool:
        """Take a step ``h`` without differentiating it; return whether it could be solved."""
        if step.degree:
            base = self.pairs[step.degree].base
            return bool(_take_steps(base, h, 0, 1, NO_ROWS, NO_SHARES) == 1)
        return Outcome(*_take_step(self.workspace, h, h / step.size)).converged

    def margin(self) -> tuple[float, np.ndarray]:
        """Return the margin of the conditions that end the run at its end, and its derivatives."""
        rows = self.workspace.monitor.rows
        return float(rows[0, -1]), self._of_monitor()[:, 0, -1]

    def table_slopes(self, rows: int) -> dict[str, np.ndarray]:
        """Return the derivatives (n, rows, columns) of the first rows of all tables, by name."""
        found, first = {}, 0
        for name, table in self.workspace.tables._asdict().items():
            part = self.result_slope[:, first : first + table.size]
            found[name] = part.reshape(len(part), *table.shape)[:, :rows]
            first += table.size
        return found

    def _of_monitor(self) -> np.ndarray:
        rows = self.workspace.monitor.rows
        return self.result_slope[:, -rows.size :].reshape(-1, *rows.shape)

    def _take(self, step: Step, h: float, share: float, depth: int) -> None:
        """Take and differentiate a step ``h``, a ``share`` of the recorded one, or its halves."""
        self.before[:] = self.base.state
        if self._solve(step, h, share):
            return
        if depth == 0:
            t = float(self.workspace.state.time[0])
            raise NotDifferentiable(f"the step from t = {t:g} s could not be solved again")
        self.base.state[:] = self.before
        evaluate.prepare(self.workspace.system, self.workspace.state, self.workspace.start)
        if step.degree:
            collocation_newton.reset_prediction(self.pairs[step.degree].base)
        self.size_slope *= 0.5  # each half has half the change of the step's size
        for half in range(2):
            kept = [
                (row, 2.0 * s - half)
                for row, s in zip(step.rows, step.shares, strict=True)
                if (s > 0.5) == bool(half)
            ]
            rows, shares = tuple(row for row, _ in kept), tuple(s for _, s in kept)
            part = step._replace(rows=rows, shares=shares)
            self._take(part, 0.5 * h, 0.5 * share, depth - 1)
        self.size_slope *= 2.0

    def _solve(self, step: Step, h: float, share: float) -> bool:
        """Take a step and differentiate it; return whether it could be solved."""
        pair, tangents = self.pairs[step.degree], self.tangents[step.degree]
        if step.degree:
            return self._solve_collocation(pair, tangents, step, h)
        outcome = Outcome(*_take_step(self.workspace, h, share))
        if not outcome.converged and self.by_scipy:
            from msahl.schemes.midpoint import scipy_root

            outcome = scipy_root.take_step(self.workspace, h, share)
        if outcome.converged:
            _differentiate(pair, tangents, h, share, len(step.rows))
        return outcome.converged

    def _solve_collocation(
        self, pair: CollocationPair, tangents: Tangents, step: Step, h: float
    ) -> bool:
        rows = len(step.rows)
        pair.due[1], pair.share[:rows] = rows, step.shares
        pair.load_scale[:] = pair.base.stages.last_load_scale
        due, share = (pair.due, pair.share) if rows else (NO_ROWS, NO_SHARES)
        solved = bool(_take_steps(pair.base, h, 0, 1, due, share) == 1)
        if not solved and self.by_scipy:
            from msahl.schemes.collocation import scipy_root

            collocation_newton.reset_prediction(pair.base)
            solved = scipy_root.take_step(pair.base, h).converged
            if solved and rows:
                collocation_newton.record_step(pair.base, h, 0, pair.due, pair.share)
        if solved:
            _differentiate_collocation(pair, tangents, h)
        return solved

    def _largest(self) -> np.ndarray:
        """(n,) largest change of a position over the longest length, or of an orientation [rad]."""
        n = 3 * self.places[FRAMES]
        x, p = (
            np.abs(self.slope[:, self.places[k] : self.places[k] + n]) for k in (FIRST_X, FIRST_P)
        )
        largest: np.ndarray = np.maximum(x.max(axis=1) / self.length, p.max(axis=1))
        return largest


def _shared(
    base: Copy, member: Copy, variations: Sequence[Variation], free: bool, places: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the arrays of ``Tangents`` that the degrees of a scheme share."""
    n = len(variations) + free
    changed = [np.flatnonzero(v.numbers) for v in variations] + [np.zeros(0, dtype=np.int64)] * free
    most = max([1, *map(len, changed)])
    index, change = np.zeros((n, most), dtype=np.int64), np.zeros((n, most))
    slope = np.zeros((n, base.state.size))
    for j, (changed_one, variation) in enumerate(zip(changed, variations, strict=False)):
        index[j, : len(changed_one)], change[j, : len(changed_one)] = (
            changed_one,
            variation.numbers[changed_one],
        )
        slope[j] = variation.state
    size = base.state.size
    return {
        "number": member.numbers,
        "given": base.numbers.copy(),
        "changed": index,
        "change": change,
        "changes": np.array([len(changed_one) for changed_one in changed], dtype=np.int64),
        "state": member.state,
        "base": base.state,
        "before": base.state.copy(),
        "after": base.state.copy(),
        "slope": slope,
        "total": np.zeros(size),
        "result": member.rows,
        "base_result": base.rows,
        "result_slope": np.zeros((n, base.rows.size)),
        "size_slope": np.zeros(n),
        "most": np.array([v.most for v in variations] + [END_SHIFT] * free),
        "places": places,
        "worst": np.zeros(n),
    }


def _tangents(shared: dict[str, np.ndarray], Z: np.ndarray, factor: np.ndarray) -> Tangents:
    """Return the tangents of steps with unknowns like ``Z``, whose Jacobian has such factors."""
    step, rows = np.zeros_like(Z), np.zeros_like(Z)
    return Tangents(**shared, step=step, rows=rows, factor=np.zeros_like(factor))


def _end_share(steps: Sequence[Step], k: int) -> float:
    """Return by how much the size of step ``k`` changes with the end of the run: pairs that a
    tolerance chose end there together, of steps of a given size the last one is cut.
    """
    paired = len(steps) > 1 and steps[-1].size == steps[-2].size and steps[-1].degree > 0
    if paired:
        return 0.5 if k >= len(steps) - 2 else 0.0
    return 1.0 if k == len(steps) - 1 else 0.0
