"""Point masses that move as a reduced body does: its inertia invariants as sums over few particles.

A point of the body is at x + sum_j phi_j a_j in the floating frame, so the kinetic energy needs no
more of the mass than its second moments by c = (1, x, phi_1, ..., phi_q):

    S = integral c c^T dm    (4 + 3 q, 4 + 3 q)        = sum_i m_i c_i c_i^T

``moments`` takes S from the invariants: all of these are sums over its entries. Any factor of
S = L L^T gives particles, L rotated so that the first entries of its columns are alike: equal
masses, as many as the rank of S. Bodies that carry joints and amplitudes take a small ``SHARE`` of
the mass beforehand (``carriers``). Beams have modes, as torsion, whose inertia is that of rotations
of sections, and no masses on their line have it: what is left is then replaced by the nearest S
that is possible and has the same mass, inertia, first moments, couplings of rates (translation,
rotation) and modal masses. ``deviation`` is by how much the other entries of S differ.

Amplitudes a_j are in metres, the largest displacement of a node. Sources: Wittenburg, Dynamics of
Systems of Rigid Bodies (1977), for points in place of a body; Boyle, Dykstra 1986, for the nearest.
"""

from dataclasses import dataclass

import numpy as np

from msahl.reduction.body import ReducedBody
from msahl.reduction.invariants import Invariants
from msahl.reduction.rigid import EPSILON

SHARE = 1e-4
"""Part of the mass, and of the modal masses, that the frame, nodes and amplitudes each take. The
deviation is of this size; with less, forces on these bodies have more round-off."""
MOST_TAKEN = 0.9
"""Part of the smallest second moment of mass that they take together."""
NEGLIGIBLE = 1e-13
"""Eigenvalue of S, in units of its diagonal, below which there is no mass."""
CLOSE = 1e-6
"""Negative eigenvalue, by the largest, at which S is near enough to a possible one: corrections
make the exact entries exact."""
MOST_STEPS = 200
"""Steps towards the nearest possible S; and of the corrections that make its equations exact."""


@dataclass(frozen=True, eq=False, slots=True)
class Masses:
    """Bodies b that follow a frame: places (b, 3) [m], shapes (b, 3, q) and rotations (b, 3, q)
    [1/m] by the amplitudes, masses (b,) [kg], spherical inertias (b,) [kg-m^2]."""

    place: np.ndarray
    shape: np.ndarray
    rotation: np.ndarray
    mass: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class Particles:
    """A reduced body as masses: the frame, amplitudes (three to a body), squares and sums of
    amplitudes likewise, nodes, particles."""

    frame: Masses
    amplitudes: Masses
    squares: Masses
    sums: Masses
    nodes: Masses
    points: Masses
    scale: np.ndarray  # (q,) amplitude of unit modal mass by amplitude in metres [sqrt(kg)]
    deviation: float


def particles(body: ReducedBody, sums: np.ndarray | None = None, squares: int = 0) -> Particles:
    """Return the particles of a reduced body, beside bodies that carry so many ``squares`` and the
    ``sums`` (m, q) of amplitudes."""
    scale = amplitude_scale(body)
    q = scale.size
    S = moments(body.invariants) * np.outer(*[np.r_[np.ones(4), np.repeat(scale, 3)]] * 2)
    modal = scale**2
    sums = np.zeros((0, q)) if sums is None else sums
    trace = _round_inertia(body, sum(-(-n // 3) for n in (q, squares, len(sums))))
    inertia = trace / 3.0
    frame, amplitudes, nodes = carriers(body, scale, inertia)
    carried = sum_carriers(sums, modal, amplitudes.inertia[0])
    squared = square_carriers(squares, q, body.invariants.mass, inertia)
    spin = SHARE * trace / (3.0 * (4 + 3 * q))
    taken = _moments_of(frame)
    for one in (amplitudes, squared, carried, nodes):
        taken += _moments_of(one)
    taken[1:4, 1:4] += 0.5 * spin * (4 + 3 * q) * np.eye(3)
    units = _units(S, modal)
    wanted = (S - taken) / np.outer(units, units)
    L = _factor(_nearest(wanted))
    L = _corrected(L, wanted)
    difference = np.abs(L @ L.T - wanted)
    points = _points(L * units[:, None], spin * (4 + 3 * q))
    return Particles(
        frame, amplitudes, squared, carried, nodes, points, scale, float(difference.max())
    )


def moments(given: Invariants) -> np.ndarray:
    """Return S of the invariants, by amplitudes of unit modal mass; those of components that are
    not the same along all axes, as beams have, contradict each other: the rates' are kept."""
    q = given.translation.shape[1]
    S = np.zeros((4 + 3 * q, 4 + 3 * q))
    S[0, 0] = given.mass
    S[1:4, 1:4] = 0.5 * np.trace(given.inertia) * np.eye(3) - given.inertia
    S[0, 4:] = given.translation.T.ravel()
    slope, curve = given.inertia_slope, given.inertia_curve
    # The inertia slope is 2 tr X - X - X^T, and the rotation X's antisymmetric part.
    X = 0.5 * (0.5 * np.eye(3)[:, :, None] * np.einsum("iij", slope) - slope)
    X += 0.5 * np.einsum("abi,ij->abj", EPSILON, given.rotation)
    S[1:4, 4:] = X.transpose(0, 2, 1).reshape(3, 3 * q)
    curve = 0.5 * (curve + curve.transpose(1, 0, 2, 3))
    curve = 0.5 * (curve + curve.transpose(0, 1, 3, 2))
    # Their P has the trace 1 of unit modal mass; the curve is tr P - P.
    P = np.einsum("ab,jk->abjk", np.eye(3), (np.einsum("iijk", curve) + np.eye(q)) / 3.0) - curve
    P += 0.5 * np.einsum("abi,ijk->abjk", EPSILON, given.gyration)
    S[4:, 4:] = P.transpose(2, 0, 3, 1).reshape(3 * q, 3 * q)
    upper = np.triu(S)
    result: np.ndarray = upper + np.triu(S, 1).T
    return result


def _round_inertia(body: ReducedBody, count: int) -> float:
    """Return three times the inertia [kg-m^2] of which ``count`` carriers, the frame, nodes and
    particles each take a ``SHARE``: the trace, or less of bodies so slender that this were too
    much. Nodes mostly take less than the others."""
    J = body.invariants.inertia
    trace, thinnest = np.trace(J), 0.5 * np.trace(J) - np.linalg.eigvalsh(J)[-1]
    each = SHARE * trace / 6.0  # what a round inertia adds to the second moment
    if each * (count + 2) > MOST_TAKEN * thinnest:
        trace *= MOST_TAKEN * thinnest / (each * (count + 2 + len(body.interface_names)))
    return float(trace)


def carriers(body: ReducedBody, scale: np.ndarray, inertia: float) -> tuple[Masses, Masses, Masses]:
    """Return the bodies that carry the frame, the amplitudes and the nodes of the interface, which
    take a ``SHARE`` of this ``inertia``."""
    q, modal = scale.size, scale**2
    mass = body.invariants.mass
    frame = _still(SHARE * mass, SHARE * inertia, q)
    count = -(-q // 3)
    shape = np.eye(3 * count)[:, :q].reshape(count, 3, q)
    least = np.array([modal[3 * k : 3 * k + 3].min() for k in range(count)])
    zero = np.zeros((count, 3))
    amplitudes = Masses(zero, shape, 0.0 * shape, SHARE * least, np.full(count, SHARE * inertia))
    moved, rotated = (body.interface_shapes[:, part] * scale for part in (slice(3), slice(3, 6)))
    nodes = Masses(
        body.interface_places,
        moved,
        rotated * body.interface_rotates[:, None, None],
        SHARE * np.minimum(mass, _lowest(modal, moved)),
        SHARE * np.minimum(inertia, _lowest(modal, rotated)),
    )
    return frame, amplitudes, nodes


def square_carriers(count: int, q: int, mass: float, inertia: float) -> Masses:
    """Return bodies that carry ``count`` squares of q amplitudes, with a ``SHARE`` of ``mass`` and
    ``inertia`` each: it counts to fourth order in the amplitudes."""
    b = -(-count // 3)
    still = np.zeros((b, 3, q))
    own = np.full(b, SHARE * mass), np.full(b, SHARE * inertia)
    return Masses(np.zeros((b, 3)), still, still, *own)


def sum_carriers(sums: np.ndarray, modal: np.ndarray, inertia: float) -> Masses:
    """Return bodies that three of the ``sums`` (m, q) of amplitudes each move along x, y and z."""
    m, q = sums.shape
    count = -(-m // 3)
    shape = np.zeros((3 * count, q))
    shape[:m] = sums
    shape = shape.reshape(count, 3, q)
    least = np.array([modal[one.any(axis=0)].min() for one in shape])
    zero = np.zeros((count, 3))
    return Masses(zero, shape, 0.0 * shape, SHARE * least, np.full(count, inertia))


def amplitude_scale(body: ReducedBody) -> np.ndarray:
    """Return the amplitudes (q,) of unit modal mass at which a node moves by a metre at most."""
    moved = np.concatenate([body.node_shapes, body.interface_shapes[:, :3]])
    largest: np.ndarray = np.sqrt((moved**2).sum(axis=1)).max(axis=0)
    rotated = np.sqrt((body.interface_shapes[:, 3:] ** 2).sum(axis=1)).max(axis=0)
    size = np.sqrt(np.trace(body.invariants.inertia) / body.invariants.mass)
    return 1.0 / np.maximum(largest, 1e-3 * size * rotated)


def _lowest(modal: np.ndarray, shapes: np.ndarray) -> np.ndarray:
    """Return what (p,) of mass or inertia at a node has the modal mass of some mode by itself."""
    squares = (shapes**2).sum(axis=1)
    with np.errstate(divide="ignore"):
        found: np.ndarray = (modal / squares).min(axis=1)
    return found


def _still(mass: float, inertia: float, q: int) -> Masses:
    """Return one body at the origin that no amplitude moves."""
    zero = np.zeros((1, 3, q))
    return Masses(np.zeros((1, 3)), zero, zero, np.array([mass]), np.array([inertia]))


def _moments_of(bodies: Masses) -> np.ndarray:
    """Return S of bodies, whose rotations count as if points about them moved linearly."""
    count, _, q = bodies.shape.shape
    moved = bodies.shape.transpose(0, 2, 1).reshape(count, 3 * q)
    rows = np.hstack([np.ones((count, 1)), bodies.place, moved])
    S = np.einsum("b,bi,bj->ij", bodies.mass, rows, rows)
    for axis in np.eye(3):
        around = np.cross(bodies.rotation.transpose(0, 2, 1), axis).reshape(count, 3 * q)
        rows = np.hstack([np.zeros((count, 1)), np.tile(axis, (count, 1)), around])
        S += np.einsum("b,bi,bj->ij", 0.5 * bodies.inertia, rows, rows)
    result: np.ndarray = S
    return result


def _units(S: np.ndarray, modal: np.ndarray) -> np.ndarray:
    """Return the units (4 + 3 q,) in which the entries of S are compared."""
    size = np.sqrt(np.trace(S[1:4, 1:4]) / 3.0)
    return np.r_[np.sqrt(S[0, 0]), np.full(3, size), np.repeat(np.sqrt(modal), 3)]


def _nearest(wanted: np.ndarray) -> np.ndarray:
    """Return the possible S nearest to the ``wanted`` one whose exact entries are the same, nearly:
    projections on both sets in rotation, with Dykstra's corrections."""
    S, correction = wanted, np.zeros_like(wanted)
    for _ in range(MOST_STEPS):
        given = S + correction
        values, V = np.linalg.eigh(given)
        possible = (V * np.maximum(values, 0.0)) @ V.T
        if values.min() > -CLOSE * values.max():
            return possible
        correction = given - possible
        S = possible + _missing(possible, wanted)
    return possible


def _missing(S: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return what S lacks of the entries that must be exact: mass, inertia, first moments,
    rotations' couplings of rates, modal masses."""
    lack, q = np.zeros_like(S), (len(S) - 4) // 3
    left = wanted - S
    lack[:4, :4] = left[:4, :4]
    lack[0, 4:] = left[0, 4:]
    X = left[1:4, 4:].reshape(3, q, 3)
    lack[1:4, 4:] = (0.5 * (X - X.transpose(2, 1, 0))).reshape(3, 3 * q)
    P = np.trace(left[4:, 4:].reshape(q, 3, q, 3), axis1=1, axis2=3) / 3.0
    lack[4:, 4:] = np.kron(P, np.eye(3))
    lack[4:, :4] = lack[:4, 4:].T
    return lack


def _factor(S: np.ndarray) -> np.ndarray:
    """Return L (n, r) with L L^T = S."""
    values, V = np.linalg.eigh(S)
    kept = values > NEGLIGIBLE * values.max()
    result: np.ndarray = V[:, kept] * np.sqrt(values[kept])
    return result


def _corrected(L: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return L with the exact entries of L L^T as ``wanted``: each group of rows in rotation."""
    q = (len(L) - 4) // 3
    target = np.trace(wanted[4:, 4:].reshape(q, 3, q, 3), axis1=1, axis2=3)
    rigid = _congruent(L[:4] @ L[:4].T, wanted[:4, :4]) @ L[:4]
    moved = L[4:]
    for _ in range(MOST_STEPS):
        S = np.vstack([rigid, moved])
        lack = _missing(S @ S.T, wanted)
        if np.abs(lack).max() < 1e-15 * np.abs(wanted).max():
            break
        moved = moved + np.linalg.solve(wanted[:4, :4], lack[:4, 4:]).T @ rigid
        rows = moved.reshape(q, 3, -1)
        A = _congruent(np.einsum("jar,kar->jk", rows, rows), target)
        moved = np.einsum("jk,kar->jar", A, rows).reshape(3 * q, -1)
    return np.vstack([rigid, moved])


def _congruent(given: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return the A nearest to 1, in a sense, with A given A^T = wanted."""
    result: np.ndarray = np.linalg.cholesky(wanted) @ np.linalg.inv(np.linalg.cholesky(given))
    return result


def _points(L: np.ndarray, spin: float) -> Masses:
    """Return particles of equal masses of the factor L of S; ``spin`` is the sum of inertias."""
    r, q = L.shape[1], (len(L) - 4) // 3
    first = L[0] / np.linalg.norm(L[0])
    even = np.full(r, 1.0 / np.sqrt(r))
    mirror = first - even  # Householder's reflection takes ``first`` to ``even``
    if (size := mirror @ mirror) > 0.0:
        L = L - np.outer(L @ mirror, 2.0 / size * mirror)
    mass = np.full(r, (L[0] ** 2).mean())
    columns = L / np.sqrt(mass)
    shape = columns[4:].T.reshape(r, q, 3).transpose(0, 2, 1)
    return Masses(columns[1:4].T, shape, 0.0 * shape, mass, np.full(r, spin / r))
