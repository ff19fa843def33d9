"""Elastic bodies for tests, and their motion by minimal coordinates, integrated by scipy.

The floating frame has the velocities v of its origin and w, in its own axes, and the amplitudes q.
With the kinetic energy T of ``msahl.reduction.invariants`` and its momenta p, L and s

    p' = -w x p + R^T f,   L' = -w x L - v x p,   s' = dT/dq - K q

(Boltzmann and Hamel). Nothing of msahl's equations of motion is used.
"""

from dataclasses import replace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from msahl.model import Ground, Model, Simulation
from msahl.reduction.followers import Start, build_elastic_body, parts_of
from msahl.reduction.interfaces import interface_of
from msahl.reduction.normal_modes import Wanted
from msahl.reduction.particles import particles
from msahl.reduction.reduce import Wishes, reduce_model
from tests.reduction.bodies import box, ends

ZERO = (0.0, 0.0, 0.0)


def reduced_box(counts=(4, 1, 1), number=2, frame="mean"):
    """A box of steel, 1 m long, by bricks, with its ends as interfaces."""
    interfaces = tuple(interface_of(text) for text in ends(counts))
    return reduce_model(box(counts=counts), Wishes(interfaces, Wanted(number), frame)).body


def elastic_model(
    body, start=None, dt=1e-5, t_final=1e-3, gravity=ZERO, stiffening=False, **others
):
    """A model of one elastic body, and what ``others`` add to it."""
    q = body.eigenvalues.size
    start = start or Start(ZERO, ZERO, ZERO, ZERO, np.zeros(q), np.zeros(q))
    elastic, bodies = build_elastic_body(parts_of("Box", body, stiffening), start)
    bodies += others.pop("bodies", ())
    return Model(
        gravity, (Ground("Base"),), bodies, others.pop("joints", ()), others.pop("loads", ()),
        Simulation("", dt, t_final), elastic_bodies=(elastic,), **others,
    )  # fmt: skip


def invariants_of_particles(body):
    """The invariants of the particles, as sums over masses; bodies that rotate with a node count as
    three pairs of points that move with it, to first order."""
    found = particles(body)
    rows = []
    for group in (found.frame, found.amplitudes, found.nodes, found.points):
        for place, shape, rotation, mass, inertia in zip(
            group.place, group.shape, group.rotation, group.mass, group.inertia, strict=True
        ):
            rows.append((mass, place, shape))
            # Points at +-1 along each axis, of inertia/4 each, without the mass at their middle.
            for axis in np.eye(3):
                arm = np.cross(rotation.T, axis).T
                rows += [(inertia / 4, place + s * axis, shape + s * arm) for s in (1, -1)]
                rows.append((-inertia / 2, place, shape))
    m = np.array([row[0] for row in rows])
    x, phi = np.array([row[1] for row in rows]), np.array([row[2] for row in rows]) / found.scale
    E = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        E[i, j, k], E[i, k, j] = 1.0, -1.0
    around = np.einsum("aik,bk->bia", E, x)  # e_i x x
    moved = np.einsum("aik,bkj->biaj", E, phi)  # e_i x phi_j
    couplings = np.einsum("b,bia,blaj->ilj", m, around, moved)
    return replace(
        body.invariants,
        mass=m.sum(),
        inertia=np.einsum("b,bia,bla->il", m, around, around),
        translation=np.einsum("b,baj->aj", m, phi),
        rotation=np.einsum("b,bia,baj->ij", m, around, phi),
        moment=np.einsum("b,biaj->aij", m, moved),
        gyration=np.einsum("b,biaj,bak->ijk", m, moved, phi),
        inertia_slope=couplings + couplings.transpose(1, 0, 2),
        inertia_curve=np.einsum("b,biaj,blak->iljk", m, moved, moved),
    ), np.einsum("b,baj,bak->jk", m, phi, phi)


def mass_matrix(given, modal, q):
    """M (6 + q, 6 + q) of v, w and the rates of the amplitudes q."""
    n = q.size
    M = np.zeros((6 + n, 6 + n))
    M[:3, :3] = given.mass * np.eye(3)
    M[:3, 3:6] = given.moment @ q
    M[3:6, 3:6] = given.inertia_at(q)
    M[:3, 6:] = given.translation
    M[3:6, 6:] = given.rotation + np.einsum("ijk,j->ik", given.gyration, q)
    M[6:, 6:] = modal
    return np.triu(M) + np.triu(M, 1).T


def integrate(body, given, modal, start, times):
    """Places of the mass centre's origin (t, 3), rotations and amplitudes (t, q) of unit modal mass
    of a free body."""
    n = body.eigenvalues.size
    scale = particles(body).scale
    R = Rotation.from_matrix(_matrix(start.orientation))
    w = np.array(start.angular_velocity)
    v = np.array(start.velocity) + np.cross(w, body.centre)
    q, rate = start.amplitude * scale, start.rate * scale
    x = np.array(start.position) + R.apply(body.centre)
    momentum = mass_matrix(given, modal, q) @ np.r_[v, w, rate]

    def slope(_, y):
        quaternion, momentum, q = y[3:7], y[7 : 13 + n], y[13 + n :]
        R = Rotation.from_quat(quaternion)
        u = np.linalg.solve(mass_matrix(given, modal, q), momentum)
        v, w, rate = u[:3], u[3:6], u[6:]
        p, L = momentum[:3], momentum[3:6]
        by_q = (
            np.einsum("a,aij,i->j", v, given.moment, w)
            + 0.5 * np.einsum("i,ilj,l->j", w, given.inertia_slope, w)
            + 0.5 * np.einsum("i,iljk,l,k->j", w, given.inertia_curve, w, q)
            + 0.5 * np.einsum("i,ilkj,l,k->j", w, given.inertia_curve, w, q)
            + np.einsum("i,ijk,k->j", w, given.gyration, rate)
        )
        a, b, c, d = quaternion
        rotated = 0.5 * np.array(
            [d * w[0] + b * w[2] - c * w[1], d * w[1] + c * w[0] - a * w[2],
             d * w[2] + a * w[1] - b * w[0], -a * w[0] - b * w[1] - c * w[2]]
        )  # fmt: skip
        forces = np.r_[-np.cross(w, p), -np.cross(w, L) - np.cross(v, p)]
        return np.r_[R.apply(v), rotated, forces, by_q - body.eigenvalues * q, rate]

    y0 = np.r_[x, R.as_quat(), momentum, q]
    found = solve_ivp(slope, (0.0, times[-1]), y0, "DOP853", times, rtol=1e-13, atol=1e-14)
    return found.y[:3].T, Rotation.from_quat(found.y[3:7].T), found.y[13 + n :].T / scale


def _matrix(p):
    from msahl.algebra.rotation import matrix

    return np.array(matrix(p))
