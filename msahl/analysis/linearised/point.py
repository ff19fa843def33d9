"""A model at one configuration: at t = 0, or after a run to some time.

Positions and velocities are made consistent as for a run; accelerations and multipliers follow.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from msahl.analysis.constant_inputs import with_constant_inputs
from msahl.analysis.linearised.projection import close
from msahl.analysis.linearised.settle import settle
from msahl.analysis.linearised.touching import (
    InTouch,
    Touching,
    apart,
    close_contacts,
    in_mode,
    touch,
)
from msahl.analysis.no_contacts import require_no_contacts
from msahl.elements.constraints import scalar
from msahl.elements.signals.group import begin_angles
from msahl.formulations.absolute.frames import moving_count
from msahl.formulations.absolute.rigid_body import read_states
from msahl.jit.by_size import by_size
from msahl.model import Model, Options
from msahl.model.settings import OFF
from msahl.run.loop import Hooks, run
from msahl.run.report import Report
from msahl.run.tables import SIGNALS, STATES, MemorySink
from msahl.start.positions import assemble
from msahl.start.velocities import StartError, make_consistent
from msahl.system import evaluate
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace
from msahl.system.contacts import contacts_of
from msahl.system.graph import node_order
from msahl.system.names import signal_columns
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.switches import build_at_start
from msahl.system.unknowns import Unknowns, choose


@dataclass(frozen=True, eq=False)
class Point:
    """A system in a consistent state with its accelerations and multipliers."""

    model: Model
    system: System
    state: State
    known: Unknowns | None = None
    touching: Touching | None = None  # the contacts, of a model with rigid ones

    @cached_property
    def unknowns(self) -> Unknowns:
        """All unknowns with their order of elimination, found when they are needed first."""
        return self.known or choose(self.system, all_unknowns(self.system), node_order(self.system))

    @property
    def pressing(self) -> float:
        """Largest force of a contact [N or N m]."""
        return 0.0 if self.touching is None else float(self.touching.force.max(initial=0.0))

    @property
    def time(self) -> float:
        """The time of the state [s]."""
        return float(self.state.time[0])


def at_start(model: Model) -> Point:
    """Return the model at t = 0; raises ``StartError`` if there is no consistent state."""
    point = placed(model)
    make_consistent(point.system, point.state, point.unknowns.free, model.velocity)
    return settled(point, point.state)


def placed(model: Model) -> Point:
    """Return the model where the deck places it, with the deck's velocities; accelerations and
    multipliers are zero, and contacts are open.
    """
    system, _ = build_at_start(model)
    state = build_state(model, system)
    if model.position == "project":
        assemble(system, state)
    _begin_angles(system, state)
    contacts = contacts_of(model, system, state)
    names = tuple(side.name for side in model.contact_sides)
    return Point(model, system, state, touching=contacts and apart(contacts, names))


def complete(model: Model, system: System, state: State, unknowns: Unknowns | None = None) -> Point:
    """Return the point of a consistent ``state``, with its accelerations and multipliers."""
    unknowns = unknowns or choose(system, all_unknowns(system), node_order(system))
    settle(system, state, unknowns)
    return Point(model, system, state, unknowns)


def settled(point: Point, state: State) -> Point:
    """Return the ``point`` at a consistent ``state``, with its accelerations and multipliers, and
    those contacts closed that press there. Raises ``StartError`` (``touching.touch``).
    """
    if point.touching is None:
        return complete(point.model, point.system, state, point.unknowns)
    return _in_touch(point, touch(point.system, state, point.touching))


def closed(point: Point, state: State) -> Point:
    """Return the ``point`` at the nearest state to ``state`` that satisfies all constraints, and
    in which no contacts overlap; accelerations are not set. Raises ``StartError``.
    """
    if point.touching is None:
        return replace(point, state=close(point.system, state, point.unknowns))
    given = InTouch(point.system, state, point.unknowns, point.touching)
    return _in_touch(point, close_contacts(given))


def _in_touch(point: Point, found: InTouch) -> Point:
    system, state, unknowns, touching = found
    return replace(point, system=system, state=state, known=unknowns, touching=touching)


def at_time(model: Model, time: float) -> Point:
    """Return the model after a run to the ``time`` [s]; raises ``StartError`` if it does not get
    there, or if it has events, which may have changed it.
    """
    model = with_constant_inputs(model)
    if time == 0.0:
        return at_start(model)
    if model.events:
        require_no_contacts(replace(model, contacts=()))
    changed = replace(model, simulation=replace(model.simulation, t_final=time))
    sink = MemorySink((STATES, SIGNALS))
    report = run(changed, Options(error=OFF), sink, Hooks(), checked=True)
    rows, signal_rows = sink.table(STATES), sink.table(SIGNALS)
    if not len(rows) or not np.isclose(rows[-1, 0], time, rtol=1e-9):
        raise StartError(
            f"the run did not reach {time:.9g} s: {report.message or report.status}; choose an "
            "earlier time"
        )
    system, _ = build_at_start(model)
    state = build_state(model, system)
    _follow(system, state, rows)
    if state.auxiliary.size:
        columns = signal_columns(model)
        states = [columns.index(s.name) for s in model.signals if hasattr(s, "initial")]
        state.auxiliary[:] = signal_rows[-1, states]
    point = _with_contacts(Point(model, system, state), report)
    # Schemes of order 2 satisfy constraints between places; those between rates to their order.
    point = closed(point, state)
    make_consistent(point.system, point.state, point.unknowns.free, "massWeighted")
    return settled(point, point.state)


def _with_contacts(point: Point, report: Report) -> Point:
    """Return the ``point`` with those contacts closed that were at the end of a run."""
    contacts = contacts_of(point.model, point.system, point.state)
    if contacts is None:
        return point
    names = tuple(side.name for side in point.model.contact_sides)
    held = np.isin(names, (report.contacts or {}).get("closed", []))
    system, unknowns = in_mode(point.system, contacts, point.state, held)
    touching = apart(contacts, names)._replace(closed=held)
    return replace(point, system=system, known=unknowns, touching=touching)


def _follow(system: System, state: State, states: np.ndarray) -> None:
    """Set ``state`` to the last row of a table of states, (m, ...) with the time, and count angles;
    from one output time to the next they change by the mean of their rates, to less than half a
    revolution.
    """
    table = np.ascontiguousarray(states[:, 1:])
    _begin_angles(system, state)
    last = None
    for row, time in enumerate(states[:, 0].tolist()):
        read_states(system.bodies, table, row, state.x, state.p, state.v, state.w)
        state.time[0], before = time, float(state.time[0])
        if system.scalar is None:
            continue
        start = _prepared(system, state)
        value, rate = np.zeros((2, state.angle.size))
        scalar.values(system.scalar, start.scalar, start.frames, value, rate)
        if last is not None:
            state.angle[:] += 0.5 * (time - before) * (last + rate)
        scalar.count_rotations(system.scalar, start.scalar, state.angle)
        last = rate


def _prepared(system: System, state: State) -> SystemWorkspace:
    start = new_system_workspace(system, state)
    by_size(evaluate.prepare, moving_count(system.frames))(system, state, start)
    return start


def _begin_angles(system: System, state: State) -> None:
    """Set the counted angles that begin with their own value."""
    if system.forces.signals is not None and system.scalar is not None:
        start = _prepared(system, state)
        begin_angles(system.forces.signals, system.scalar, start.scalar, state.angle)
