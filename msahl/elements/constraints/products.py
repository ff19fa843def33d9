"""Scalar products of vectors of two frames A and B, of which coordinates are functions.

    DOT    m = d . e            d fixed in A, e fixed in B
    SLIDE  m = n . D            n fixed in A, in B or in the ground (its owner),
                                D = (x_B + r_B) - (x_A + r_A) from a point of A to one of B
    SLIP   dm = mean(n) . dD    no position law: the velocity along n, for rolling and knife edges
    ROLL   dm = n . (dP_B + Q_B x rho(mean(e)))  the lowest point of a disk of B on a plane of the
                                ground: rho = -(up - (up.e) e)/sqrt(1 - (up.e)^2/r^2), |up| = r
    SURFACE  between two surfaces that touch: ``surfaces`` sets what is said of these here

Over a step a product changes by exactly  d(a.b) = mean(a) . db + mean(b) . da , and a vector fixed
in a body by  da = Q x mean(a) . So, with u, Q of both bodies,

    dm = f . (u_B - u_A) + t_A . Q_A + t_B . Q_B                   no remainder, whatever h

where f, -f and t_A, t_B are the force and moments that a unit multiplier exerts. That is why a
joint's forces do no work and a spring's give what its energy loses.

    DOT     f = 0           t_B = mean(e) x mean(d) = -t_A
    SLIDE   f = mean(n)     t_A = -mean(r_A) x f ,  t_B = mean(r_B) x f ,  owner: + f x mean(D)
    SLIP    the same without the owner's part
    ROLL    f = n           t_B = (mean(r_B) + rho) x n

T is that of ``frames.end_tangent``: the end of a vector fixed in a body changes by -T d(l Q), its
mean by half of that.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import rotation_change
from msahl.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    add,
    at,
    axpy,
    cross,
    dot,
    product,
    put,
    scale,
    skew,
    skew_product,
    sub,
    times,
    transpose,
)
from msahl.formulations.absolute.equations import add_block
from msahl.formulations.absolute.frames import (
    Frames,
    direction,
    displacement,
    end_tangent,
    mean,
    point_arm,
    rotation_increment,
)
from msahl.jit.kernel import apart, kernel

DOT, SLIDE, SLIP, ROLL, SURFACE = range(5)
PARTS = 4
"""Unknowns of a pair of frames, three numbers each: u_A, l_A Q_A, u_B, l_B Q_B."""
U_A, Q_A, U_B, Q_B = range(PARTS)


class Surfaces(NamedTuple):
    """What products of the kind SURFACE have more than others, whose entries are zero: see
    ``surfaces``.
    """

    shape: np.ndarray  # (m,) of what the sphere touches
    radius: np.ndarray  # (m,) of the sphere, negative in what is hollow [m]
    second: np.ndarray  # (m,) whether t is t_2
    axis: np.ndarray  # (m,) number of the inertial axis b; changes during a run
    half: np.ndarray | None  # (m, 3) half sizes of boxes [m]: see ``contact_points``


class Products(NamedTuple):
    """All scalar products; those of one coordinate stand together."""

    kind: np.ndarray  # (m,)
    a: np.ndarray  # (m,) frame A
    b: np.ndarray  # (m,) frame B
    owner: np.ndarray  # (m,) frame that n or d is fixed in
    n: np.ndarray  # (m, 3) n or d, axes of the owner
    s_a: np.ndarray  # (m, 3) point on A from its origin, axes of A [m]
    s_b: np.ndarray  # (m, 3) likewise of B
    e: np.ndarray  # (m, 3) direction, axes of B; of a SLIDE first half of the size of a box
    surfaces: Surfaces | None


class ProductsWorkspace(NamedTuple):
    """Vectors at the start of the step, inertial axes (m, 3), the products' values (m,), and what
    the equations at some Z have computed of the step."""

    n: np.ndarray
    r_a: np.ndarray
    r_b: np.ndarray
    e: np.ndarray
    D: np.ndarray
    value: np.ndarray
    change: np.ndarray  # (m,) dm
    f: np.ndarray  # (m, 3) discrete gradient
    t_a: np.ndarray
    t_b: np.ndarray
    j_u: np.ndarray  # (m, 3) derivative of dm by the unknowns of the step
    j_a: np.ndarray
    j_b: np.ndarray


@kernel
def prepare(
    group: Products, x: np.ndarray, R: np.ndarray, start: ProductsWorkspace, k: int
) -> None:
    """Carry the vectors of product ``k`` into inertial axes and evaluate it."""
    a, b = group.a[k], group.b[k]
    n = direction(R, group.owner[k], at(group.n, k))
    r_a = point_arm(R, a, at(group.s_a, k))
    r_b = point_arm(R, b, at(group.s_b, k))
    e = direction(R, b, at(group.e, k))
    D = add(sub(at(x, b), at(x, a)), sub(r_b, r_a))
    put(start.n, k, n)
    put(start.r_a, k, r_a)
    put(start.r_b, k, r_b)
    put(start.e, k, e)
    put(start.D, k, D)
    start.value[k] = dot(n, e) if group.kind[k] == DOT else dot(n, D)


@kernel
def moved(
    group: Products, start: ProductsWorkspace, frames: Frames, Z: np.ndarray, k: int
) -> Vector:
    """Return the change of D over the step."""
    a, b = group.a[k], group.b[k]
    dr_a = rotation_change(rotation_increment(frames, Z, a), at(start.r_a, k))
    dr_b = rotation_change(rotation_increment(frames, Z, b), at(start.r_b, k))
    return sub(add(displacement(frames, Z, b), dr_b), add(displacement(frames, Z, a), dr_a))


@kernel
def evaluate(
    group: Products, start: ProductsWorkspace, frames: Frames, Z: np.ndarray, k: int
) -> None:
    """Set the change of a product over the step and its discrete gradient."""
    start.change[k], f, t_a, t_b = gradient(group, start, frames, Z, k)
    put(start.f, k, f)
    put(start.t_a, k, t_a)
    put(start.t_b, k, t_b)


@apart
def gradient(
    group: Products, start: ProductsWorkspace, frames: Frames, Z: np.ndarray, k: int
) -> tuple[float, Vector, Vector, Vector]:
    """Change dm over the step and its discrete gradient f, t_A, t_B."""
    a, b, owner = group.a[k], group.b[k], group.owner[k]
    kind = group.kind[k]
    n0, e0 = at(start.n, k), at(start.e, k)
    dn = rotation_change(rotation_increment(frames, Z, owner), n0)
    n = axpy(0.5, dn, n0)
    if kind == DOT:
        de = rotation_change(rotation_increment(frames, Z, b), e0)
        e = axpy(0.5, de, e0)
        t = cross(e, n)
        return dot(n, de) + dot(e, dn), ZERO, scale(-1.0, t), t
    dD = moved(group, start, frames, Z, k)
    r_a = mean(frames, Z, a, at(start.r_a, k))
    r_b = mean(frames, Z, b, at(start.r_b, k))
    if kind == ROLL:
        de = rotation_change(rotation_increment(frames, Z, b), e0)
        rho = rim(at(start.r_a, k), axpy(0.5, de, e0))
        t_b = cross(add(r_b, rho), n0)
        return dot(n0, dD) + dot(rotation_increment(frames, Z, b), cross(rho, n0)), n0, ZERO, t_b
    t_a, t_b = cross(n, r_a), cross(r_b, n)
    change = dot(n, dD)
    if kind == SLIDE:
        D = axpy(0.5, dD, at(start.D, k))
        change += dot(D, dn)
        if owner == a:
            t_a = add(t_a, cross(n, D))
        elif owner == b:
            t_b = add(t_b, cross(n, D))
    return change, n, t_a, t_b


@kernel
def differentiate(
    group: Products, start: ProductsWorkspace, frames: Frames, Z: np.ndarray, k: int
) -> None:
    """Set the derivatives of a product's change by the unknowns."""
    j_u, j_a, j_b = end_gradient(group, start, frames, Z, k)
    put(start.j_u, k, j_u)
    put(start.j_a, k, j_a)
    put(start.j_b, k, j_b)


@kernel
def end_gradient(
    group: Products, start: ProductsWorkspace, frames: Frames, Z: np.ndarray, k: int
) -> tuple[Vector, Vector, Vector]:
    """Derivative of dm by u_B (by u_A it is the opposite), by l_A Q_A and by l_B Q_B."""
    a, b, owner = group.a[k], group.b[k], group.owner[k]
    kind = group.kind[k]
    n0, e0 = at(start.n, k), at(start.e, k)
    T_n = transpose(end_tangent(frames, Z, owner, n0))
    dn = rotation_change(rotation_increment(frames, Z, owner), n0)
    n1 = add(n0, dn)
    e1 = add(e0, rotation_change(rotation_increment(frames, Z, b), e0))
    if kind == DOT:
        T_e = transpose(end_tangent(frames, Z, b, e0))
        return ZERO, scale(-1.0, times(T_n, e1)), scale(-1.0, times(T_e, n1))
    T_b = transpose(end_tangent(frames, Z, b, at(start.r_b, k)))
    if kind == ROLL:
        T_e = end_tangent(frames, Z, b, e0)
        up, mean_e = at(start.r_a, k), scale(0.5, add(e0, e1))
        by_rotation = scale(1.0 / frames.length[b], cross(rim(up, mean_e), n0))
        by_rim = times(
            transpose(product(rim_slope(up, mean_e), T_e)),
            cross(n0, rotation_increment(frames, Z, b)),
        )
        return n0, ZERO, sub(sub(by_rotation, times(T_b, n0)), scale(0.5, by_rim))
    T_a = transpose(end_tangent(frames, Z, a, at(start.r_a, k)))
    dD = moved(group, start, frames, Z, k)
    by_n = add(at(start.D, k), dD)
    if kind == SLIP:
        n1, by_n = axpy(0.5, dn, n0), scale(0.5, dD)
    j_a, j_b = times(T_a, n1), scale(-1.0, times(T_b, n1))
    if owner == a:
        j_a = sub(j_a, times(T_n, by_n))
    elif owner == b:
        j_b = sub(j_b, times(T_n, by_n))
    return n1, j_a, j_b


@kernel
def rim(up: Vector, e: Vector) -> Vector:
    """Return the vector from a disk's centre to its lowest point; ``up`` is the normal of the plane
    times the radius, ``e`` the disk's axis.
    """
    r2, c = dot(up, up), dot(up, e)
    return scale(-1.0 / math.sqrt(1.0 - c * c / r2), axpy(-c, e, up))


@kernel
def rim_slope(up: Vector, e: Vector) -> Matrix:
    """Return the derivative of ``rim`` by ``e``."""
    r2, c = dot(up, up), dot(up, e)
    s = math.sqrt(1.0 - c * c / r2)
    along = axpy(-c / (s * s * r2), axpy(-c, e, up), e)
    return (
        axpy(along[0] / s, up, (c / s, 0.0, 0.0)),
        axpy(along[1] / s, up, (0.0, c / s, 0.0)),
        axpy(along[2] / s, up, (0.0, 0.0, c / s)),
    )


@kernel
def stiffness(
    group: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
    block: np.ndarray,
    pair: int,
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivative of c (f, t_A, t_B) by the unknowns to the 4 x 4 blocks of the ``pair``.

    ``c`` has the factor of each part's rows: what ``frames.push`` makes of a unit force.
    """
    a, b, owner = group.a[k], group.b[k], group.owner[k]
    kind = group.kind[k]
    n0, e0 = at(start.n, k), at(start.e, k)
    n = mean(frames, Z, owner, n0)
    T_n = end_tangent(frames, Z, owner, n0)
    if kind == DOT:
        S_a = skew_product(mean(frames, Z, b, e0), T_n)
        S_b = skew_product(n, end_tangent(frames, Z, b, e0))
        add_block(values, block[pair, 4 * Q_A + Q_A], 0.5 * c[Q_A], S_a)
        add_block(values, block[pair, 4 * Q_A + Q_B], -0.5 * c[Q_A], S_b)
        add_block(values, block[pair, 4 * Q_B + Q_A], -0.5 * c[Q_B], S_a)
        add_block(values, block[pair, 4 * Q_B + Q_B], 0.5 * c[Q_B], S_b)
        return
    T_a = end_tangent(frames, Z, a, at(start.r_a, k))
    T_b = end_tangent(frames, Z, b, at(start.r_b, k))
    if kind == ROLL:
        by_e = product(
            rim_slope(at(start.r_a, k), mean(frames, Z, b, e0)), end_tangent(frames, Z, b, e0)
        )
        add_block(values, block[pair, 4 * Q_B + Q_B], 0.5 * c[Q_B], skew_product(n0, T_b))
        add_block(values, block[pair, 4 * Q_B + Q_B], 0.5 * c[Q_B], skew_product(n0, by_e))
        return
    N_a, N_b = skew_product(n, T_a), skew_product(n, T_b)
    add_block(values, block[pair, 4 * Q_B + Q_B], 0.5 * c[Q_B], N_b)
    add_block(values, block[pair, 4 * Q_A + Q_A], -0.5 * c[Q_A], N_a)
    if owner in (a, b):
        _owner_stiffness(group, start, frames, Z, k, block[pair], c, (T_n, N_a, N_b), values)


@kernel
def _owner_stiffness(
    group: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
    block: np.ndarray,
    c: tuple[float, float, float, float],
    slopes: tuple[Matrix, Matrix, Matrix],
    values: np.ndarray,
) -> None:
    """Add the part of ``stiffness`` that is due to the rotation of the body that owns n.

    ``slopes`` are T of n, [n] T of r_A and [n] T of r_B.
    """
    a, b, owner = group.a[k], group.b[k], group.owner[k]
    n = mean(frames, Z, owner, at(start.n, k))
    T_n, N_a, N_b = slopes
    rotated = Q_A if owner == a else Q_B
    arm_a = skew_product(mean(frames, Z, a, at(start.r_a, k)), T_n)
    arm_b = skew_product(mean(frames, Z, b, at(start.r_b, k)), T_n)
    add_block(values, block[4 * U_B + rotated], -0.5 * c[U_B], T_n)
    add_block(values, block[4 * U_A + rotated], 0.5 * c[U_A], T_n)
    add_block(values, block[4 * Q_B + rotated], -0.5 * c[Q_B], arm_b)
    add_block(values, block[4 * Q_A + rotated], 0.5 * c[Q_A], arm_a)
    if group.kind[k] == SLIDE:
        D = axpy(0.5, moved(group, start, frames, Z, k), at(start.D, k))
        half = 0.5 * c[rotated]
        add_block(values, block[4 * rotated + rotated], half, skew_product(D, T_n))
        add_block(values, block[4 * rotated + U_B], half, skew(n))
        add_block(values, block[4 * rotated + U_A], -half, skew(n))
        add_block(values, block[4 * rotated + Q_B], -half, N_b)
        add_block(values, block[4 * rotated + Q_A], half, N_a)


@apart
def free_acceleration(
    group: Products, start: ProductsWorkspace, v: np.ndarray, W: np.ndarray, k: int
) -> tuple[float, float]:
    """Return the rate of a product, and its second derivative at zero accelerations."""
    a, b, owner = group.a[k], group.b[k], group.owner[k]
    kind = group.kind[k]
    n, e, D = at(start.n, k), at(start.e, k), at(start.D, k)
    n_dot, e_dot = cross(at(W, owner), n), cross(at(W, b), e)
    n_ddot, e_ddot = cross(at(W, owner), n_dot), cross(at(W, b), e_dot)
    r_a_dot, r_b_dot = cross(at(W, a), at(start.r_a, k)), cross(at(W, b), at(start.r_b, k))
    D_dot = sub(add(at(v, b), r_b_dot), add(at(v, a), r_a_dot))
    D_ddot = sub(cross(at(W, b), r_b_dot), cross(at(W, a), r_a_dot))
    if kind == DOT:
        rate = dot(n_dot, e) + dot(n, e_dot)
        return rate, dot(n_ddot, e) + 2.0 * dot(n_dot, e_dot) + dot(n, e_ddot)
    if kind == SLIP:
        return dot(n, D_dot), dot(n_dot, D_dot) + dot(n, D_ddot)
    if kind == ROLL:
        rho = rim(at(start.r_a, k), e)
        rho_dot = times(rim_slope(at(start.r_a, k), e), e_dot)
        rate = dot(n, add(D_dot, cross(at(W, b), rho)))
        return rate, dot(n, add(D_ddot, cross(at(W, b), rho_dot)))
    rate = dot(n_dot, D) + dot(n, D_dot)
    return rate, dot(n_ddot, D) + 2.0 * dot(n_dot, D_dot) + dot(n, D_ddot)
