"""Which unknowns a scene needs: exact reductions, read off the first state.

*Ballistic*: the mass centre of a body that nothing but gravity touches moves by u = h v + h^2 g/2,
which is the time element's own answer; only its turn is left to solve for.

*Planar*: if every mass centre, arm, force and velocity lies in one coordinate plane of the inertial
axes, and every spin, moment and one principal axis of each body is its normal, then by mirror
symmetry all stays so; three unknowns a body and two a coinciding point are left. The test asks
for exact zeros, so nothing is neglected. (Distances between parallel planes would make moments;
they do not count as planar.)
"""

import numpy as np

from msahl.system.arrays import Start, System, node_count

TURNS = 1
"""Parity of the nodes that hold turns."""


def plane_normal(system: System, start: Start) -> int | None:
    """Index of the inertial axis along which nothing ever happens, or None; ``start`` prepared."""
    for axis in (1, 2, 0):
        if _is_planar(system, start, axis):
            return axis
    return None


def _is_planar(system: System, start: Start, axis: int) -> bool:
    in_plane = [i for i in range(3) if i != axis]
    ground = system.bodies.inverse_mass.size - 1
    bodies, coincide, loads = start.bodies, start.coincide, start.loads
    # The ground's arms are places, not levers; a load's arm matters only where a force acts.
    arms_a = coincide.r_a[system.coincide.a != ground, axis]
    arms_b = coincide.r_b[system.coincide.b != ground, axis]
    levers = loads.r[:, axis, None] * loads.f
    along = (
        system.bodies.gravity[axis],
        bodies.v[:, axis],
        arms_a,
        arms_b,
        loads.f[:, axis],
        levers,
    )
    across = (bodies.W, bodies.J[:, axis], bodies.J[:, :, axis], loads.m)
    return not any(np.any(a) for a in along) and not any(np.any(a[:, in_plane]) for a in across)


def all_unknowns(system: System) -> np.ndarray:
    """(f,) every flat unknown but the ground's six."""
    needed = np.ones((node_count(system), 3), dtype=bool)
    n = system.bodies.inverse_mass.size
    needed[2 * n - 2 : 2 * n] = False
    return np.flatnonzero(needed)


def needed_unknowns(system: System, axis: int | None) -> np.ndarray:
    """(f,) the flat unknowns left to solve for."""
    n = system.bodies.inverse_mass.size
    nodes = node_count(system)
    needed = np.zeros((nodes, 3), dtype=bool)
    needed.reshape(-1)[all_unknowns(system)] = True
    needed[0 : 2 * n : 2][system.bodies.ballistic] = False
    if axis is not None:
        kept = np.arange(3) == axis
        turns = np.arange(nodes) % 2 == TURNS
        turns[2 * n :] = False
        needed[turns] &= kept
        needed[~turns] &= ~kept
    return np.flatnonzero(needed)
