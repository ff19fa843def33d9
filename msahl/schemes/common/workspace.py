"""Work arrays of one subsystem, and rows of tables from its accepted state."""

from typing import NamedTuple

import numpy as np

from msahl.elements import reactions
from msahl.elements.beams import instant
from msahl.formulations.absolute import rigid_body
from msahl.jit.by_size import by_size
from msahl.jit.kernel import apart, kernel
from msahl.linalg.elimination import new_factor
from msahl.ports import forces
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    Tables,
    new_system_workspace,
    new_tables,
    node_count,
)
from msahl.system.diagnostics import Monitor, new_monitor, record_figures
from msahl.system.unknowns import Unknowns
from msahl.system.work_arrays import size_of


class Workspace(NamedTuple):
    """Constant data of one subsystem, its state, and work arrays."""

    system: System
    unknowns: Unknowns
    state: State
    start: SystemWorkspace
    Z: np.ndarray  # (nodes, 3) unknowns of the step
    F: np.ndarray  # (nodes, 3) its equations
    values: np.ndarray  # block values of the Jacobian
    factor: np.ndarray  # its sparse factors
    sizes: np.ndarray  # (2, nodes, 3) largest entries of its rows and columns
    y: np.ndarray  # (f,) right-hand side, in the order of elimination
    mean_force: np.ndarray  # (k, 3) multipliers over the present step, summed over substeps
    mean_reaction: np.ndarray  # (j, 6) likewise the reactions of the joints [N, N m]
    counts: np.ndarray  # (2,) iterations and factorisations so far
    pivots: np.ndarray  # (1,) largest pivot ratio of a Jacobian so far
    tables: Tables
    monitor: Monitor


def new_workspace(
    system: System, unknowns: Unknowns, state: State, chunk: int, accelerations: bool = False
) -> Workspace:
    """Return the workspace for chunks of up to ``chunk`` steps, with a table of ``accelerations``
    if they are wanted.
    """
    nodes = (node_count(system), 3)
    return Workspace(
        system=system,
        unknowns=unknowns,
        state=state,
        start=new_system_workspace(system, state),
        Z=np.zeros(nodes),
        F=np.zeros(nodes),
        values=np.zeros_like(system.constant),
        factor=new_factor(unknowns.elimination),
        sizes=np.zeros((2, *nodes)),
        y=np.zeros(unknowns.free.size),
        mean_force=np.zeros_like(state.force),
        mean_reaction=np.zeros_like(state.reaction),
        counts=np.zeros(2, dtype=np.int64),
        pivots=np.zeros(1),
        tables=new_tables(system, state, chunk, accelerations),
        monitor=new_monitor(state, chunk),
    )


def prepare(workspace: Workspace) -> None:
    """Prepare the state, outside the compiled loop."""
    system = workspace.system
    by_size(evaluate.prepare, size_of(system))(system, workspace.state, workspace.start)


@apart
def record_step(workspace: Workspace, h: float, step: int, row: int) -> None:
    """Write the state accepted after a step ``h`` to row ``step`` of the monitor, and to ``row`` of
    the tables unless that is negative.
    """
    record_figures(workspace.system, workspace.state, workspace.start, h, workspace.monitor, step)
    if row >= 0:
        write_row(workspace, h, row)
    workspace.mean_force[:] = 0.0
    workspace.mean_reaction[:] = 0.0


@apart
def write_row(workspace: Workspace, h: float, row: int) -> None:
    """Write the accepted state to a ``row`` of the tables, with the mean reactions over the step
    ``h`` before it.
    """
    state, tables = workspace.state, workspace.tables
    loads = workspace.mean_force, workspace.mean_reaction, state.time[0] - 0.5 * h
    write_configuration(workspace.system, state, workspace.start, loads, tables, row)
    for k in range(state.work.size):
        tables.work[row, k] = state.work[k]


@kernel
def write_configuration(
    system: System,
    state: State,
    start: SystemWorkspace,
    loads: tuple[np.ndarray, np.ndarray, float],
    tables: Tables,
    row: int,
) -> None:
    """Write the prepared state to a ``row`` of the tables, but for the works; ``loads`` are the
    multipliers' forces, the joints' reactions, and the time at which motions have their powers.
    """
    force, reaction, t = loads
    rigid_body.write_states(
        system.bodies, state.x, state.p, start.frames, state.w, tables.states, row
    )
    reactions.write_reactions(
        system.shown, system.scalar, reaction, force, t, tables.reactions, row
    )
    forces.publish_contacts(system.forces, start.forces, system.scalar, tables.reactions, row)
    for k in range(state.work.size, tables.work.shape[1]):
        tables.work[row, k] = 0.0
    group = system.forces
    forces.publish_signals(
        group.signals, group.actuator, start.forces, system.scalar, tables.signals, row
    )
    forces.publish_energy(group, start.forces, state.work.size, tables.work, row)
    instant.write_resultants(system.beams, force, tables.resultants, row)
    instant.publish_energy(system.beams, start.beams, tables.work, row)


def kind_of(system: System) -> str:
    """Name of the kind of system, which decides on the types of arguments."""
    kind = "points" if system.scalar is None else "along"
    kind += "" if system.beams is None else "-beams"
    kind += "" if system.forces.compliance is None else "-compliance"
    return kind if system.forces.signals is None else f"{kind}-signals"
