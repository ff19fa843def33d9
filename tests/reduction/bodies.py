"""Elastic models for tests: a chain of masses, an Euler beam in space, boxes of bricks."""

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import Matrices, Nodes, build_model

E, G, RHO = 210e9, 80e9, 7850.0


def chain(count=12, mass=2.0, stiffness=300.0):
    """Masses on a line, joined by springs along it: one degree of freedom each."""
    K = sparse.diags_array(
        [[-stiffness] * (count - 1), [2 * stiffness] * count, [-stiffness] * (count - 1)],
        offsets=[-1, 0, 1],
    ).tolil()
    K[0, 0] = K[-1, -1] = stiffness
    places = np.column_stack([np.arange(count), np.zeros(count), np.zeros(count)])
    labels = np.arange(1, count + 1)
    M = sparse.csr_array(sparse.diags_array([mass] * count))
    given = Matrices(labels, np.zeros(count, int), M, sparse.csr_array(K))
    return build_model("chain", Nodes(labels, places.astype(float)), given)


def beam_matrices(length, width, height):
    """Stiffness and consistent mass (12, 12) of a beam along x, with its rotary inertia about x."""
    A, L = width * height, length
    Iy, Iz, J = height**3 * width / 12, width**3 * height / 12, 0.3 * width * height**3
    polar = Iy + Iz
    K, M = np.zeros((12, 12)), np.zeros((12, 12))
    rod = np.array([[1.0, -1.0], [-1.0, 1.0]])
    rod_mass = np.array([[2.0, 1.0], [1.0, 2.0]]) * L / 6.0
    for rows, k, m in (((0, 6), E * A, RHO * A), ((3, 9), G * J, RHO * polar)):
        K[np.ix_(rows, rows)] += k / L * rod
        M[np.ix_(rows, rows)] += m * rod_mass
    bend = np.array(
        [[12, 6 * L, -12, 6 * L], [6 * L, 4 * L * L, -6 * L, 2 * L * L],
         [-12, -6 * L, 12, -6 * L], [6 * L, 2 * L * L, -6 * L, 4 * L * L]]
    ) / L**3  # fmt: skip
    inertia = np.array(
        [[156, 22 * L, 54, -13 * L], [22 * L, 4 * L * L, 13 * L, -3 * L * L],
         [54, 13 * L, 156, -22 * L], [-13 * L, -3 * L * L, -22 * L, 4 * L * L]]
    ) * RHO * A * L / 420  # fmt: skip
    # In the plane x, z the slope is -ry.
    for rows, sign, second in (((1, 5, 7, 11), 1.0, Iz), ((2, 4, 8, 10), -1.0, Iy)):
        S = np.diag([1.0, sign, 1.0, sign])
        K[np.ix_(rows, rows)] += E * second * S @ bend @ S
        M[np.ix_(rows, rows)] += S @ inertia @ S
    return K, M


def beam_parts(count=20, length=1.0, width=0.02, height=0.01):
    """Nodes and matrices of a beam along x with ``count`` elements, nodes 1 to count + 1."""
    h = length / count
    Ke, Me = beam_matrices(h, width, height)
    size = 6 * (count + 1)
    K, M = np.zeros((size, size)), np.zeros((size, size))
    for e in range(count):
        rows = slice(6 * e, 6 * e + 12)
        K[rows, rows] += Ke
        M[rows, rows] += Me
    labels = np.arange(1, count + 2)
    places = np.column_stack([h * np.arange(count + 1), *np.zeros((2, count + 1))])
    given = Matrices(
        np.repeat(labels, 6), np.tile(np.arange(6), count + 1), sparse.csr_array(M),
        sparse.csr_array(K),
    )  # fmt: skip
    return Nodes(labels, places), given


def beam(**measures):
    return build_model("beam", *beam_parts(**measures))


def brick_matrices(sizes, poisson=0.3):
    """Stiffness and mass (24, 24) of a brick of eight nodes with Wilson's incompatible modes, that
    make it exact in bending; integrated by 2 x 2 x 2 points."""
    corners = np.array([[(k >> a) & 1 for a in range(3)] for k in range(8)]) * 2.0 - 1.0
    lam, mu = E * poisson / ((1 + poisson) * (1 - 2 * poisson)), E / (2 * (1 + poisson))
    D = np.diag([2 * mu] * 3 + [mu] * 3)
    D[:3, :3] += lam
    half = np.array(sizes) / 2.0
    volume = half.prod()
    Kcc, Kci, Kii = np.zeros((24, 24)), np.zeros((24, 9)), np.zeros((9, 9))
    M = np.zeros((8, 8))
    for point in corners / np.sqrt(3.0):
        f = 1.0 + corners * point
        slope = np.column_stack(
            [corners[:, a] * f[:, (a + 1) % 3] * f[:, (a + 2) % 3] / 8 for a in range(3)]
        )
        B = strains(slope / half)
        Bi = strains(np.diag(-2.0 * point) / half)
        Kcc += volume * B.T @ D @ B
        Kci += volume * B.T @ D @ Bi
        Kii += volume * Bi.T @ D @ Bi
        N = f.prod(axis=1) / 8
        M += RHO * volume * np.outer(N, N)
    return Kcc - Kci @ np.linalg.solve(Kii, Kci.T), np.kron(M, np.eye(3))


def strains(slope):
    """Strains (6, 3 n) of nodal displacements by slopes (n, 3) of their shape functions."""
    n = len(slope)
    B = np.zeros((6, 3 * n))
    for a in range(3):
        B[a, a::3] = slope[:, a]
    for row, (a, b) in enumerate(((0, 1), (1, 2), (2, 0)), 3):
        B[row, a::3], B[row, b::3] = slope[:, b], slope[:, a]
    return B


def box_parts(counts=(10, 1, 1), sizes=(1.0, 0.05, 0.05)):
    """Nodes and matrices of a box of bricks with a corner at the origin."""
    nx, ny, nz = (n + 1 for n in counts)
    index = np.arange(nx * ny * nz).reshape(nx, ny, nz)
    steps = np.array(sizes) / counts
    grid = np.stack(np.meshgrid(*(range(n) for n in (nx, ny, nz)), indexing="ij"), axis=-1)
    Ke, Me = brick_matrices(steps)
    rows, columns, k, m = [], [], [], []
    for corner in np.ndindex(*counts):
        nodes = [index[tuple(np.add(corner, [(j >> a) & 1 for a in range(3)]))] for j in range(8)]
        dofs = (3 * np.array(nodes)[:, None] + np.arange(3)).ravel()
        rows.append(np.repeat(dofs, 24))
        columns.append(np.tile(dofs, 24))
        k.append(Ke.ravel())
        m.append(Me.ravel())
    size = 3 * index.size
    at = (np.concatenate(rows), np.concatenate(columns))
    K, M = (
        sparse.csr_array(sparse.coo_array((np.concatenate(v), at), shape=(size, size)))
        for v in (k, m)
    )
    labels = np.arange(1, index.size + 1)
    given = Matrices(np.repeat(labels, 3), np.tile(np.arange(3), index.size), M, K)
    return Nodes(labels, grid.reshape(-1, 3) * steps), given


def box(**measures):
    return build_model("box", *box_parts(**measures))


def ends(counts=(10, 1, 1)):
    """The interfaces at both ends of a box: sets of nodes."""
    n = (counts[1] + 1) * (counts[2] + 1)
    last = (counts[0] + 1) * n
    return f"Root=1:{n}", f"Tip={last - n + 1}:{last}"
