"""The scene as the kernels see it: groups of flat arrays.

Nodes of three numbers hold unknowns and equations alike: node 2b is the displacement u of body b
and its force rows, node 2b+1 its turn l Q and its moment rows; after the ground (b = n) come the
joints' multipliers and gaps. The Jacobian is a list of 3 x 3 blocks, one after the other in one
array; block 0 takes what belongs to the ground and is never read.
"""

from typing import NamedTuple

import numpy as np

from msahl.bodies.rigid import Bodies, BodyStart
from msahl.forces.concentrated import ConcentratedLoads, ConcentratedStart
from msahl.joints.coincide import Coincide, CoincideStart


class System(NamedTuple):
    """Constant data of a scene of n bodies; array fields are read-only by convention."""

    bodies: Bodies
    coincide: Coincide
    loads: ConcentratedLoads
    blocks: np.ndarray  # (m, 2) row node and column node of each block; block 0 is (0, 0)
    constant: np.ndarray  # (9 m,) the part of the Jacobian that never changes


class State(NamedTuple):
    """What one step hands to the next; bodies as (n+1, 3), the ground last."""

    x: np.ndarray  # mass centre, inertial axes [m]
    x_low: np.ndarray  # the part of x below its last digit (compensated summation) [m]
    p: np.ndarray  # Wiener-Milenkovic parameters
    v: np.ndarray  # of the mass centre, inertial axes [m/s]
    w: np.ndarray  # body axes [rad/s]
    a: np.ndarray  # acceleration of the mass centre over the last step, inertial axes [m/s^2]
    alpha: np.ndarray  # likewise the angular acceleration, inertial axes [rad/s^2]
    force: np.ndarray  # (k, 3) joint forces over the last step [N]
    a_trend: np.ndarray  # what a changed by from the last step but one to the last
    alpha_trend: np.ndarray  # likewise alpha
    force_trend: np.ndarray  # likewise force
    gap: np.ndarray  # (k, 3) gap the last solution left over, by increments [m]
    work: np.ndarray  # (l,) work of the loads since t = 0 [J]


class Tables(NamedTuple):
    """Rows of results: columns of ``system.names`` without the time."""

    states: np.ndarray  # (rows, 12 n)
    reactions: np.ndarray  # (rows, 3 k) [N]
    work: np.ndarray  # (rows, l) [J]


class Start(NamedTuple):
    """What the step's equations need of its start, in inertial axes; made by ``prepare``."""

    bodies: BodyStart
    coincide: CoincideStart
    loads: ConcentratedStart


def node_count(system: System) -> int:
    """Number of nodes: two a body (the ground included) and one a multiplier."""
    return 2 * system.bodies.inverse_mass.size + system.coincide.a.size


def new_tables(system: System, rows: int) -> Tables:
    """Room for ``rows`` rows of results."""
    n, k = system.bodies.inverse_mass.size - 1, system.coincide.a.size
    return Tables(
        np.zeros((rows, 12 * n)), np.zeros((rows, 3 * k)), np.zeros((rows, system.loads.body.size))
    )


def new_start(system: System, state: State) -> Start:
    """Room for the start of a step; the gap is the state's own array."""
    vectors, matrices = state.x.shape, (*state.x.shape, 3)
    k, n_loads = system.coincide.a.size, system.loads.body.size
    return Start(
        BodyStart(np.zeros(matrices), np.zeros(matrices), np.zeros(vectors), np.zeros(vectors)),
        CoincideStart(np.zeros((k, 3)), np.zeros((k, 3)), state.gap),
        ConcentratedStart(*(np.zeros((n_loads, 3)) for _ in range(3))),
    )
