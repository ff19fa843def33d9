"""Displacements of second order of a mesh of beams, by the kinematics of rods.

The strains of a rod are those of its modes, to first order in the amplitudes: the elastic energy is
then exactly theirs. With the rotation theta of first order and the strain gamma = u' - theta x t,
all in the axes of the frame, the section's rotation is A = 1 + [theta] + [theta]^2/2 + [beta] and
its place r' = A (t + gamma), so

    beta' = theta x theta'/2            psi' = theta x (gamma + theta x t/2) + beta x t

which is the shortening -w'^2/2 of a bent rod, and the lateral displacement of one that is bent and
twisted. They are integrated along the mesh from one of its nodes, exactly: theta is quadratic in an
element (``beams``). Source: Simo, Vu-Quoc, Int. J. Solids Structures 27 (1991), for the expansion.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import breadth_first_order

from msahl.reduction.body import ReducedBody
from msahl.reduction.faults import ReductionError
from msahl.reduction.mesh.beams import element_axes
from msahl.reduction.mesh.material import BeamSection, Material
from msahl.reduction.mesh.mesh import BEAM, Mesh
from msahl.reduction.rigid import EPSILON
from msahl.reduction.stiffening import Stiffening, in_mean_axes

DEGREE = 6
"""Of psi in an element, and one more of its moment; theta is quadratic."""
POINTS, WEIGHTS = (part / 2.0 for part in np.polynomial.legendre.leggauss(DEGREE))
POINTS = POINTS + 0.5
POWERS = np.arange(DEGREE)
UP_TO = (POINTS[:, None] ** (POWERS + 1) / (POWERS + 1)) @ np.linalg.inv(POINTS[:, None] ** POWERS)
"""Integrals of polynomials from the start to each point, by their values there."""
MOST_NUMBERS = 100_000_000
"""Nodes times squares of modes: some gigabytes."""


class Element(NamedTuple):
    """First-order fields of an element in the axes of the frame, at its points g: rotation and its
    derivative (g, 3, q), strain (3, q); direction (3,), places (g, 3), length, mass by length and
    second moment (3, 3) of the section's mass by length."""

    theta: np.ndarray
    theta_dot: np.ndarray
    gamma: np.ndarray
    along: np.ndarray
    places: np.ndarray
    length: float
    mass: float
    section: np.ndarray


class Sections(NamedTuple):
    """What elements are made of: mass by length, second moments (3, 3) of it in their axes, and
    Phi h^2 of ``beams`` for bending about d_2 and d_3 [m^2]."""

    mass: float
    moment: np.ndarray
    shear: tuple[float, float]


class Beams(NamedTuple):
    """A mesh of beams, whose unit of length is ``size`` [m]."""

    mesh: Mesh
    material: Material
    section: BeamSection
    size: float


def beam_stiffening(
    given: Beams, body: ReducedBody, rotations: np.ndarray, members: Sequence[int]
) -> Stiffening:
    """Return the stiffening of a reduced mesh of beams, whose nodes come first in the ``body``;
    ``rotations`` (n, 3, q) are theirs, ``members`` (p,) the nodes, by index, that the interfaces
    follow rigidly. Raises ``ReductionError``: it has loops, or too many modes."""
    mesh, q = given.mesh, len(body.eigenvalues)
    nodes = mesh.elements[BEAM]
    _require_tree(mesh, len(nodes), q)
    axes, made = element_axes(mesh, given.section), _sections(given, body.invariants.mass)
    psi, beta = np.zeros((2, len(mesh.labels), 3, q, q))
    sums = np.zeros((3, q, q)), np.zeros((3, 3, q, q))
    for e, (start, end) in _from_one_node(nodes, len(mesh.labels)):
        element = _element(axes[e], nodes[e], made, body, rotations)
        at_start = psi[start], beta[start], start == nodes[e, 0]
        psi[end], beta[end] = _passed(element, at_start, sums)
    forms = [_of_point(k, p, body, rotations, psi, beta) for p, k in enumerate(members)]
    return in_mean_axes(*sums, np.stack(forms), body.interface_places, body.invariants)


def _require_tree(mesh: Mesh, count: int, q: int) -> None:
    if count != len(mesh.labels) - 1:
        raise ReductionError(
            mesh.source,
            "its beams form loops, of which geometric stiffening is not known; omit --stiffening",
        )
    if len(mesh.labels) * q * q > MOST_NUMBERS:
        raise ReductionError(mesh.source, f"{q} modes are too many for --stiffening; keep fewer")


def _sections(given: Beams, mass: float) -> Sections:
    """Return the sections of a mesh that has this ``mass`` [kg]."""
    mesh, size = given.mesh, given.size
    A, I2, I3, _, k2, k3 = given.section.geometry
    E, G = given.material.E, given.material.shear
    first, second = mesh.places[mesh.elements[BEAM]].transpose(1, 0, 2)
    line = mass / (size * float(np.linalg.norm(second - first, axis=1).sum()))
    about_2, about_3 = (
        12.0 * E * bend * size**2 / (k * G * A) if k else 0.0 for bend, k in ((I2, k3), (I3, k2))
    )
    moment = line * size**2 * np.diag([0.0, I3, I2]) / A
    return Sections(line, moment, (about_2, about_3))


def _from_one_node(nodes: np.ndarray, count: int) -> list[tuple[int, tuple[int, int]]]:
    """Return the elements of a tree from node 0 on, each with the node where it is entered and the
    other one."""
    numbers = np.arange(1, len(nodes) + 1)
    links = sparse.coo_array((numbers, (nodes[:, 0], nodes[:, 1])), shape=(count, count)).tocsr()
    links = sparse.csr_array(links + links.T)
    order, before = breadth_first_order(links, 0, directed=False)
    return [(int(links[before[k], k]) - 1, (int(before[k]), int(k))) for k in order[1:]]


def _element(
    axes: np.ndarray, nodes: np.ndarray, made: Sections, body: ReducedBody, rotations: np.ndarray
) -> Element:
    """Return the fields of first order of an element with these ``axes`` (3, 3), rows d_i."""
    i, j = nodes
    across = body.node_places[j] - body.node_places[i]
    h = float(np.linalg.norm(across))
    slope = axes @ (body.node_shapes[j] - body.node_shapes[i]) / h
    first, last = axes @ rotations[i], axes @ rotations[j]
    mean = 0.5 * (first + last)
    # Shears if sections did not warp the line: v' - theta_3, w' + theta_2.
    lag = np.stack([np.zeros_like(mean[0]), slope[2] + mean[1], slope[1] - mean[2]])
    Phi = np.array([0.0, *made.shear]) / h**2
    bubble = lag / (1.0 + Phi)[:, None] * np.array([0.0, -1.0, 1.0])[:, None]
    rest = lag * (Phi / (1.0 + Phi))[:, None]
    x = POINTS[:, None, None]
    theta = (1.0 - x) * first + x * last + 6.0 * x * (1.0 - x) * bubble
    theta_dot = (last - first + 6.0 * (1.0 - 2.0 * x) * bubble) / h
    gamma = np.stack([slope[0], rest[2], rest[1]])
    return Element(
        *(axes.T @ theta, axes.T @ theta_dot, axes.T @ gamma, axes[0]),
        body.node_places[i] + POINTS[:, None] * across,
        *(h, made.mass, axes.T @ made.moment @ axes),
    )


def _passed(
    one: Element,
    at_start: tuple[np.ndarray, np.ndarray, bool],
    sums: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, np.ndarray]:
    """Return psi and beta (3, q, q) at the other end of an element, of those at the start and
    whether that is its first node; add its part to the integrals of psi dm and x psi dm."""
    (psi, beta, forwards), (first, second) = at_start, sums
    bent = 0.5 * _cross(one.theta, one.theta_dot)
    beta_end, at = _integrated(bent, beta, one.length, forwards)
    inner = one.gamma + 0.5 * np.einsum("bac,gaj,c->gbj", EPSILON, one.theta, one.along)
    slope = _cross(one.theta, inner) + np.einsum("bac,gajk,c->gbjk", EPSILON, at, one.along)
    psi_end, moved = _integrated(slope, psi, one.length, forwards)
    weights = one.mass * one.length * WEIGHTS
    first += np.einsum("g,gbjk->bjk", weights, moved)
    second += np.einsum("g,ga,gbjk->abjk", weights, one.places, moved)
    tilt = rotation_of_second_order(one.theta, at)
    second += np.einsum("g,ac,gbcjk->abjk", one.length * WEIGHTS, one.section, tilt)
    return psi_end, beta_end


def _integrated(
    slope: np.ndarray, given: np.ndarray, length: float, forwards: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return what a field with the ``slope`` (g, 3, q, q) is at the other end and at the points,
    if it is ``given`` where the element is entered."""
    change = length * np.einsum("g,g...->...", WEIGHTS, slope)
    start = given if forwards else given - change
    inside = start + length * np.einsum("gh,h...->g...", UP_TO, slope)
    return (start + change if forwards else start), inside


def rotation_of_second_order(theta: np.ndarray, beta: np.ndarray) -> np.ndarray:
    """Return the terms (..., 3, 3, q, q) of second order of the matrix of a rotation, of ``theta``
    (..., 3, q) and ``beta`` (..., 3, q, q)."""
    dyad = np.einsum("...bj,...ck->...bcjk", theta, theta)
    square = 0.5 * (dyad - np.einsum("...aajk,bc->...bcjk", dyad, np.eye(3)))
    # [beta] e_c = beta x e_c
    result: np.ndarray = square + np.einsum("bac,...ajk->...bcjk", EPSILON, beta)
    return result


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Return a_j x b_k (g, 3, q, q) of (g, 3, q), likewise."""
    result: np.ndarray = np.einsum("bac,gaj,gck->gbjk", EPSILON, a, b)
    return result


def _of_point(
    node: int, p: int, body: ReducedBody, rotations: np.ndarray, psi: np.ndarray, beta: np.ndarray
) -> np.ndarray:
    """Return the terms (6, q, q) of interface ``p``, which follows a ``node`` rigidly."""
    arm = body.interface_places[p] - body.node_places[node]
    tilt = rotation_of_second_order(rotations[node], beta[node])
    return np.concatenate([psi[node] + np.einsum("bcjk,c->bjk", tilt, arm), beta[node]])
