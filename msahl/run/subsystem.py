"""Builds an independent subsystem at t = 0 and advances it by its scheme's stepper."""

import math
from collections.abc import Callable
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from msahl.elements.signals.group import begin_angles
from msahl.events.margins import Changing, Span
from msahl.formulations.absolute.rigid_body import write_accelerations
from msahl.jit.by_size import LARGE, by_size
from msahl.jit.lanes import LANES
from msahl.jit.storage import Storage, Storages, with_own_doubles
from msahl.model import Model, resolve
from msahl.model.contact_sides import may_share
from msahl.model.scheme import AUTO_FAMILY
from msahl.ports import forces
from msahl.schemes.common import workspace
from msahl.schemes.common.workspace import Workspace, new_workspace
from msahl.schemes.fixed_stepper import FixedStepper
from msahl.schemes.midpoint.stepper import MidpointMethod
from msahl.schemes.stepper import Advance, Chunk, Stepper
from msahl.start.positions import Assembled, assemble, close_rounded
from msahl.start.redundancy import (
    constraint_rank,
    is_regular,
    is_tree_of_points,
    non_unique_reactions,
)
from msahl.start.velocities import (
    StartError,
    VelocityChange,
    make_consistent,
    solve_accelerations,
)
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    coordinate_count,
    multiplier_count,
    new_system_workspace,
)
from msahl.system.build import Places
from msahl.system.contacts import contacts_of
from msahl.system.graph import node_order
from msahl.system.nonfinite import find_nonfinite, find_undefined, overflow
from msahl.system.reductions import (
    all_unknowns,
    drop_rows,
    needed_unknowns,
    plane_normal,
    stay_in_plane,
    symmetric_rows,
)
from msahl.system.state import build_state
from msahl.system.switches import (
    Switches,
    build_at_start,
    conditions_of,
    vectors_of_impulses,
    with_all_engaged,
    without,
)
from msahl.system.tree import NOTHING_MOVES, Formulation, choose_formulation
from msahl.system.unknowns import choose
from msahl.system.work_arrays import caller, jacobian_at_rest, new_work_arrays

if TYPE_CHECKING:
    from msahl.contact.modes import ContactModes
    from msahl.schemes.contact_steps import ContactSteps
    from msahl.switching.modes import Switching


MOST_NAMED = 3
"""Most bodies by which a message names a subsystem."""


class Shared(NamedTuple):
    """What a subsystem has in common with others: ``storages`` from which its arrays come, and to
    which they go back by ``release``; one of the same model that has ``begun``, but not taken a
    step, and has the same start.
    """

    storages: Storages | None = None
    begun: "SubsystemIntegrator | None" = None


ALONE = Shared()


class SubsystemIntegrator:
    """A subsystem with its stepper: made consistent at t = 0, then advanced chunk by chunk.

    ``moved`` and ``change`` describe what was done to the given positions and velocities; ``rank``
    is the number of independent constraint equations, ``redundant`` that of the others; ``shared``
    lists the columns of reactions that are therefore not unique, by name of the joint, coupling or
    motion; ``axis`` is the normal of a planar subsystem's plane, or None. Reactions are means over
    the steps unless ``instantaneous``; the tables have accelerations if these are wanted. ``full``
    switches off the model reductions, ``chunk`` is the largest number of steps and rows of a chunk.
    What it has in common with others is ``shared``. Raises ``StartError`` if there is no consistent
    start.
    """

    resolves_inputs = False
    """Whether expressions of the time that are faster than the steps divide these."""
    joint_coordinates = True
    """Whether steps may be in joint coordinates."""

    moved: Assembled | None
    change: VelocityChange
    rank: int
    redundant: int
    shared: dict[str, list[str]]
    axis: int | None
    workspace: Workspace

    def __init__(
        self,
        model: Model,
        solver: str,
        full: bool,
        chunk: int,
        instantaneous: bool = False,
        accelerations: bool = False,
        shared: Shared = ALONE,
    ) -> None:
        self.model, self.solver, self.size = model, solver, len(model.bodies)
        self.storages = shared.storages
        if shared.begun is None or self.changes:
            self._find_start(full, chunk, accelerations)
        else:
            self._repeat_start(shared.begun, chunk, accelerations)
        simulation = model.simulation
        step = 0.0 if resolve(simulation).adaptive else simulation.dt
        span = Span(simulation.t_final, step, self.resolves_inputs)
        self.formulation = self._choose_formulation(full)
        self.modes = _new_modes(model, self.workspace)
        self.switching = _new_switching(model, self.workspace, self.switches, self.modes)
        self.stepper = _new_stepper(
            model,
            self.workspace,
            solver,
            (instantaneous, span),
            self.storage,
            self.formulation,
            (self.modes, self.switching),
        )

    @property
    def changes(self) -> bool:
        """Whether constraints are not the same throughout a run, whereby velocities may jump."""
        return bool(self.model.rigid_contacts or self.model.switched or self.model.events)

    def _find_start(self, full: bool, chunk: int, accelerations: bool) -> None:
        """Build the system and its state at t = 0, and make this consistent."""
        model = self.model
        system, self.switches = build_at_start(model)
        self.pattern = system.blocks
        self.storage = self._take_storage(chunk, accelerations)
        system = self.storage.place("system", system)
        state = self.storage.place("state", build_state(model, system))
        try:
            self._make_workspace(system, state, full, chunk, accelerations)
        except np.linalg.LinAlgError as error:  # LAPACK's fault on inf and nan
            start = new_system_workspace(system, state)
            evaluate.prepare(system, state, start)
            name = find_nonfinite(model, system, state, start, model.simulation.dt) or "the joints"
            raise StartError(overflow(0.0, name)) from error

    def _repeat_start(self, begun: "SubsystemIntegrator", chunk: int, accelerations: bool) -> None:
        """Begin as the ``begun`` subsystem does, with arrays of its own."""
        self.pattern, self.switches, self.axis = begun.pattern, begun.switches, begun.axis
        self.moved, self.change = begun.moved, begun.change
        self.rank, self.redundant, self.shared = begun.rank, begun.redundant, dict(begun.shared)
        self.storage = self._take_storage(chunk, accelerations)
        own: Workspace = begun.workspace
        system, state = with_own_doubles(own.system), State(*(a.copy() for a in own.state))
        self._place(new_workspace(system, own.unknowns, state, chunk, accelerations))
        call = caller(self.size, self.storage)
        _prepare(self.workspace.system, self.workspace.state, self.workspace.start, call)

    def _take_storage(self, chunk: int, accelerations: bool) -> Storage:
        """Return storage of an earlier run of a system that is connected alike, or new storage."""
        if self.storages is None or self.size >= LARGE or self.changes:
            return Storage()
        simulation = self.model.simulation
        kind = (id(self.pattern), chunk, accelerations, simulation.scheme, simulation.degree)
        return self.storages.take(kind)

    def _make_workspace(
        self, system: System, state: State, full: bool, chunk: int, accelerations: bool
    ) -> None:
        """Make the state consistent, choose the unknowns and apply the model reductions."""
        model = self.model
        self.moved = assemble(system, state) if model.position == "project" else None
        if self.moved is None:
            close_rounded(system, state)
        nodes = node_order(system) if self.size >= LARGE and not self.changes else None
        independent = self.size >= LARGE and is_tree_of_points(system)
        unknowns = None if independent else choose(system, all_unknowns(system), nodes)
        work_arrays = new_work_arrays(system, state, self.storage if self.size < LARGE else None)
        at_rest: np.ndarray | None = jacobian_at_rest(system, state, work_arrays)
        count = multiplier_count(system)
        self.rank = count if independent else constraint_rank(system, state, unknowns, at_rest)
        self.redundant = count - self.rank
        self.shared = {}
        self._add_shared(system, state, at_rest)
        if _prepare(system, state, work_arrays.start, work_arrays.call):
            at_rest = None  # that of other angles
        start = work_arrays.start
        pushes = vectors_of_impulses(model) if model.events else None
        engaged = with_all_engaged(system, self.switches)
        self.axis = None if full else plane_normal(engaged, start, pushes)
        free = needed_unknowns(system, start, self.axis, full or accelerations)
        if unknowns is None or free.size < unknowns.free.size:
            unknowns = choose(stay_in_plane(system, start, self.axis), free, nodes)
        self.change = make_consistent(system, state, free, model.velocity, work_arrays)
        # Contacts may be redundant with each other, as the corners of a box are.
        shares = system.forces.sliding is not None and system.forces.sliding.row.size > 1
        shares = shares or may_share(model.contact_sides)
        if shares or (self.redundant and not is_regular(system, state, unknowns, at_rest)):
            system, self.switches = build_at_start(model, True, Places(state.x, state.p))
            unknowns, at_rest, work_arrays = (
                choose(stay_in_plane(system, start, self.axis), free),
                None,
                new_work_arrays(system, state),
            )
        solve_accelerations(system, state, unknowns, at_rest, work_arrays)
        if self.axis is not None:
            system = stay_in_plane(system, start, self.axis)
            symmetric = symmetric_rows(system, start, self.axis)
            system = drop_rows(system, symmetric)
            self.switches = without(self.switches, symmetric) if self.switches else None
            state = state._replace(angle=np.zeros(coordinate_count(system)))
        state = state._replace(held=forces.held_switches(system.forces))
        self._place(new_workspace(system, unknowns, state, chunk, accelerations))
        _prepare(
            self.workspace.system, self.workspace.state, self.workspace.start, work_arrays.call
        )

    def _place(self, fresh: Workspace) -> None:
        """Set the workspace to the ``fresh`` one, or to that of an earlier run with its numbers."""
        name = ("workspace", self.axis, id(fresh.unknowns))
        self.workspace = self.storage.place(name, fresh)

    def _choose_formulation(self, full: bool) -> Formulation:
        """Return the coordinates in which steps are solved."""
        settings = resolve(self.model.simulation)
        if settings.explicit:
            return self._choose_explicit(settings.scheme, full)
        if full or self.solver == "root" or not self.joint_coordinates:
            return Formulation(None, "model reductions are switched off (--full, --solver root)")
        if settings.family != "gauss" or min(settings.degrees) > LANES:
            word = settings.scheme + (str(settings.degree) if settings.degree else "")
            return Formulation(None, f"{word} has no steps in joint coordinates")
        workspace = self.workspace
        free = workspace.unknowns.free
        return choose_formulation(self.model, workspace.system, workspace.start, free, self.axis)

    def _choose_explicit(self, scheme: str, full: bool) -> Formulation:
        """Return joint coordinates, which an explicit scheme needs; a subsystem that cannot move
        needs none, and has steps of gauss. Raises ``StartError`` if there are none.
        """
        remedy = f"scheme {scheme} takes steps in joint coordinates only"
        if full or self.solver == "root":
            raise StartError(f"{remedy}: omit --full and --solver root, or choose another scheme")
        workspace = self.workspace
        given = self.model, workspace.system, workspace.start, workspace.unknowns.free, self.axis
        found = choose_formulation(*given, saves_work=False)
        if found.tree is None and found.reason != NOTHING_MOVES:
            bodies = self.model.shown_bodies
            members = ", ".join(body.name for body in bodies[:MOST_NAMED])
            more = ", ..." if len(bodies) > MOST_NAMED else ""
            raise StartError(
                f"{remedy}, but the subsystem of {members}{more} has none: {found.reason}; choose "
                "gauss, or another scheme"
            )
        return found

    @property
    def unknowns(self) -> int:
        """Number of unknowns that steps are solved for."""
        tree, cut = self.formulation.tree, self.formulation.cut
        if tree is None:
            return self.workspace.unknowns.free.size
        return tree.body.size + (0 if cut is None else cut.scale.size)

    def _add_shared(self, system: System, state: State, at_rest: np.ndarray | None = None) -> None:
        """Add the reactions that are not unique in this state to those found before."""
        elements = self.model.constrained
        found = non_unique_reactions(system, state, (), at_rest) if self.redundant else {}
        for e, columns in found.items():
            known = self.shared.get(elements[e].name, [])
            self.shared[elements[e].name] = sorted({*known, *columns})

    def review_reactions(self) -> None:
        """Find the reactions that are not unique in the present state, besides those found before.

        Directions fixed in bodies have rotated since t = 0: a component along an inertial axis that
        was unique then need not be so now. In a planar subsystem they stay in the plane.
        """
        if self.axis is None:
            self._add_shared(self.workspace.system, self.workspace.state)

    def find_nonfinite(self, h: float) -> str | None:
        """Name the element whose numbers become NaN or infinite in a step ``h`` [s], or None."""
        return find_nonfinite(
            self.model,
            self.workspace.system,
            self.workspace.state,
            self.workspace.start,
            h,
        )

    def find_undefined(self, h: float) -> str | None:
        """Name the expression that has no finite value within a few steps, or None; ``h`` [s] is a
        step that failed, and may have been made shorter.
        """
        workspace, h = self.workspace, max(h, self.model.simulation.dt)
        return find_undefined(self.model, workspace.system, workspace.state, h)

    @cached_property
    def changing(self) -> list[np.ndarray]:
        """The arrays of doubles, but for those of the stepper, that change from step to step."""
        workspace = self.workspace
        return self.storage.doubles((workspace.state, workspace.start, workspace.pivots))

    def release(self, step_time: float) -> None:
        """Let later runs use the arrays of this one, which has ended; a step took it ``step_time``
        seconds.
        """
        self.storage.step_time = step_time
        if self.storages and self.size < LARGE and not self.changes:
            self.storages.give_back(self.storage)

    def show_start(self) -> None:
        """Fill the first rows of monitor and tables with the state at t = 0."""
        self.workspace.mean_force[:] = self.workspace.state.force
        self.workspace.mean_reaction[:] = self.workspace.state.reaction
        by_size(workspace.record_step, self.size)(self.workspace, 0.0, 0, 0)
        table = self.workspace.tables.accelerations
        if table.shape[1]:
            state, start = self.workspace.state, self.workspace.start
            write = by_size(write_accelerations, self.size)
            bodies = self.workspace.system.bodies
            write(bodies, start.frames, state.w, state.a, state.alpha, table, 0)

    def advance(self, chunk: Chunk, patience: float = math.inf) -> Advance:
        """Take the steps of a ``chunk``; see ``Stepper.advance``."""
        return self.stepper.advance(chunk, patience)


class CompanionIntegrator(SubsystemIntegrator):
    """A subsystem of a companion of a run with given steps."""

    resolves_inputs = True


def _prepare(
    system: System, state: State, start: SystemWorkspace, call: Callable[..., Any]
) -> bool:
    """Prepare ``start``, for angles on the revolutions where signals begin, and set elongations of
    springs in the compliance form; ``call`` calls kernels.
    Returns whether angles of ``state`` were changed.
    """
    call(evaluate.prepare, system, state, start)
    changed = begin_angles(system.forces.signals, system.scalar, start.scalar, state.angle)
    if changed:
        call(evaluate.prepare, system, state, start)
    if system.forces.compliance is not None:
        call(forces.correct_elongations, system.forces, start.forces, system.scalar, 1.0)
    return changed


def _new_stepper(
    model: Model,
    workspace: Workspace,
    solver: str,
    details: tuple[bool, Span],
    storage: Storage,
    formulation: Formulation,
    changing: "tuple[ContactModes | None, Switching | None]",
) -> Stepper:
    """The stepper of the model's scheme; the collocation code is only loaded where it is needed."""
    simulation, settings = model.simulation, resolve(model.simulation)
    instantaneous, span = details
    modes, switching = changing
    changes = modes is not None or switching is not None
    given = Changing(
        modes.held.contacts if modes else None, switching.conditions if switching else None
    )
    if settings.explicit and formulation.tree is not None:
        return _new_explicit_stepper(workspace, settings.family, formulation, span, storage)
    if not settings.degree:

        def new_midpoint(own: Workspace) -> MidpointMethod:
            place = Storage() if changes else storage
            return MidpointMethod(own, instantaneous, span, place, given)

        contacts = _new_contact_steps(changing, workspace, new_midpoint)
        return FixedStepper(
            contacts.method if contacts else new_midpoint(workspace), solver, contacts
        )
    from msahl.schemes.collocation.step_control import ControlSettings
    from msahl.schemes.collocation.stepper import AdaptiveStepper, CollocationMethod, first_degree

    tolerance, degrees, tree = settings.local_tolerance, settings.degrees, formulation.tree
    rest = span, storage, None if tree is None else (tree, formulation.cut)
    if formulation.tree is not None:
        degrees = tuple(degree for degree in degrees if degree <= LANES)
    length, degree = float(workspace.system.frames.length[:-1].max()), settings.degree
    degree = degree if tolerance is None else first_degree(degrees, tolerance / length)

    def new_collocation(own: Workspace) -> CollocationMethod:
        place = (span, Storage(), None, given) if changes else rest
        family = AUTO_FAMILY if settings.explicit else settings.family
        return CollocationMethod(own, family, degree, *place)

    contacts = _new_contact_steps(changing, workspace, new_collocation)
    method = contacts.method if contacts else new_collocation(workspace)
    if tolerance is None:
        return FixedStepper(method, solver, contacts)
    control = ControlSettings(tolerance, simulation.dt, simulation.t_final)
    return AdaptiveStepper(method, degrees, control, contacts)


def _new_explicit_stepper(
    workspace: Workspace, scheme: str, formulation: Formulation, span: Span, storage: Storage
) -> Stepper:
    """The stepper of an explicit scheme; a step that fails has no other solver."""
    from msahl.schemes.explicit.stepper import ExplicitMethod

    assert formulation.tree is not None
    given = formulation.tree, formulation.cut
    return FixedStepper(ExplicitMethod(workspace, scheme, given, span, storage), "newton")


def _new_modes(model: Model, workspace: Workspace) -> "ContactModes | None":
    """Return the contacts of a subsystem, which are closed or open as they are at t = 0."""
    contacts = contacts_of(model, workspace.system, workspace.state)
    if contacts is None:
        return None
    from msahl.contact.modes import ContactModes, ContactsUnsolved  # which few models need
    from msahl.contact.state import ContactState

    settings, names = resolve(model.simulation), [side.name for side in model.contact_sides]
    asked = settings.local_tolerance if settings.accuracy is None else settings.accuracy
    held = ContactState(contacts, workspace.system, workspace.state, workspace.unknowns)
    modes = ContactModes(held, names, model.simulation.impact_law, asked)
    try:
        modes.begin()
    except ContactsUnsolved as error:
        raise StartError(str(error)) from error
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    return modes


def _new_switching(
    model: Model, workspace: Workspace, switched: Switches | None, modes: "ContactModes | None"
) -> "Switching | None":
    """Return the events of a subsystem, whose conditions are those at t = 0; None without any."""
    conditions = conditions_of(model)
    if conditions is None:
        return None
    from msahl.switching.modes import Switching  # which few models need

    system, state = workspace.system, workspace.state
    switching = Switching(model, switched, conditions, modes, system, state, workspace.unknowns)
    switching.begin()
    evaluate.prepare(system, state, workspace.start)
    return switching


def _new_contact_steps(
    changing: "tuple[ContactModes | None, Switching | None]",
    workspace: Workspace,
    make: Callable[[Workspace], Any],
) -> "ContactSteps | None":
    """Return what changes the methods of steps; the code is only loaded where it is needed."""
    if changing == (None, None):
        return None
    from msahl.schemes.contact_steps import ContactSteps

    return ContactSteps(*changing, workspace, make)
