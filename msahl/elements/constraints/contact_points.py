"""Points of contact of spheres, rims and capsules of frame B on boxes, planes and capsules of A.

Beside the vector a of ``surfaces`` these shapes have a second one, e. With D from A's point to B's
the normal n, towards B, and rho from B's point to the point of contact are

    BOX     a, e fixed in A: its axes a_3 and a_1, half sizes h, a capsule being a box of one size;
            n = E/|E|,  E = sum b_i a_i,  b_i what of D . a_i is beyond -h_i and h_i;  rho = -r n
    RIM     a fixed in A, the normal of a plane; e fixed in B, the axis of a disk of radius r;
            n = a,  rho = -r m/|m|,  m = a - (a.e) e
    LINES   a fixed in A and e in B, the axes of capsules; with u and w of ``segments``
            n = E/|E|,  E = D + w e - u a,  rho = w e - r n

Over a step n and rho are the means of those at its start and at its end: vectors between nearest
points are short, and means of the long ones that they are differences of would not do for them.
"""

import math

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
    multiple,
    put,
    scale,
    transpose,
)
from msahl.elements.constraints.coordinate_kinds import beyond
from msahl.elements.constraints.products import (
    Q_A,
    Q_B,
    U_A,
    Products,
    ProductsWorkspace,
    Surfaces,
    moved,
)
from msahl.elements.constraints.segments import feet, feet_change
from msahl.formulations.absolute.frames import (
    Frames,
    direction,
    end_tangent,
    rotation_increment,
)
from msahl.jit.kernel import kernel, optional

PLANE, CYLINDER, SPHERE, BOX, RIM, LINES = range(6)
"""Shapes of ``surfaces`` and, from BOX on, of this module."""

Touch = tuple[Vector, Vector]
"""n and rho, or their changes."""
NO_TOUCH: Touch = (ZERO, ZERO)
NO_MATRIX: Matrix = (ZERO, ZERO, ZERO)


@kernel
def unit(a: Vector) -> Vector:
    """``a/|a|``, or zero where ``a`` is: the middle of a sphere that is inside of a box has no
    nearest point.
    """
    length = math.sqrt(dot(a, a))
    return scale(1.0 / length, a) if length > 0.0 else ZERO


@kernel
def unit_change(e: Vector, length: float, da: Vector) -> Vector:
    """Change of the unit vector ``e`` of a vector of this ``length`` that changes by ``da``."""
    return scale(1.0 / length, axpy(-dot(e, da), e, da)) if length > 0.0 else ZERO


@kernel
def owner_of(products: Products, shape: int, k: int) -> int:
    """Return the frame that e is fixed in."""
    frame: int = products.a[k] if shape == BOX else products.b[k]
    return frame


@optional()
def prepare(
    half: np.ndarray,
    shape: np.ndarray,
    products: Products,
    R: np.ndarray,
    start: ProductsWorkspace,
) -> None:
    """Carry the vectors e of boxes into inertial axes, after ``products.prepare``."""
    for k in range(shape.size):
        if shape[k] == BOX:
            put(start.e, k, direction(R, products.a[k], at(products.e, k)))


@kernel
def touch(shape: int, h: Vector, r: float, a: Vector, e: Vector, D: Vector) -> Touch:
    """Return n and rho at one configuration."""
    if shape == RIM:
        return a, scale(-r, unit(axpy(-dot(a, e), e, a)))
    if shape == LINES:
        u, w, _, _ = feet((h[0], h[1]), (dot(a, D), dot(e, D), dot(a, e)))
        n = unit(axpy(w, e, axpy(-u, a, D)))
        return n, axpy(-r, n, scale(w, e))
    n = unit(_outside(h, a, e, D))
    return n, scale(-r, n)


@kernel
def _outside(h: Vector, a: Vector, e: Vector, D: Vector) -> Vector:
    """Return E of a box."""
    y = cross(a, e)
    E = scale(beyond(dot(D, e), h[0]), e)
    E = axpy(beyond(dot(D, y), h[1]), y, E)
    return axpy(beyond(dot(D, a), h[2]), a, E)


@kernel
def touch_change(
    shape: int,
    h: Vector,
    r: float,
    place: tuple[Vector, Vector, Vector],
    change: tuple[Vector, Vector, Vector],
) -> Touch:
    """Return the derivatives of n and rho along a ``change`` of the ``place`` (a, e, D)."""
    (a, e, D), (da, de, dD) = place, change
    if shape == RIM:
        c, dc = dot(a, e), dot(da, e) + dot(a, de)
        m, dm = axpy(-c, e, a), axpy(-c, de, axpy(-dc, e, da))
        return da, scale(-r, unit_change(unit(m), math.sqrt(dot(m, m)), dm))
    if shape == LINES:
        return _between_lines_change(h, r, place, change)
    y, dy = cross(a, e), add(cross(da, e), cross(a, de))
    dE = _outside_change(h[0], (e, D), (de, dD))
    dE = add(dE, _outside_change(h[1], (y, D), (dy, dD)))
    dE = add(dE, _outside_change(h[2], (a, D), (da, dD)))
    E = _outside(h, a, e, D)
    dn = unit_change(unit(E), math.sqrt(dot(E, E)), dE)
    return dn, scale(-r, dn)


@kernel
def _between_lines_change(
    h: Vector,
    r: float,
    place: tuple[Vector, Vector, Vector],
    change: tuple[Vector, Vector, Vector],
) -> Touch:
    """Do likewise of two capsules."""
    (a, e, D), (da, de, dD) = place, change
    m = (dot(a, D), dot(e, D), dot(a, e))
    dm = (dot(da, D) + dot(a, dD), dot(de, D) + dot(e, dD), dot(da, e) + dot(a, de))
    at_feet = feet((h[0], h[1]), m)
    u, w = at_feet[0], at_feet[1]
    du, dw = feet_change(m, at_feet, dm)
    E = axpy(w, e, axpy(-u, a, D))
    to_B = axpy(dw, e, scale(w, de))
    dE = axpy(-du, a, axpy(-u, da, add(dD, to_B)))
    dn = unit_change(unit(E), math.sqrt(dot(E, E)), dE)
    return dn, axpy(-r, dn, to_B)


@kernel
def _outside_change(h: float, of: tuple[Vector, Vector], change: tuple[Vector, Vector]) -> Vector:
    """Return the derivative of b_i a_i along a ``change`` ``of`` a_i and D."""
    (a, D), (da, dD) = of, change
    p = dot(D, a)
    slope = dot(dD, a) + dot(D, da) if h == 0.0 or abs(p) > h else 0.0
    return axpy(slope, a, scale(beyond(p, h), da))


@optional(NO_TOUCH)
def now(half: np.ndarray, group: Surfaces, start: ProductsWorkspace, k: int) -> Touch:
    """Return n and rho at the start."""
    shape, radius = group.shape[k], group.radius[k]
    return touch(shape, at(half, k), radius, at(start.n, k), at(start.e, k), at(start.D, k))


@optional(NO_TOUCH)
def rate_of_touch(
    half: np.ndarray,
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    W: np.ndarray,
    D_dot: Vector,
    k: int,
) -> Touch:
    """Return the rates of n and rho at the start."""
    shape, radius = group.shape[k], group.radius[k]
    a, e, D = at(start.n, k), at(start.e, k), at(start.D, k)
    a_dot = cross(at(W, products.owner[k]), a)
    e_dot = cross(at(W, owner_of(products, shape, k)), e)
    return touch_change(shape, at(half, k), radius, (a, e, D), (a_dot, e_dot, D_dot))


@kernel
def _at_end(
    products: Products, start: ProductsWorkspace, frames: Frames, Z: np.ndarray, shape: int, k: int
) -> tuple[Vector, Vector, Vector]:
    """Return a, e and D at the end of a step."""
    a, e = at(start.n, k), at(start.e, k)
    Q_a = rotation_increment(frames, Z, products.owner[k])
    Q_e = rotation_increment(frames, Z, owner_of(products, shape, k))
    D = add(at(start.D, k), moved(products, start, frames, Z, k))
    return add(a, rotation_change(Q_a, a)), add(e, rotation_change(Q_e, e)), D


@optional(NO_TOUCH)
def over_step(
    half: np.ndarray,
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    k: int,
) -> Touch:
    """Return the means of n and rho over a step."""
    shape, radius = group.shape[k], group.radius[k]
    n, rho = touch(shape, at(half, k), radius, at(start.n, k), at(start.e, k), at(start.D, k))
    end = _at_end(products, start, frames, Z, shape, k)
    m, to_end = touch(shape, at(half, k), radius, end[0], end[1], end[2])
    return scale(0.5, add(n, m)), scale(0.5, add(rho, to_end))


@optional((NO_MATRIX, NO_MATRIX))
def slopes(
    half: np.ndarray,
    group: Surfaces,
    products: Products,
    start: ProductsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    numbers: tuple[int, int],
) -> tuple[Matrix, Matrix]:
    """Return the derivatives of the means of n and rho of a product by the unknowns of a part, of
    these ``numbers``.
    """
    k, part = numbers
    shape, radius = group.shape[k], group.radius[k]
    a, b = products.a[k], products.b[k]
    by_a = by_e = NO_MATRIX
    by_D = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    if part == U_A:
        by_D = multiple(-1.0, by_D)
    elif part == Q_A:
        by_D = end_tangent(frames, Z, a, at(start.r_a, k))
        by_a = multiple(-1.0, end_tangent(frames, Z, a, at(start.n, k)))
    elif part == Q_B:
        by_D = multiple(-1.0, end_tangent(frames, Z, b, at(start.r_b, k)))
    if part == (Q_A if shape == BOX else Q_B):
        by_e = multiple(-1.0, end_tangent(frames, Z, b if part == Q_B else a, at(start.e, k)))
    end = _at_end(products, start, frames, Z, shape, k)
    rows = transpose(by_a), transpose(by_e), transpose(by_D)
    h = at(half, k)
    n_1, to_1 = touch_change(shape, h, radius, end, (rows[0][0], rows[1][0], rows[2][0]))
    n_2, to_2 = touch_change(shape, h, radius, end, (rows[0][1], rows[1][1], rows[2][1]))
    n_3, to_3 = touch_change(shape, h, radius, end, (rows[0][2], rows[1][2], rows[2][2]))
    return multiple(0.5, transpose((n_1, n_2, n_3))), multiple(0.5, transpose((to_1, to_2, to_3)))
