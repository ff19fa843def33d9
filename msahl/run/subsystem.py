"""Builds an independent subsystem at t = 0 and advances it by its scheme's stepper."""

import math

import numpy as np

from msahl.model import Model, degree_of, local_tolerance_of, scheme_of
from msahl.model.scheme import AUTO
from msahl.schemes.fixed_stepper import FixedStepper
from msahl.schemes.midpoint import workspace
from msahl.schemes.midpoint.stepper import MidpointMethod
from msahl.schemes.midpoint.workspace import Workspace, new_workspace
from msahl.schemes.stepper import Advance, Chunk, Stepper
from msahl.start.positions import assemble
from msahl.start.redundancy import constraint_rank, is_regular, non_unique_reactions
from msahl.start.velocities import StartError, make_consistent, solve_accelerations
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    coordinate_count,
    multiplier_count,
    new_system_workspace,
)
from msahl.system.build import Places, build_system
from msahl.system.nonfinite import find_nonfinite, overflow
from msahl.system.reductions import (
    all_unknowns,
    drop_rows,
    needed_unknowns,
    plane_normal,
    stay_in_plane,
    symmetric_rows,
)
from msahl.system.state import build_state
from msahl.system.unknowns import choose


class SubsystemIntegrator:
    """An island with its solver; builds the scene at t = 0 and advances it chunk by chunk.

    ``moved`` and ``change`` tell what was done to the given positions and velocities, ``rank`` and
    ``redundant`` how many joint equations are independent and how many not, ``shared`` which
    columns of reactions are therefore not unique, by name of the joint, coupling or motion;
    ``axis`` is the normal of a planar island's plane or None.
    ``at_rows`` asks for reactions at the rows' own times instead of means over the steps.
    Raises ``StartError`` if there is no consistent start.
    """

    def __init__(
        self, model: Model, solver: str, full: bool, chunk: int, instantaneous: bool = False
    ) -> None:
        self.model, self.solver = model, solver
        system = build_system(model)
        state = build_state(model, system)
        try:
            self._make_scene(system, state, full, chunk)
        except np.linalg.LinAlgError as error:  # what LAPACK says of inf and nan
            start = new_system_workspace(system, state)
            evaluate.prepare(system, state, start)
            name = find_nonfinite(model, system, state, start, model.simulation.dt) or "the joints"
            raise StartError(overflow(0.0, name)) from error
        self.stepper = _new_stepper(model, self.workspace, solver, instantaneous)

    def _make_scene(self, system: System, state: State, full: bool, chunk: int) -> None:
        """Bring the start in order, and find out what there is to be solved."""
        model = self.model
        self.moved = assemble(system, state) if model.position == "project" else None
        self.rank = constraint_rank(system, state)
        self.redundant = multiplier_count(system) - self.rank
        self.shared: dict[str, list[str]] = {}
        self._add_shared(system, state)
        start = new_system_workspace(system, state)
        evaluate.prepare(system, state, start)
        self.axis = None if full else plane_normal(system, start)
        free = all_unknowns(system) if full else needed_unknowns(system, start, self.axis)
        unknowns = choose(system, free)
        self.change = make_consistent(system, state, free, model.velocity)
        if self.redundant and not is_regular(system, state, unknowns):
            system = build_system(model, relaxed=True, places=Places(state.x, state.p))
            unknowns = choose(system, free)
        solve_accelerations(system, state, unknowns)
        if self.axis is not None:
            system = stay_in_plane(system, self.axis)
            system = drop_rows(system, symmetric_rows(system, start, self.axis))
            state = state._replace(angle=np.zeros(coordinate_count(system)))
        self.workspace: Workspace = new_workspace(system, unknowns, state, chunk)
        evaluate.prepare(system, state, self.workspace.start)

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

    def advance(self, chunk: Chunk, patience: float = math.inf) -> Advance:
        """Take the steps of a ``chunk``; see ``Stepper.advance``."""
        return self.stepper.advance(chunk, patience)


def _new_stepper(model: Model, workspace: Workspace, solver: str, instantaneous: bool) -> Stepper:
    """The stepper of the model's scheme; the collocation code is only loaded if asked for."""
    scheme, degree, simulation = scheme_of(model), degree_of(model), model.simulation
    if degree == 0:
        return FixedStepper(MidpointMethod(workspace, instantaneous), solver)
    from msahl.schemes.collocation.step_control import ControlSettings
    from msahl.schemes.collocation.stepper import AdaptiveStepper, CollocationMethod

    tolerance = local_tolerance_of(model)
    if tolerance is None:
        return FixedStepper(CollocationMethod(workspace, scheme, degree), solver)
    degrees = tuple(range(1, degree + 1)) if simulation.scheme == AUTO else (degree,)
    # The first review begins in the middle of the degrees.
    method = CollocationMethod(workspace, scheme, degrees[len(degrees) // 2])
    settings = ControlSettings(tolerance, simulation.dt, simulation.t_final)
    return AdaptiveStepper(method, degrees, settings)
