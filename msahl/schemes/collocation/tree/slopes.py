"""Derivatives of the loads by the rates of joint coordinates, for steps that need them.

Where dampers act on small bodies the loads change much within a step, and the iteration of a step
(``tree.step``), which takes them from the iteration before, contracts slowly or not at all. In
place of the mass matrix M at the node i it then takes

    M + h d_i C          C = -dQ/du ,   Q: generalised forces of the loads, u: rates

with numbers d by which I - D^-1 A has no eigenvalue but zero, A the weights of the nodes. By
dampers the iteration then contracts by .23 or less, however stiff they are. All nodes are still
solved at once. C is that of one node, and of it only what is in the pattern of M: the result does
not depend on it, only how soon it is reached. It stays while the iteration contracts well.

Source: P. J. van der Houwen, B. P. Sommeijer, Iterated Runge-Kutta methods on parallel computers,
SIAM J. Sci. Stat. Comput. 12 (1991).
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import ZERO, Vector, add, cross, dot, times
from msahl.elements.constraints import scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.formulations.absolute.frames import moving_count
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import apart, kernel
from msahl.jit.lanes import LANES, load, spread, store
from msahl.ports import forces
from msahl.system.arrays import System, node_count

NUMBERS = {
    1: (1 / 2,),
    2: (1 / 6, 1 / 2),
    3: (0.214643542284, 0.114312285586, 0.339631543482),
    4: (0.115793671467, 0.072431465626, 0.226129954272, 0.313848838657),
}
"""The numbers d of the nodes, by degree."""


class LoadSlopes(NamedTuple):
    """C in the pattern of the mass matrix, and what it is computed from."""

    by_rate: np.ndarray  # (entries,) C
    share: np.ndarray  # (1, LANES) d of each lane
    of_bodies: Derivatives  # by displacements and rotations of bodies and their rates
    block: np.ndarray  # (m,) places of the blocks between bodies
    body: np.ndarray  # (m, 2) of the tree: whose equations, whose motion
    rotates: np.ndarray  # (m, 2) whether it is their rotation


def new_slopes(tree: Tree, system: System, degree: int) -> LoadSlopes:
    """Return the arrays for steps of a ``degree``, without slopes; the ``system`` is that of the
    loads alone.
    """
    entries, frames = int(tree.row[-1]), system.frames
    by_place, by_rate, scratch = np.zeros((3, system.constant.size))
    body, rotates = np.full(node_count(system), -1), np.zeros(node_count(system), dtype=bool)
    for b, f in enumerate(tree.frame):
        if f < moving_count(frames):
            body[[frames.displacement[f], frames.rotation[f]]] = b
            rotates[frames.rotation[f]] = True
    # Block 0 takes what belongs to the ground.
    between = 1 + np.flatnonzero((body[system.blocks[1:]] > 0).all(axis=1))
    lane = np.minimum(np.arange(LANES), degree - 1)
    return LoadSlopes(
        by_rate=np.zeros(entries),
        share=np.array([NUMBERS[degree]])[:, lane],
        of_bodies=Derivatives(by_place, by_rate, scratch, np.zeros((body.size, 3))),
        block=between,
        body=body[system.blocks[between]],
        rotates=rotates[system.blocks[between]],
    )


@apart
def differentiate(
    slopes: LoadSlopes,
    tree: Tree,
    motion: TreeMotion,
    system: System,
    start: forces.ForcesWorkspace,
    reaction: np.ndarray,
    lane: int,
) -> None:
    """Set C to that at the node of ``lane``, where the loads were evaluated last with the joints'
    ``reaction`` (j, 6).
    """
    found, frames = slopes.of_bodies, system.frames
    for i in range(found.by_place.size):
        found.by_place[i] = found.by_rate[i] = 0.0
    scalar.differentiate(system.scalar, start.place, frames, found.still)
    forces.add_derivatives(system.forces, start, system.scalar, frames, reaction, found)
    for entry in range(slopes.by_rate.size):
        slopes.by_rate[entry] = 0.0
    for m in range(slopes.block.size):
        _enter(slopes, tree, motion, frames.length, m, lane)


@kernel
def _enter(
    slopes: LoadSlopes, tree: Tree, motion: TreeMotion, length: np.ndarray, m: int, lane: int
) -> None:
    """Add the block ``m``, in a lane, between all coordinates on the paths to both its bodies."""
    block = _block_at(slopes.of_bodies.by_rate, 9 * slopes.block[m])
    if block == NO_SLOPE:
        return
    b, c = slopes.body[m, 0], slopes.body[m, 1]
    factor = -tree.mass[b]
    if slopes.rotates[m, 0]:
        factor *= length[tree.frame[b]]
    if slopes.rotates[m, 1]:
        factor *= length[tree.frame[c]]
    for k in range(tree.body.size):
        if not tree.precedes[k, b]:
            continue
        S, j = _motion_of(motion, k, b, slopes.rotates[m, 0], lane), k
        for entry in range(tree.row[k], tree.row[k + 1]):
            if tree.precedes[j, c]:
                own = times(block, _motion_of(motion, j, c, slopes.rotates[m, 1], lane))
                slopes.by_rate[entry] += factor * dot(S, own)
            j = tree.before[j]


NO_SLOPE = (ZERO, ZERO, ZERO)


@kernel
def _block_at(values: np.ndarray, i: int) -> tuple[Vector, Vector, Vector]:
    """Block of 3 x 3 that begins at place ``i``."""
    return (
        (values[i], values[i + 1], values[i + 2]),
        (values[i + 3], values[i + 4], values[i + 5]),
        (values[i + 6], values[i + 7], values[i + 8]),
    )


@kernel
def _motion_of(motion: TreeMotion, k: int, b: int, rotates: bool, lane: int) -> Vector:
    """Velocity of the mass centre of body ``b``, or its angular velocity, by a unit rate of
    coordinate ``k``.
    """
    screw, place = motion.screw, motion.place
    a = (screw[6 * k, lane], screw[6 * k + 1, lane], screw[6 * k + 2, lane])
    if rotates:
        return a
    s = (screw[6 * k + 3, lane], screw[6 * k + 4, lane], screw[6 * k + 5, lane])
    c = (place[3 * b, lane], place[3 * b + 1, lane], place[3 * b + 2, lane])
    return add(s, cross(a, c))


@kernel
def add_to(slopes: LoadSlopes, M: np.ndarray, h: float) -> None:
    """Add the slopes to the mass matrices ``M`` (entries, LANES) of all nodes of a step ``h``."""
    share = h * load(slopes.share, 0)
    for entry in range(slopes.by_rate.size):
        store(M, entry, load(M, entry) + spread(slopes.by_rate[entry]) * share)
