"""Solutions with the slopes of stiff loads, which make an iteration one of Newton's method.

Where loads change much within a step, as those of stiff springs and of dampers on small bodies do,
the iteration of a step (``tree.step``) contracts slowly or not at all: it takes the loads from the
iteration before. A correction x of the rates at all nodes then solves

    M x_i + h C sum_j a_ij x_j + h^2 K sum_jk a_ij a_jk x_k = y_i       C = -dQ/du ,   K = -dQ/dq

for the residuals y, in place of M_i x_i = y_i; Q: generalised forces of the loads, M: mean of the
mass matrices. With A = T L T^-1, the rows of T^-1 x are those of single systems

    (M + h l C + h^2 l^2 K) z_l = (T^-1 y)_l        l: eigenvalue of A

of which there is one for each pair of conjugate eigenvalues. They stand in the lanes, with their
real and imaginary parts apart. Where C and K have no negative eigenvalue no pivots are needed: some
multiple of the matrix has a positive definite real part. The result of a step does not depend on
these matrices, only how soon it is reached.

Source: E. Hairer, G. Wanner, Solving Ordinary Differential Equations II (1996), section IV.8.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.lanes import integral
from msahl.algebra.vector import ZERO, Vector, add, cross, dot, times
from msahl.elements.constraints import scalar
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.formulations.absolute.frames import moving_count
from msahl.formulations.tree import mass_matrix
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import apart, kernel, optional, unit
from msahl.jit.lanes import LANES, load, store
from msahl.ports import forces
from msahl.schemes.collocation.tableau import lagrange
from msahl.system.arrays import System, node_count


class LoadSlopes(NamedTuple):
    """C, K and the factors of the systems of e eigenvalues; real parts first, then imaginary."""

    used: np.ndarray  # (1,) 1 where corrections are those with slopes; 0: by mass matrices alone
    by_rate: np.ndarray  # (n, n) C
    by_place: np.ndarray  # (n, n) K
    filled: np.ndarray  # (n, n) whether the factors have an entry there
    of_bodies: Derivatives  # by displacements and rotations of bodies and their rates
    block: np.ndarray  # (m,) places of the blocks between bodies
    body: np.ndarray  # (m, 2) of the tree: whose equations, whose motion
    rotates: np.ndarray  # (m, 2) whether it is their rotation
    eigenvalue: np.ndarray  # (2, LANES)
    from_nodes: np.ndarray  # (2, s, LANES) T^-1: lane l of row j
    to_nodes: np.ndarray  # (2, e, LANES) T, twice where it stands for a pair: lane i of row l
    factors: np.ndarray  # (2, n n, LANES)
    z: np.ndarray  # (2, n, LANES)


def new_slopes(tree: Tree, system: System, nodes: np.ndarray) -> LoadSlopes:
    """Return the arrays for steps with nodes at c (s,); the ``system`` is that of the loads
    alone.
    """
    frames, n = system.frames, tree.body.size
    by_place, by_rate, scratch = np.zeros((3, system.constant.size))
    body, rotates = np.full(node_count(system), -1), np.zeros(node_count(system), dtype=bool)
    for b, f in enumerate(tree.frame):
        if f < moving_count(frames):
            body[[frames.displacement[f], frames.rotation[f]]] = b
            rotates[frames.rotation[f]] = True
    # Block 0 takes what belongs to the ground.
    between = 1 + np.flatnonzero((body[system.blocks[1:]] > 0).all(axis=1))
    bodies = body[system.blocks[between]]
    eigenvalue, from_nodes, to_nodes = decoupled(lagrange(nodes, nodes, -1))
    return LoadSlopes(
        used=np.zeros(1),
        by_rate=np.zeros((n, n)),
        by_place=np.zeros((n, n)),
        filled=_filled(tree, bodies),
        of_bodies=Derivatives(by_place, by_rate, scratch, np.zeros((body.size, 3))),
        block=between,
        body=bodies,
        rotates=rotates[system.blocks[between]],
        eigenvalue=eigenvalue,
        from_nodes=from_nodes,
        to_nodes=to_nodes,
        factors=np.zeros((2, n * n, LANES)),
        z=np.zeros((2, n, LANES)),
    )


def decoupled(A: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the eigenvalues of ``A`` (s, s), one of each pair, as (2, LANES), with T^-1 and T as
    (2, s, LANES) and (2, e, LANES): real parts first.
    """
    eigenvalue, T = np.linalg.eig(A)
    one = np.flatnonzero(eigenvalue.imag > -1e-12)  # real ones of A are known to round-off
    weight = np.where(eigenvalue[one].imag > 1e-12, 2.0, 1.0)
    of_lane = np.minimum(np.arange(LANES), one.size - 1)
    of_node = np.minimum(np.arange(LANES), len(A) - 1)
    given = (
        eigenvalue[one][of_lane],
        np.linalg.inv(T)[one][of_lane].T,
        (weight * T[:, one])[of_node].T,
    )
    found = tuple(np.ascontiguousarray([part.real, part.imag]) for part in given)
    return found[0], found[1], found[2]


def _filled(tree: Tree, bodies: np.ndarray) -> np.ndarray:
    """Return (n, n) where factors of M and of blocks between the ``bodies`` (m, 2) have entries,
    where the last coordinates are eliminated first.
    """
    n = tree.body.size
    found = np.eye(n, dtype=bool)
    for k in range(n):
        found[k, tree.precedes[:, tree.body[k]].nonzero()[0]] = True
    for b, c in bodies:
        found |= np.outer(tree.precedes[:, b], tree.precedes[:, c])
    found |= found.T
    for k in range(n - 1, -1, -1):
        found[:k, :k] |= np.outer(found[:k, k], found[k, :k])
    return found


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
    """Set C and K to those at the node of ``lane``, where the loads were evaluated last with
    the joints' ``reaction`` (j, 6).
    """
    found, frames = slopes.of_bodies, system.frames
    for i in range(found.by_place.size):
        found.by_place[i] = found.by_rate[i] = 0.0
    scalar.differentiate(system.scalar, start.place, frames, found.still)
    forces.add_derivatives(system.forces, start, system.scalar, frames, reaction, found)
    for k in range(tree.body.size):
        for j in range(tree.body.size):
            slopes.by_place[k, j] = slopes.by_rate[k, j] = 0.0
    for m in range(slopes.block.size):
        b, c = slopes.body[m, 0], slopes.body[m, 1]
        row = tree.mass[b] * (frames.length[tree.frame[b]] if slopes.rotates[m, 0] else 1.0)
        column = frames.length[tree.frame[c]] if slopes.rotates[m, 1] else 1.0
        _enter(slopes, tree, motion, (m, lane), -row * column, found.by_place, slopes.by_place)
        _enter(slopes, tree, motion, (m, lane), -row * column, found.by_rate, slopes.by_rate)


@kernel
def _enter(
    slopes: LoadSlopes,
    tree: Tree,
    motion: TreeMotion,
    of: tuple[int, int],
    factor: float,
    blocks: np.ndarray,
    out: np.ndarray,
) -> None:
    """Add ``factor`` times a block, in a lane, between all coordinates on the paths to its two
    bodies.
    """
    m, lane = of
    block = _block_at(blocks, 9 * slopes.block[m])
    if block == NO_SLOPE:
        return
    b, c = slopes.body[m, 0], slopes.body[m, 1]
    for j in range(tree.body.size):
        if tree.precedes[j, c]:
            own = times(block, _motion_of(motion, j, c, slopes.rotates[m, 1], lane))
            for k in range(tree.body.size):
                if tree.precedes[k, b]:
                    S = _motion_of(motion, k, b, slopes.rotates[m, 0], lane)
                    out[k, j] += factor * dot(S, own)


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


@optional()
def use(slopes: LoadSlopes, whether: float) -> None:
    """Let corrections be those with slopes, or by mass matrices alone."""
    slopes.used[0] = whether


@optional(False)
def are_used(slopes: LoadSlopes) -> bool:
    """Whether corrections are those with slopes, which couple the nodes."""
    return bool(slopes.used[0] > 0.0)


STIFFEST = 1e4
"""Largest change by a load's slope in a step, h C + h^2 K, over the inertia. Loads are functions of
places, which are known to round-off: what that makes of a step's velocities is as much larger."""


@optional(True)
def set_factors(slopes: LoadSlopes, tree: Tree, motion: TreeMotion, h: float) -> bool:
    """Set the factors of the systems of a step ``h``, after C and K; return whether round-off of
    the loads is small in it.
    """
    mass_matrix.set_matrix(tree, motion)
    for k in range(tree.body.size):
        change = h * abs(slopes.by_rate[k, k]) + h * h * abs(slopes.by_place[k, k])
        # Written so that a nan counts.
        if not change <= STIFFEST * motion.mass[tree.row[k], 0]:
            return False
    _factor(slopes, tree, motion, h)
    return True


@unit
def _factor(slopes: LoadSlopes, tree: Tree, motion: TreeMotion, h: float) -> None:
    """Set the factors of the systems of a step ``h``, after C, K and the mass matrices."""
    real, imaginary = slopes.factors[0], slopes.factors[1]
    n, s = tree.body.size, slopes.from_nodes.shape[1]
    l_real, l_imaginary = load(slopes.eigenvalue, 0), load(slopes.eigenvalue, 1)
    of_rate, of_rate_too = h * l_real, h * l_imaginary
    of_place = of_rate * of_rate - of_rate_too * of_rate_too
    of_place_too = 2.0 * of_rate * of_rate_too
    for k in range(n):
        for j in range(n):
            C, K = slopes.by_rate[k, j], slopes.by_place[k, j]
            store(real, n * k + j, C * of_rate + K * of_place)
            store(imaginary, n * k + j, C * of_rate_too + K * of_place_too)
    for k in range(n):
        j = k
        for entry in range(tree.row[k], tree.row[k + 1]):
            mean = 0.0
            for i in range(s):
                mean += motion.mass[entry, i] / s
            store(real, n * k + j, load(real, n * k + j) + mean)
            if j != k:
                store(real, n * j + k, load(real, n * j + k) + mean)
            j = tree.before[j]
    for k in range(n - 1, -1, -1):
        _eliminate(slopes, real, imaginary, n, k)


@kernel
def _eliminate(slopes: LoadSlopes, real: np.ndarray, imaginary: np.ndarray, n: int, k: int) -> None:
    """Eliminate the unknown ``k`` from the equations before its own, which then has 1/pivot."""
    own = n * k + k
    a, b = load(real, own), load(imaginary, own)
    size = 1.0 / (a * a + b * b)
    a, b = a * size, 0.0 - b * size
    store(real, own, a)
    store(imaginary, own, b)
    for i in range(k):
        if not slopes.filled[i, k]:
            continue
        x, y = load(real, n * i + k), load(imaginary, n * i + k)
        u, v = x * a - y * b, x * b + y * a
        store(real, n * i + k, u)
        store(imaginary, n * i + k, v)
        for j in range(k):
            if slopes.filled[k, j]:
                x, y, place = load(real, n * k + j), load(imaginary, n * k + j), n * i + j
                store(real, place, load(real, place) - (u * x - v * y))
                store(imaginary, place, load(imaginary, place) - (u * y + v * x))


@kernel
def correct(slopes: LoadSlopes | None, tree: Tree, motion: TreeMotion) -> None:
    """Replace the residuals ``motion.y`` by the corrections of the rates."""
    if are_used(slopes):
        solve(slopes, tree, motion)
    else:
        mass_matrix.solve(tree, motion)


@optional()
def solve(slopes: LoadSlopes, tree: Tree, motion: TreeMotion) -> None:
    """Replace ``motion.y`` by the solution of the systems of all nodes."""
    _solve(slopes, tree, motion)


@unit
def _solve(slopes: LoadSlopes, tree: Tree, motion: TreeMotion) -> None:
    """As ``solve``, on its own."""
    y, n = motion.y, tree.body.size
    z_real, z_imaginary = slopes.z[0], slopes.z[1]
    for k in range(n):
        store(z_real, k, integral(y, k, slopes.from_nodes[0], 1.0))
        store(z_imaginary, k, integral(y, k, slopes.from_nodes[1], 1.0))
    _substitute(slopes, n)
    for k in range(n):
        found = integral(z_real, k, slopes.to_nodes[0], 1.0)
        store(y, k, found - integral(z_imaginary, k, slopes.to_nodes[1], 1.0))


@kernel
def _substitute(slopes: LoadSlopes, n: int) -> None:
    """Replace ``slopes.z`` by the solutions of the systems."""
    real, imaginary = slopes.factors[0], slopes.factors[1]
    z_real, z_imaginary = slopes.z[0], slopes.z[1]
    for k in range(n - 1, -1, -1):
        a, b = load(z_real, k), load(z_imaginary, k)
        for i in range(k):
            if slopes.filled[i, k]:
                u, v = load(real, n * i + k), load(imaginary, n * i + k)
                store(z_real, i, load(z_real, i) - (u * a - v * b))
                store(z_imaginary, i, load(z_imaginary, i) - (u * b + v * a))
    for k in range(n):
        a, b = load(z_real, k), load(z_imaginary, k)
        for j in range(k):
            if slopes.filled[k, j]:
                u, v = load(real, n * k + j), load(imaginary, n * k + j)
                x, y = load(z_real, j), load(z_imaginary, j)
                a, b = a - (u * x - v * y), b - (u * y + v * x)
        u, v = load(real, n * k + k), load(imaginary, n * k + k)
        store(z_real, k, a * u - b * v)
        store(z_imaginary, k, a * v + b * u)
