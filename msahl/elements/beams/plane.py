"""Beams that stay in a plane: three strains and resultants of a Gauss point, and their gradients.

With D = d_1 and ' the derivative by arc length, all vectors of two components in the plane,

    Gamma_1 = D . r' + (1 - D . D)/2       Gamma_s = c D x r'       kappa_n = b D x D'

s, n   the director d_2 or d_3 in the plane, and the one along its normal
c, b   1 or -1, by the side of the normal to which d_n points: d_s = c perpendicular(D)
a x b  component along the normal;   perpendicular(a)   a rotated by a right angle about the normal

These are the strains of ``strain`` where all directors lie in the plane or along its normal; the
other three are zero. Equations, multipliers and arrays are those of the beam in space.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.elements.beams.group import Beams, BeamsWorkspace, Plane
from msahl.elements.beams.strain import nodes_of
from msahl.formulations.absolute.equations import force_factor, moment_factor
from msahl.formulations.absolute.frames import (
    Frames,
    displacement_node,
    first_multiplier,
    rotation_node,
)
from msahl.jit.kernel import apart, kernel

Flat = tuple[float, float]
"""Components of a vector along the axes i and j of a ``Plane``."""
FlatPoint = tuple[Flat, Flat, Flat]
"""D, D' and r' at a Gauss point; or changes of these."""
Three = tuple[float, float, float]
"""Of the components 1, s and n, in this order."""


def either(
    module: str, name: str, in_space: Callable[..., Any], in_plane: Callable[..., Any]
) -> Callable[..., Any]:
    """Return a kernel whose first argument is a ``Plane``, or None: then it calls ``in_space`` with
    the other arguments, else ``in_plane`` with all. ``module`` and ``name`` are where it is found.

    numba compiles the one that is called.
    """

    def called(plane: Any, *arguments: Any) -> Any:
        if plane is None:
            return in_space(*arguments)
        return in_plane(plane, *arguments)

    called.__module__, called.__qualname__, called.__name__ = module, name, name
    called.__annotations__ = {"return": in_space.__annotations__["return"]}
    return kernel(called)


@kernel
def dot(a: Flat, b: Flat) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1]


@kernel
def cross(a: Flat, b: Flat) -> float:
    """Return the component of a x b along the normal."""
    return a[0] * b[1] - a[1] * b[0]


@kernel
def perpendicular(a: Flat) -> Flat:
    """Return ``a`` rotated by a right angle about the normal."""
    return (-a[1], a[0])


@kernel
def axpy(c: float, a: Flat, b: Flat) -> Flat:
    """Return ``c a + b``."""
    return (c * a[0] + b[0], c * a[1] + b[1])


@kernel
def scale(c: float, a: Flat) -> Flat:
    """Return ``c a``."""
    return (c * a[0], c * a[1])


@kernel
def components(plane: Plane, g: int) -> tuple[int, int, int]:
    """Return the numbers of the strains of Gauss point ``g`` that are not zero."""
    return (0, plane.shear[g], plane.bend[g])


@kernel
def axes_of(plane: Plane) -> tuple[int, int, int]:
    """Return the numbers i, j and k of the axes."""
    return (plane.axes[0], plane.axes[1], plane.axes[2])


@kernel
def signs(plane: Plane, g: int) -> Flat:
    """Return c and b of Gauss point ``g``."""
    return (plane.shear_sign[g], plane.bend_sign[g])


@kernel
def flat(plane: Plane, a: np.ndarray) -> Flat:
    """Return the components in the plane of a vector ``a`` (3,), inertial axes."""
    return (a[plane.axes[0]], a[plane.axes[1]])


@kernel
def move(plane: Plane, group: Beams, start: BeamsWorkspace, frames: Frames, Z: np.ndarray) -> None:
    """Set the changes of the nodes' directors and points over the step of the unknowns ``Z``; the
    first two numbers of each are the components in the plane.
    """
    i, j, k = axes_of(plane)
    for m in range(group.frame.size):
        f = group.frame[m]
        u, q = displacement_node(frames, f), Z[rotation_node(frames, f), k] / frames.length[f]
        n = 1.0 / (1.0 + 0.25 * q * q)
        c, s = -0.5 * q * q * n, q * n
        D, arm = flat(plane, start.d[m, 0]), flat(plane, start.arm[m])
        change, arm_change = (
            axpy(s, perpendicular(D), scale(c, D)),
            axpy(s, perpendicular(arm), scale(c, arm)),
        )
        start.d_change[m, 0, 0], start.d_change[m, 0, 1] = change
        start.arm_change[m, 0], start.arm_change[m, 1] = arm_change
        start.moved[m, 0], start.moved[m, 1] = Z[u, i] + arm_change[0], Z[u, j] + arm_change[1]


@apart
def changes(group: Beams, start: BeamsWorkspace, g: int) -> FlatPoint:
    """Return the changes of D, D' and r' at Gauss point ``g``, after ``move``."""
    D, B, r = (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        N, slope = group.value[g, a], group.slope[g, a]
        change = (start.d_change[m, 0, 0], start.d_change[m, 0, 1])
        D, B = axpy(N, change, D), axpy(slope, change, B)
        r = axpy(slope, (start.moved[m, 0], start.moved[m, 1]), r)
    return D, B, r


@kernel
def point_vectors(
    plane: Plane, start: BeamsWorkspace, g: int, changed: FlatPoint, part: float
) -> FlatPoint:
    """Return D, D' and r' at Gauss point ``g`` after a ``part`` of their changes."""
    return (
        axpy(part, changed[0], flat(plane, start.director[g, 0])),
        axpy(part, changed[1], flat(plane, start.d_slope[g, 0])),
        axpy(part, changed[2], flat(plane, start.r_slope[g])),
    )


@kernel
def node_vectors(plane: Plane, start: BeamsWorkspace, m: int, part: float) -> tuple[Flat, Flat]:
    """Return D and the arm of node ``m`` after a ``part`` of their changes."""
    change, arm_change = start.d_change[m, 0], start.arm_change[m]
    return (
        axpy(part, (change[0], change[1]), flat(plane, start.d[m, 0])),
        axpy(part, (arm_change[0], arm_change[1]), flat(plane, start.arm[m])),
    )


@kernel
def set_change(plane: Plane, start: BeamsWorkspace, g: int, changed: FlatPoint) -> FlatPoint:
    """Set the change of the strains at Gauss point ``g``; return the means of D, D' and r'."""
    dD, dB, dr = changed
    D, B, r = point_vectors(plane, start, g, changed, 0.5)
    (c, b), (_, s, n) = signs(plane, g), components(plane, g)
    start.change[g, 0] = dot(D, dr) + dot(dD, axpy(-1.0, D, r))
    start.change[g, s] = c * (cross(D, dr) + cross(dD, r))
    start.change[g, n] = b * (cross(D, dB) + cross(dD, B))
    return D, B, r


@kernel
def set_changes(
    plane: Plane, group: Beams, start: BeamsWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Set the changes of the strains by the displacements and rotation increments ``Z``."""
    move(plane, group, start, frames, Z)
    for g in range(group.element.size):
        set_change(plane, start, g, changes(group, start, g))


@kernel
def multipliers(plane: Plane, group: Beams, frames: Frames, Z: np.ndarray, g: int) -> Three:
    """Return lam of Gauss point ``g`` of multipliers by mass ``Z``: forces [N], a moment [N m]."""
    _, s, n = components(plane, g)
    place, mass = first_multiplier(frames) + group.place[g], group.mass[g]
    bend = mass * group.length[g] * Z[place + 1, n - 3]
    return (mass * Z[place, 0], mass * Z[place, s], bend)


@kernel
def loads_of(lam: Three, sign: Flat, at_point: FlatPoint) -> FlatPoint:
    """Return the derivatives of lam . strains by r', by D and by D'."""
    (n, q, m), (D, B, r) = lam, at_point
    q, m = sign[0] * q, sign[1] * m
    by_D = axpy(n, axpy(-1.0, D, r), axpy(-q, perpendicular(r), scale(-m, perpendicular(B))))
    return axpy(n, D, scale(q, perpendicular(D))), by_D, scale(m, perpendicular(D))


@kernel
def push_loads(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    loads: FlatPoint,
    factor: float,
    F: np.ndarray,
) -> None:
    """Add ``factor`` times the forces at Gauss point ``g`` to the equations of its nodes; ``loads``
    are those of ``loads_of`` at the means over the step, which nodes have as well.
    """
    i, j, k = axes_of(plane)
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        f = group.frame[m]
        D, arm = node_vectors(plane, start, m, 0.5)
        c, lever = group.weight[g] * group.value[g, a], group.weight[g] * group.slope[g, a]
        force = scale(lever, loads[0])
        moment = cross(D, axpy(c, loads[1], scale(lever, loads[2]))) + cross(arm, force)
        by_mass, u = force_factor(frames, factor, f), displacement_node(frames, f)
        F[u, i] += by_mass * force[0]
        F[u, j] += by_mass * force[1]
        F[rotation_node(frames, f), k] += moment_factor(frames, factor, f) * moment
