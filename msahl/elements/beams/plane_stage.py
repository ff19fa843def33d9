"""Beams in a plane in collocation steps: the equations of ``stage``."""

import numpy as np

from msahl.elements.beams.group import Beams, BeamsWorkspace, Plane
from msahl.elements.beams.plane import (
    Flat,
    FlatPoint,
    Three,
    axes_of,
    axpy,
    components,
    cross,
    dot,
    flat,
    loads_of,
    multipliers,
    perpendicular,
    push_loads,
    scale,
    signs,
)
from msahl.elements.beams.plane_stiffness import (
    add_compliance,
    add_equations,
    add_loads,
    add_rows,
    add_stiffness,
    collect,
    node_gradient,
    set_tangents,
)
from msahl.elements.beams.rows import ELASTIC, RIGID, is_among, own_compliance, row_scale
from msahl.elements.beams.step_scales import stage_divisor
from msahl.elements.beams.strain import nodes_of
from msahl.formulations.absolute.frames import Frames, FramesWorkspace, first_multiplier
from msahl.jit.kernel import apart, kernel


@kernel
def chosen(plane: Plane, group: Beams, g: int, which: int, of: Three) -> Three:
    """Return numbers ``of`` the strains of Gauss point ``g``, with zeros for all but ``which``."""
    _, s, n = components(plane, g)
    return (
        of[0] if is_among(group, g, 0, which) else 0.0,
        of[1] if is_among(group, g, s, which) else 0.0,
        of[2] if is_among(group, g, n, which) else 0.0,
    )


@kernel
def point_at(plane: Plane, node: BeamsWorkspace, g: int) -> FlatPoint:
    """Return D, D' and r' of the configuration at Gauss point ``g``."""
    return (
        flat(plane, node.director[g, 0]),
        flat(plane, node.d_slope[g, 0]),
        flat(plane, node.r_slope[g]),
    )


@kernel
def add_forces(
    plane: Plane,
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    which: int,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add the forces of the multipliers ``which``, by mass in ``Z``, to the accelerations ``F``."""
    for g in range(group.element.size):
        lam = chosen(plane, group, g, which, multipliers(plane, group, frames, Z, g))
        loads = loads_of(lam, signs(plane, g), point_at(plane, node, g))
        push_loads(plane, group, node, frames, g, loads, 1.0, F)


@kernel
def set_elastic_equations(
    plane: Plane,
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equations of elastic strains at c_i; ``Z`` are the unknowns of that stage."""
    for g in range(group.element.size):
        place, rates = first_multiplier(frames) + group.place[g], (0.0, 0.0, 0.0)
        numbers = components(plane, g)
        if _is_damped(group, g, numbers):
            rates = _strain_rates(plane, group, node, motion, g)
        for c in range(3):
            i = numbers[c]
            if group.rigid[g, i]:
                continue
            strain = node.strain[g, i] + group.damping[g, i] * rates[c]
            row = 0.5 * h * h * row_scale(group, g, i) * strain
            for j in numbers:
                row += own_compliance(group, g, i, j) * Z[place + j // 3, j % 3]
            F[place + i // 3, i % 3] = row / stage_divisor(group, g, i, h)


@kernel
def _is_damped(group: Beams, g: int, numbers: tuple[int, int, int]) -> bool:
    damping = group.damping[g]
    return damping[numbers[0]] > 0.0 or damping[numbers[1]] > 0.0 or damping[numbers[2]] > 0.0


@apart
def _motion_at(
    plane: Plane, group: Beams, node: BeamsWorkspace, motion: FramesWorkspace, g: int
) -> FlatPoint:
    """Return the rates of D, D' and r' at Gauss point ``g``."""
    _, _, k = axes_of(plane)
    D, B, r = (0.0, 0.0), (0.0, 0.0), (0.0, 0.0)
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        f = group.frame[m]
        W, slope = motion.W[f, k], group.slope[g, a]
        rate = scale(W, perpendicular(flat(plane, node.d[m, 0])))
        D, B = axpy(group.value[g, a], rate, D), axpy(slope, rate, B)
        v = axpy(W, perpendicular(flat(plane, node.arm[m])), flat(plane, motion.v[f]))
        r = axpy(slope, v, r)
    return D, B, r


@kernel
def _strain_rates(
    plane: Plane, group: Beams, node: BeamsWorkspace, motion: FramesWorkspace, g: int
) -> Three:
    """Return the rates of the strains at Gauss point ``g``."""
    (D, B, r), (c, b) = point_at(plane, node, g), signs(plane, g)
    D1, B1, r1 = _motion_at(plane, group, node, motion, g)
    return (
        dot(D1, axpy(-1.0, D, r)) + dot(D, r1),
        c * (cross(D1, r) + cross(D, r1)),
        b * (cross(D1, B) + cross(D, B1)),
    )


@kernel
def add_rigid_derivatives(
    plane: Plane,
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives at one configuration: of the forces of rigid strains by places and
    multipliers by mass, and of the equations of rigid strains by places.
    """
    set_tangents(plane, group, node, frames, Z)
    for g in range(group.element.size):
        here, (i, s, n) = point_at(plane, node, g), components(plane, g)
        _add_force_derivatives(plane, group, node, frames, g, RIGID, Z, values)
        scales = (row_scale(group, g, i), row_scale(group, g, s), row_scale(group, g, n))
        factor = chosen(plane, group, g, RIGID, scales)
        add_equations(plane, group, node, g, here, factor, values)
    add_stiffness(plane, group, node, frames, 1.0, 1.0, values)


@kernel
def _add_force_derivatives(
    plane: Plane,
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    g: int,
    which: int,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of the forces of the multipliers ``which`` by mass at Gauss point ``g``,
    after ``set_tangents``, and prepare those by places.
    """
    here = point_at(plane, node, g)
    factor = chosen(plane, group, g, which, (1.0, 1.0, 1.0))
    add_loads(plane, group, node, frames, g, here, factor, values)
    lam = chosen(plane, group, g, which, multipliers(plane, group, frames, Z, g))
    collect(plane, group, node, g, lam, here)


@kernel
def add_elastic_derivatives(
    plane: Plane,
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    Z: np.ndarray,
    out: tuple[np.ndarray, np.ndarray],
) -> None:
    """Add the derivatives of the forces of elastic strains by places and multipliers by mass, and
    of the equations of elastic strains over h by places and by rates, and by their own multipliers,
    to ``out``: by places and by rates.
    """
    by_place, by_rate = out
    set_tangents(plane, group, node, frames, Z)
    for g in range(group.element.size):
        numbers = components(plane, g)
        _add_force_derivatives(plane, group, node, frames, g, ELASTIC, Z, by_place)
        factor = _factors(group, g, numbers, h)
        here = point_at(plane, node, g)
        add_equations(plane, group, node, g, here, factor, by_place)
        if _is_damped(group, g, numbers):
            damping = group.damping[g]
            factor = (
                factor[0] * damping[numbers[0]],
                factor[1] * damping[numbers[1]],
                factor[2] * damping[numbers[2]],
            )
            add_equations(plane, group, node, g, here, factor, by_rate)
            _add_rate_slopes(plane, group, node, motion, g, factor, by_place)
        for i in numbers:
            if not group.rigid[g, i]:
                add_compliance(plane, group, g, i, stage_divisor(group, g, i, h), by_place)
    add_stiffness(plane, group, node, frames, 1.0, 1.0, by_place)


@kernel
def _factors(group: Beams, g: int, numbers: tuple[int, int, int], h: float) -> Three:
    """Return what the derivatives of the strains are multiplied by in their elastic equations."""
    return (
        _factor(group, g, numbers[0], h),
        _factor(group, g, numbers[1], h),
        _factor(group, g, numbers[2], h),
    )


@kernel
def _factor(group: Beams, g: int, i: int, h: float) -> float:
    if group.rigid[g, i]:
        return 0.0
    return 0.5 * h * row_scale(group, g, i) / stage_divisor(group, g, i, h)


@kernel
def _add_rate_slopes(
    plane: Plane,
    group: Beams,
    node: BeamsWorkspace,
    motion: FramesWorkspace,
    g: int,
    factor: Three,
    values: np.ndarray,
) -> None:
    """Add ``factor`` times the derivatives of the rates of the strains at Gauss point ``g`` by the
    places, at fixed velocities; as ``stage.add_rate_slopes``.
    """
    (D, B, r), sign, (_, _, k) = point_at(plane, node, g), signs(plane, g), axes_of(plane)
    D1, B1, r1 = _motion_at(plane, group, node, motion, g)
    first, count = nodes_of(group, g)
    for b in range(count):
        m = group.node[first + b]
        W = motion.W[group.frame[m], k]
        # By a rotation of the node its own vectors rotate; seen from them the point's rotate back.
        seen = (_seen(D, W, D1), _seen(B, W, B1), _seen(r, W, r1))
        d, arm = flat(plane, node.d[m, 0]), flat(plane, node.arm[m])
        by_q = node_gradient(d, arm, seen, sign, group.value[g, b], group.slope[g, b])
        add_rows(plane, group, node, (g, b), (D1, by_q), factor, values)


@kernel
def _seen(a: Flat, W: float, rate: Flat) -> Flat:
    """Return a x w plus the ``rate``, for w = ``W`` along the normal."""
    return axpy(-W, perpendicular(a), rate)
