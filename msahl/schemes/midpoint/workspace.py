"""Work arrays and kernels that both solvers share: accepting a step and showing it."""

from typing import NamedTuple

import numpy as np

from msahl.jit.kernel import kernel
from msahl.schemes.midpoint import equations
from msahl.system.arrays import Start, State, System, Tables, new_start, new_tables, node_count
from msahl.system.diagnostics import Watch, look, new_watch
from msahl.system.unknowns import Unknowns


class Scene(NamedTuple):
    """One island on its way: constant data, what advances, and room to work in."""

    system: System
    unknowns: Unknowns
    state: State
    start: Start
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
    watch: Watch


def new_scene(system: System, unknowns: Unknowns, state: State, chunk: int) -> Scene:
    """Room for chunks of up to ``chunk`` steps."""
    nodes = (node_count(system), 3)
    return Scene(
        system=system,
        unknowns=unknowns,
        state=state,
        start=new_start(system, state),
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
        watch=new_watch(state, chunk),
    )


@kernel
def accept(scene: Scene, h: float, share: float) -> None:
    """Take over the solved step of size ``h``, a ``share`` of the whole one; prepare the next."""
    equations.accept(scene.system, scene.state, scene.start, h, scene.Z, scene.F)
    equations.prepare(scene.system, scene.state, scene.start)
    for k in range(scene.mean_force.shape[0]):
        for i in range(3):
            scene.mean_force[k, i] += share * scene.state.force[k, i]
    for k in range(scene.mean_reaction.shape[0]):
        for i in range(6):
            scene.mean_reaction[k, i] += share * scene.state.reaction[k, i]


@kernel
def show(scene: Scene, h: float, step: int, row: int) -> None:
    """Enter the state accepted after a step ``h`` in row ``step`` of the watch; publish it in
    ``row`` unless that is negative.
    """
    look(scene.system, scene.state, scene.start, h, scene.watch, step)
    if row >= 0:
        equations.publish(
            scene.system,
            scene.state,
            scene.start,
            h,
            scene.mean_reaction,
            scene.mean_force,
            scene.tables,
            row,
        )
    for k in range(scene.mean_force.shape[0]):
        for i in range(3):
            scene.mean_force[k, i] = 0.0
    for k in range(scene.mean_reaction.shape[0]):
        for i in range(6):
            scene.mean_reaction[k, i] = 0.0
