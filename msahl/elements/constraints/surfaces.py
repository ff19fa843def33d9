"""Slip between the surfaces of two bodies that touch: a scalar product without a position law.

A sphere of frame B of radius r touches a plane, a cylinder or a sphere of frame A; r is negative
where that is hollow and the sphere inside, and zero for a point. Boxes, and rims, have points of
contact of their own.

    rho = -r n          from the sphere's centre to the point of contact,  D from A's point to it
    dm  = t . (dD + Q_B x rho - Q_A x (D + rho))                  all at their means over the step
        = f . (u_B - u_A) + t_A . Q_A + t_B . Q_B
    f = t       t_A = t x (r_A + D + rho)       t_B = (r_B + rho) x t

    PLANE       n fixed in A
    CYLINDER    n = E/|E|,  E = D - (D.a) a     a fixed in A, along the axis
    SPHERE      n = D/|D|
    BOX, RIM    see ``contact_points``, which has n and rho of these

t is one of the tangents  t_1 = b x n / |b x n|,  t_2 = n x t_1,  where b is the axis of a cylinder,
or else the inertial axis that is the most across n: ``choose_axes`` changes it between steps. Which
one it is has no effect: both slips and both forces together are vectors in the plane across n.
"""

import math

import numpy as np

from msahl.algebra.vector import (
    ZERO,
    Matrix,
    Vector,
    add,
    at,
    axpy,
    cross,
    dot,
    multiple,
    put,
    scale,
    skew,
    skew_product,
    sub,
    times,
    transpose,
)
from msahl.elements.constraints import contact_points
from msahl.elements.constraints.contact_points import (
    BOX,
    CYLINDER,
    PLANE,
    SPHERE,
    Touch,
    unit,
    unit_change,
)
from msahl.elements.constraints.products import (
    Q_A,
    Q_B,
    SURFACE,
    U_A,
    U_B,
    Products,
    ProductsWorkspace,
    Surfaces,
    moved,
)
from msahl.formulations.absolute.equations import add_block
from msahl.formulations.absolute.frames import (
    Frames,
    displacement,
    end_tangent,
    mean,
    rotation_increment,
)
from msahl.jit.kernel import apart, kernel, optional

Place = tuple[Vector, Vector, Vector, Vector, Touch]
"""a (the plane's normal, or the cylinder's axis), D, r_A and r_B, inertial axes, and the n and rho
of ``contact_points``."""
Slopes = tuple[Matrix, Matrix, Matrix, Matrix]
"""Derivatives of a, D, n and rho."""


@kernel
def inertial_axis(number: int) -> Vector:
    """Unit vector along an inertial axis."""
    if number == 0:
        return (1.0, 0.0, 0.0)
    if number == 1:
        return (0.0, 1.0, 0.0)
    return (0.0, 0.0, 1.0)


@kernel
def across(shape: int, a: Vector, D: Vector) -> Vector:
    """Vector along the normal n of the contact, of all but boxes and rims."""
    if shape == PLANE:
        return a
    if shape == SPHERE:
        return D
    return axpy(-dot(a, D) / dot(a, a), a, D)


@kernel
def reference(shape: int, axis: int, a: Vector) -> Vector:
    """The vector b."""
    return a if shape == CYLINDER else inertial_axis(axis)


@kernel
def directions(group: Surfaces, k: int, place: Place) -> tuple[Vector, Vector, Vector]:
    """Return n, t and rho."""
    a, D, touch = place[0], place[1], place[4]
    shape = group.shape[k]
    n = unit(touch[0] if shape >= BOX else across(shape, a, D))
    rho = touch[1] if shape >= BOX else scale(-group.radius[k], n)
    t = unit(cross(reference(shape, group.axis[k], a), n))
    return n, cross(n, t) if group.second[k] else t, rho


@kernel
def changes(
    group: Surfaces, k: int, place: Place, da: Vector, dD: Vector, change: Touch
) -> tuple[Vector, Vector, Vector]:
    """Return the derivatives of n, t and rho along changes of a, of D and by ``contact_points``."""
    shape, a, D = group.shape[k], place[0], place[1]
    E = place[4][0] if shape >= BOX else across(shape, a, D)
    length, dE, db = math.sqrt(dot(E, E)), dD, ZERO
    if shape == PLANE:
        dE = da
    elif shape == CYLINDER:
        size, db = dot(a, a), da
        along = dot(a, D) / size
        rise = (dot(da, D) + dot(a, dD) - 2.0 * along * dot(a, da)) / size
        dE = axpy(-along, da, axpy(-rise, a, dD))
    elif shape >= BOX:
        dE = change[0]
    n = scale(1.0 / length, E)
    b, dn = reference(shape, group.axis[k], a), unit_change(n, length, dE)
    X, dX = cross(b, n), add(cross(db, n), cross(b, dn))
    breadth = math.sqrt(dot(X, X))
    t = scale(1.0 / breadth, X)
    dt = unit_change(t, breadth, dX)
    drho = change[1] if shape >= BOX else scale(-group.radius[k], dn)
    return dn, add(cross(dn, t), cross(n, dt)) if group.second[k] else dt, drho


@kernel
def place_of(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
) -> Place:
    """Return the means over the step of what a slip depends on."""
    dD = moved(products, start, frames, Z, k)
    return (
        mean(frames, Z, products.owner[k], at(start.n, k)),
        axpy(0.5, dD, at(start.D, k)),
        mean(frames, Z, products.a[k], at(start.r_a, k)),
        mean(frames, Z, products.b[k], at(start.r_b, k)),
        contact_points.over_step(group.half, group, products, start, frames, Z, k),
    )


@kernel
def unit_force(group: Surfaces, k: int, place: Place) -> tuple[Vector, Vector, Vector]:
    """Return f, t_A and t_B."""
    _, D, r_a, r_b, _ = place
    _, t, rho = directions(group, k, place)
    return t, cross(t, add(add(r_a, D), rho)), cross(add(r_b, rho), t)


@kernel
def increments(
    products: Products, frames: Frames, Z: np.ndarray, k: int
) -> tuple[Vector, tuple[Vector, Vector]]:
    """Return u_B - u_A, and Q_A and Q_B."""
    a, b = products.a[k], products.b[k]
    u = sub(displacement(frames, Z, b), displacement(frames, Z, a))
    return u, (rotation_increment(frames, Z, a), rotation_increment(frames, Z, b))


@optional()
def prepare(group: Surfaces, products: Products, R: np.ndarray, start: ProductsWorkspace) -> None:
    """Carry the vectors into inertial axes that ``products.prepare`` does not."""
    contact_points.prepare(group.half, group.shape, products, R, start)


@optional()
def evaluate(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
) -> None:
    """Set the change and the discrete gradient of a slip."""
    f, t_a, t_b = unit_force(group, k, place_of(group, products, start, frames, Z, k))
    u, spins = increments(products, frames, Z, k)
    start.change[k] = dot(f, u) + dot(t_a, spins[0]) + dot(t_b, spins[1])
    put(start.f, k, f)
    put(start.t_a, k, t_a)
    put(start.t_b, k, t_b)


@kernel
def by_columns(group: Surfaces, k: int, place: Place, by: Slopes) -> tuple[Matrix, Matrix, Matrix]:
    """Return the derivatives of n, t and rho by three unknowns, by whose derivatives of what they
    depend on.
    """
    a, D, n, rho = transpose(by[0]), transpose(by[1]), transpose(by[2]), transpose(by[3])
    n_1, t_1, to_1 = changes(group, k, place, a[0], D[0], (n[0], rho[0]))
    n_2, t_2, to_2 = changes(group, k, place, a[1], D[1], (n[1], rho[1]))
    n_3, t_3, to_3 = changes(group, k, place, a[2], D[2], (n[2], rho[2]))
    by_n, by_t = transpose((n_1, n_2, n_3)), transpose((t_1, t_2, t_3))
    return by_n, by_t, transpose((to_1, to_2, to_3))


@kernel
def sum_of(M: Matrix, N: Matrix) -> Matrix:
    """``M + N``."""
    return (add(M[0], N[0]), add(M[1], N[1]), add(M[2], N[2]))


@apart
def slope(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
    part: int,
) -> tuple[Matrix, Matrix, Matrix]:
    """Return the derivatives of f, t_A and t_B by the unknowns of a ``part``."""
    a, b = products.a[k], products.b[k]
    place = place_of(group, products, start, frames, Z, k)
    _, D, r_a, r_b, _ = place
    by_a = by_r_a = by_r_b = multiple(0.0, skew(ZERO))
    if part == Q_A:
        by_r_a = multiple(-0.5, end_tangent(frames, Z, a, at(start.r_a, k)))
        by_a = multiple(-0.5, end_tangent(frames, Z, a, at(start.n, k)))
        by_D = multiple(-1.0, by_r_a)
        if products.owner[k] != a:
            by_a = multiple(0.0, by_a)
    elif part == Q_B:
        by_r_b = multiple(-0.5, end_tangent(frames, Z, b, at(start.r_b, k)))
        by_D = by_r_b
    else:
        half = -0.5 if part == U_A else 0.5
        by_D = ((half, 0.0, 0.0), (0.0, half, 0.0), (0.0, 0.0, half))
    _, t, rho = directions(group, k, place)
    touch = contact_points.slopes(group.half, group, products, start, frames, Z, (k, part))
    _, by_t, by_rho = by_columns(group, k, place, (by_a, by_D, touch[0], touch[1]))
    arm_a = add(rho, add(r_a, D))
    arm_b = add(rho, r_b)
    to_a = sum_of(by_rho, sum_of(by_r_a, by_D))
    by_t_a = sum_of(skew_product(t, to_a), multiple(-1.0, skew_product(arm_a, by_t)))
    to_b = multiple(-1.0, skew_product(t, sum_of(by_rho, by_r_b)))
    return by_t, by_t_a, sum_of(skew_product(arm_b, by_t), to_b)


@optional()
def differentiate(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
) -> None:
    """Set the derivatives of a slip's change by the unknowns, after ``evaluate``."""
    a, b = products.a[k], products.b[k]
    u, spins = increments(products, frames, Z, k)
    own = at(start.f, k)
    put(start.j_u, k, add(own, _row(group, products, start, frames, Z, k, U_B, u, spins)))
    own = scale(1.0 / frames.length[a], at(start.t_a, k))
    put(start.j_a, k, add(own, _row(group, products, start, frames, Z, k, Q_A, u, spins)))
    own = scale(1.0 / frames.length[b], at(start.t_b, k))
    put(start.j_b, k, add(own, _row(group, products, start, frames, Z, k, Q_B, u, spins)))


@kernel
def _row(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
    part: int,
    u: Vector,
    spins: tuple[Vector, Vector],
) -> Vector:
    """Return what the change of f, t_A and t_B by a ``part`` adds to the derivative of dm."""
    by_f, by_t_a, by_t_b = slope(group, products, start, frames, Z, k, part)
    of_spins = add(times(transpose(by_t_a), spins[0]), times(transpose(by_t_b), spins[1]))
    return add(times(transpose(by_f), u), of_spins)


@optional()
def stiffness(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
    block: np.ndarray,
    c: tuple[float, float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivative of c (f, t_A, t_B) by the unknowns to the 4 x 4 blocks (16,), as
    ``products.stiffness`` does.
    """
    for part in range(4):
        by_f, by_t_a, by_t_b = slope(group, products, start, frames, Z, k, part)
        add_block(values, block[4 * U_A + part], -c[U_A], by_f)
        add_block(values, block[4 * Q_A + part], c[Q_A], by_t_a)
        add_block(values, block[4 * U_B + part], c[U_B], by_f)
        add_block(values, block[4 * Q_B + part], c[Q_B], by_t_b)


@kernel
def _now(group: Surfaces, start: ProductsWorkspace, k: int) -> Place:
    touch = contact_points.now(group.half, group, start, k)
    return (at(start.n, k), at(start.D, k), at(start.r_a, k), at(start.r_b, k), touch)


@optional(0.0)
def rate(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    v: np.ndarray,
    W: np.ndarray,
    k: int,
) -> float:
    """Return a slip [m/s]."""
    a, b = products.a[k], products.b[k]
    f, t_a, t_b = unit_force(group, k, _now(group, start, k))
    return dot(f, sub(at(v, b), at(v, a))) + dot(t_a, at(W, a)) + dot(t_b, at(W, b))


@optional(0.0)
def rate_of_slip(
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    v: np.ndarray,
    W: np.ndarray,
    k: int,
) -> float:
    """Return the rate of a slip at zero accelerations [m/s2]."""
    a, b, place = products.a[k], products.b[k], _now(group, start, k)
    d, D, arm_a, arm_b, _ = place
    u = sub(at(v, b), at(v, a))
    r_a, r_b = cross(at(W, a), arm_a), cross(at(W, b), arm_b)
    D_dot = add(u, sub(r_b, r_a))
    touch = contact_points.rate_of_touch(group.half, group, products, start, W, D_dot, k)
    _, t, rho = directions(group, k, place)
    a_dot = cross(at(W, products.owner[k]), d)
    _, t_dot, rho_dot = changes(group, k, place, a_dot, D_dot, touch)
    to_a, to_a_dot = add(rho, add(arm_a, D)), add(rho_dot, add(r_a, D_dot))
    to_b, to_b_dot = add(rho, arm_b), add(rho_dot, r_b)
    t_a = add(cross(t_dot, to_a), cross(t, to_a_dot))
    t_b = add(cross(to_b_dot, t), cross(to_b, t_dot))
    return dot(t_dot, u) + dot(t_a, at(W, a)) + dot(t_b, at(W, b))


@optional(False)
def choose_axes(group: Surfaces, products: Products, start: ProductsWorkspace) -> bool:
    """Take as b the axes that are the most across n; return whether any has changed."""
    changed = False
    for k in range(products.kind.size):
        if products.kind[k] != SURFACE or group.shape[k] == CYLINDER:
            continue
        n = across(group.shape[k], at(start.n, k), at(start.D, k))
        if group.shape[k] >= BOX:
            n = _now(group, start, k)[4][0]
        axis = least_along(n)
        changed = changed or axis != group.axis[k]
        group.axis[k] = axis
    return changed


@kernel
def least_along(n: Vector) -> int:
    """Number of the inertial axis that is the most across ``n``."""
    sizes = (abs(n[0]), abs(n[1]), abs(n[2]))
    if sizes[0] <= sizes[1] and sizes[0] <= sizes[2]:
        return 0
    return 1 if sizes[1] <= sizes[2] else 2
