"""Many steps of one island, by whichever solver, and what is done when a step is hard.

``newton`` is the compiled loop, ``root`` is scipy's, and ``auto`` starts with ``root`` and calls
it for every step that the compiled loop does not converge on. A step that resists is taken in two
halves, these in halves again where needed, down to 2^-10 of it.
"""

import math
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.jit.compiled import compiled
from msahl.model import Model, degree_of, local_tolerance_of, scheme_of
from msahl.model.scheme import AUTO
from msahl.run.output_schedule import OutputSchedule
from msahl.schemes import accelerations
from msahl.schemes.accelerations import new_instant
from msahl.schemes.midpoint import equations, newton, workspace
from msahl.schemes.midpoint.workspace import Workspace, new_workspace
from msahl.schemes.outcome import EVALUATION, STEP_WORK, Outcome, Requests
from msahl.start.positions import assemble
from msahl.start.redundancy import constraint_rank, is_regular, non_unique_reactions
from msahl.start.velocities import StartError, make_consistent, solve_accelerations
from msahl.system.arrays import State, System, multiplier_count, new_start, quantity_count
from msahl.system.build import build_system
from msahl.system.nonfinite import find_nonfinite, overflow
from msahl.system.reductions import (
    all_unknowns,
    drop_rows,
    needed_unknowns,
    plane_normal,
    stay_in_plane,
    symmetric_rows,
)
from msahl.system.state import build_state, settle
from msahl.system.unknowns import choose

if TYPE_CHECKING:
    from msahl.schemes.collocation.stepper import AdaptiveStepper, Higher

MAX_SUBDIVISIONS = 10
LARGEST_DENSE = 300
"""Most unknowns for which ``auto`` turns to scipy, whose algebra is dense: a step of 300 takes it
tens of milliseconds, and the time grows with the third power."""

_march = compiled(newton.march)
_take = compiled(newton.take)
_show = compiled(workspace.show)
_publish = compiled(accelerations.publish)
_march_instantaneous = compiled(accelerations.march)


class MidpointStepper:
    """Steps of the lowest order of one ``scene``, with the reactions of rows ``at_rows``, their own
    times, or else with means.
    """

    def __init__(self, workspace: Workspace, instantaneous: bool) -> None:
        self.workspace = workspace
        self.instant = new_instant(workspace.system) if instantaneous else None

    @property
    def kind(self) -> str:
        """Which compiled step the scene needs."""
        kind = "points" if self.workspace.system.along is None else "along"
        kind += "-angle" if self.workspace.system.frames.exponential else ""
        return kind if self.instant is None else f"{kind}-station"

    def march(self, h: float, first: int, last: int, schedule: OutputSchedule) -> int:
        """As ``newton.march``, with the reactions the rows want."""
        if self.instant is None:
            return int(_march(self.workspace, h, first, last, schedule.ends()))
        return int(
            _march_instantaneous(self.workspace, self.instant, h, first, last, schedule.ends())
        )

    def show(self, h: float, step: int, schedule: OutputSchedule) -> None:
        """As ``step.show``, with the reactions the rows want."""
        row = int(schedule.ends()[step])
        _show(self.workspace, h, step, row)
        if self.instant is not None and row >= 0:
            _publish(self.workspace, self.instant, row)

    def forget(self) -> None:
        """Where things change fast, last step's change is a worse guess than none."""
        state = self.workspace.state
        for trend in (state.a_trend, state.alpha_trend, state.force_trend):
            trend[:] = 0.0

    memory: None = None
    """What advances beside the scene."""

    @property
    def counters(self) -> dict[str, Any]:
        """What must be known to go on, beside the memory."""
        return {}

    def recall(self, counters: dict[str, Any]) -> None:
        """Go back to what ``counters`` told."""

    def go_like(self, other: object) -> None:
        """All steps of the lowest order are alike."""

    def take(self, h: float, share: float) -> Outcome:
        """A step ``h``, a ``share`` of the whole one, by the compiled solver."""
        return Outcome(*_take(self.workspace, h, share))

    def take_by_root(self, h: float, share: float, after: Callable[[int], None]) -> Outcome:
        """Likewise by scipy, which is slow to import: only where it is called."""
        from msahl.schemes.midpoint import scipy_root

        return scipy_root.take(self.workspace, h, share, after)


class SubsystemIntegrator:
    """An island with its solver; builds the scene at t = 0 and advances it chunk by chunk.

    ``moved`` and ``change`` tell what was done to the given positions and velocities, ``rank`` and
    ``redundant`` how many joint equations are independent and how many not, ``shared`` which
    columns of reactions are therefore not unique, by name of the joint, coupling or motion;
    ``axis`` is the normal of a planar island's plane or None.
    ``at_rows`` asks for reactions at the rows' own times instead of means over the steps.
    Hard steps ask ``requests`` whether to stop, and raise ``Stopped``; the scene is to be recalled
    then.
    Raises ``StartError`` if there is no consistent start.
    """

    def __init__(
        self, model: Model, solver: str, full: bool, chunk: int, instantaneous: bool = False
    ) -> None:
        self.model, self.solver = model, solver
        self.scipy_steps = self.subdivisions = 0
        self.requests = Requests()
        system = build_system(model)
        state = build_state(model, system)
        try:
            self._make_scene(system, state, full, chunk)
        except np.linalg.LinAlgError as error:  # what LAPACK says of inf and nan
            start = new_start(system, state)
            equations.prepare(system, state, start)
            name = find_nonfinite(model, system, state, start, model.simulation.dt) or "the joints"
            raise StartError(overflow(0.0, name)) from error
        degree = degree_of(model)
        self.steps = _steps(model, self.workspace, instantaneous)
        self.large = self.workspace.unknowns.free.size * max(degree, 1) > LARGEST_DENSE
        # A higher degree is asked of scipy only where it must be: that would be compiled as well.
        self.begun = degree > 0

    def _make_scene(self, system: System, state: State, full: bool, chunk: int) -> None:
        """Bring the start in order, and find out what there is to be solved."""
        model = self.model
        self.moved = assemble(system, state) if model.position == "project" else None
        self.rank = constraint_rank(system, state)
        self.redundant = multiplier_count(system) - self.rank
        self.shared: dict[str, list[str]] = {}
        self._add_shared(system, state)
        start = new_start(system, state)
        equations.prepare(system, state, start)
        self.axis = None if full else plane_normal(system, start)
        free = all_unknowns(system) if full else needed_unknowns(system, start, self.axis)
        unknowns = choose(system, free)
        self.change = make_consistent(system, state, free, model.velocity)
        if self.redundant and not is_regular(system, state, unknowns):
            system = build_system(model, relaxed=True)
            settle(system, state)
            unknowns = choose(system, free)
        solve_accelerations(system, state, unknowns)
        if self.axis is not None:
            system = stay_in_plane(system, self.axis)
            system = drop_rows(system, symmetric_rows(system, start, self.axis))
            state = state._replace(angle=np.zeros(quantity_count(system)))
        self.workspace: Workspace = new_workspace(system, unknowns, state, chunk)
        equations.prepare(system, state, self.workspace.start)

    def _add_shared(self, system: System, state: State) -> None:
        """Add the reactions that are not unique in this state to those that were not before."""
        elements = (*self.model.joints, *self.model.couplings, *self.model.motions)
        found = non_unique_reactions(system, state) if self.redundant else {}
        for e, columns in found.items():
            known = self.shared.get(elements[e].name, [])
            self.shared[elements[e].name] = sorted({*known, *columns})

    def review_reactions(self) -> None:
        """Decide again which reactions are unique, where the island stands now.

        Directions fixed in bodies have turned: a component along an inertial axis that happened to
        be unique at the start need not be so later. In a plane nothing turns out of it.
        """
        if self.axis is None:
            self._add_shared(self.workspace.system, self.workspace.state)

    def find_nonfinite(self, h: float) -> str | None:
        """Whose numbers in the step ``h`` from where the island stands are none, in words."""
        return find_nonfinite(
            self.model, self.workspace.system, self.workspace.state, self.workspace.start, h
        )

    def show_start(self) -> None:
        """Fill the first rows of watch and tables with the state at t = 0."""
        self.workspace.mean_force[:] = self.workspace.state.force
        self.workspace.mean_reaction[:] = self.workspace.state.reaction
        workspace.show(self.workspace, 0.0, 0, 0)

    def advance(
        self, h: float, first: int, last: int, schedule: OutputSchedule, patience: float = math.inf
    ) -> tuple[int, Outcome]:
        """Take steps ``first``..``last - 1`` of a chunk as ``newton.march`` has them.

        Returns the number of the step that did not converge (``last`` if none) and its outcome;
        the state is then that of the last whole step. Steps that turn hard are broken off, the last
        of them solved, after ``patience`` seconds.
        """
        k, outcome = first, Outcome(0.0, -1)
        began = time.perf_counter()
        while k < last:
            if self.solver == "newton" or (self.solver == "auto" and (self.begun or self.large)):
                k = self.steps.march(h, k, last, schedule)
            if k < last:
                outcome = self._take_hard(h)
                if not outcome.converged:
                    break
                self.steps.show(h, k, schedule)
                k += 1
                self.begun = True
                if time.perf_counter() - began > patience:
                    break
        return k, outcome

    def _take_hard(self, h: float) -> Outcome:
        """One step by the reference solver, or all of it in smaller ones; else no step at all."""
        before = [array.copy() for array in self.workspace.state]
        self.steps.forget()
        outcome = self._take(h, MAX_SUBDIVISIONS, 1.0)
        if not outcome.converged:
            self.steps.forget()
            for array, value in zip(self.workspace.state, before, strict=True):
                array[:] = value
            equations.prepare(self.workspace.system, self.workspace.state, self.workspace.start)
        return outcome

    def _take(self, h: float, subdivisions: int, share: float) -> Outcome:
        outcome = self._take_once(h, share)
        if outcome.converged or subdivisions == 0:
            return outcome
        self.subdivisions += 1
        outcome = self._take(0.5 * h, subdivisions - 1, 0.5 * share)
        return self._take(0.5 * h, subdivisions - 1, 0.5 * share) if outcome.converged else outcome

    def _take_once(self, h: float, share: float) -> Outcome:
        if self.solver == "newton" or (self.solver == "auto" and self.large):
            self.requests.after(EVALUATION + STEP_WORK * self.workspace.unknowns.free.size)
            return self.steps.take(h, share)
        self.scipy_steps += 1
        return self.steps.take_by_root(h, share, self.requests.after)


def _steps(
    model: Model, workspace: Workspace, instantaneous: bool
) -> "MidpointStepper | Higher | AdaptiveStepper":
    """How the model's steps are taken; a higher degree's code is only loaded if asked for."""
    scheme, degree, simulation = scheme_of(model), degree_of(model), model.simulation
    if degree == 0:
        return MidpointStepper(workspace, instantaneous)
    from msahl.schemes.collocation.stepper import AdaptiveStepper, Higher

    tolerance = local_tolerance_of(model)
    if tolerance is None:
        return Higher(workspace, scheme, degree)
    degrees = tuple(range(1, degree + 1)) if simulation.scheme == AUTO else (degree,)
    return AdaptiveStepper(workspace, scheme, degrees, tolerance, simulation.dt, simulation.t_final)
