"""Work arrays and kernels that both solvers share: accepting a step and showing it."""

from typing import NamedTuple

import numpy as np

from msahl.jit.kernel import kernel
from msahl.schemes.midpoint import equations
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
from msahl.system.diagnostics import Monitor, look, new_monitor
from msahl.system.unknowns import Unknowns


class Workspace(NamedTuple):
    """One island on its way: constant data, what advances, and room to work in."""

    system: System
    unknowns: Unknowns
    state: State
    start: SystemWorkspace
    Z: np.ndarray  # (nodes, 3) unknowns of the step
    F: np.ndarray  # (nodes, 3) its rows
    values: np.ndarray  # block values of the Jacobian
    factor: np.ndarray  # its sparse factors
    y: np.ndarray  # (f,) right-hand side, in the order of elimination
    mean_force: np.ndarray  # (k, 3) multipliers over the step being taken, halves added up
    mean_reaction: np.ndarray  # (j, 6) likewise the joints' reactions [N, N m]
    counts: np.ndarray  # (2,) iterations and factorisations so far
    pivots: np.ndarray  # (1,) widest spread of a Jacobian's pivots so far
    tables: Tables
    monitor: Monitor


def new_workspace(system: System, unknowns: Unknowns, state: State, chunk: int) -> Workspace:
    """Room for chunks of up to ``chunk`` steps."""
    nodes = (node_count(system), 3)
    return Workspace(
        system=system,
        unknowns=unknowns,
        state=state,
        start=new_system_workspace(system, state),
        Z=np.zeros(nodes),
        F=np.zeros(nodes),
        values=np.zeros_like(system.constant),
        factor=np.zeros(int(unknowns.elimination.base[-1])),
        y=np.zeros(unknowns.free.size),
        mean_force=np.zeros_like(state.force),
        mean_reaction=np.zeros_like(state.reaction),
        counts=np.zeros(2, dtype=np.int64),
        pivots=np.zeros(1),
        tables=new_tables(system, state, chunk),
        monitor=new_monitor(state, chunk),
    )


@kernel
def accept(workspace: Workspace, h: float, share: float) -> None:
    """Take over the solved step of size ``h``, a ``share`` of the whole one; prepare the next."""
    equations.accept(
        workspace.system, workspace.state, workspace.start, h, workspace.Z, workspace.F
    )
    evaluate.prepare(workspace.system, workspace.state, workspace.start)
    for k in range(workspace.mean_force.shape[0]):
        for i in range(3):
            workspace.mean_force[k, i] += share * workspace.state.force[k, i]
    for k in range(workspace.mean_reaction.shape[0]):
        for i in range(6):
            workspace.mean_reaction[k, i] += share * workspace.state.reaction[k, i]


@kernel
def show(workspace: Workspace, h: float, step: int, row: int) -> None:
    """Enter the state accepted after a step ``h`` in row ``step`` of the watch; publish it in
    ``row`` unless that is negative.
    """
    look(workspace.system, workspace.state, workspace.start, h, workspace.monitor, step)
    if row >= 0:
        equations.publish(
            workspace.system,
            workspace.state,
            workspace.start,
            h,
            workspace.mean_reaction,
            workspace.mean_force,
            workspace.tables,
            row,
        )
    for k in range(workspace.mean_force.shape[0]):
        for i in range(3):
            workspace.mean_force[k, i] = 0.0
    for k in range(workspace.mean_reaction.shape[0]):
        for i in range(6):
            workspace.mean_reaction[k, i] = 0.0
