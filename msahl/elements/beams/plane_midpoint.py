"""Equations of beams in a plane over a step of the schemes of order 2: those of ``midpoint``."""

import numpy as np

from msahl.elements.beams.group import Beams, BeamsWorkspace, Plane
from msahl.elements.beams.plane import (
    Three,
    changes,
    components,
    loads_of,
    move,
    multipliers,
    point_vectors,
    push_loads,
    set_change,
    signs,
)
from msahl.elements.beams.plane_stiffness import (
    add_compliance,
    add_equations,
    add_loads,
    add_stiffness,
    collect,
    set_tangents,
)
from msahl.elements.beams.rows import own_compliance, row_scale
from msahl.elements.beams.step_scales import AT_ONCE, divisor, strain_share
from msahl.formulations.absolute.frames import Frames, first_multiplier
from msahl.jit.kernel import kernel

Step = tuple[float, float, float]
"""h, dt2 and chi/2."""


@kernel
def residual(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    step: Step,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Subtract the mean forces from the frames' equations and set those of the strains."""
    move(plane, group, start, frames, Z)
    for g in range(group.element.size):
        means = set_change(plane, start, g, changes(group, start, g))
        n, q, m = multipliers(plane, group, frames, Z, g)
        loads = loads_of((n, q, m), signs(plane, g), means)
        push_loads(plane, group, start, frames, g, loads, -1.0, F)
        for i in components(plane, g):
            _set_equation(plane, group, start, frames, (g, i), step, Z, F)


@kernel
def _set_equation(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    place: tuple[int, int],
    step: Step,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equation of strain i at Gauss point g of ``place`` (g, i)."""
    (g, i), (h, dt2, decay) = place, step
    node = first_multiplier(frames) + group.place[g]
    before, change = start.strain[g, i], start.change[g, i]
    if group.rigid[g, i]:
        F[node + i // 3, i % 3] = row_scale(group, g, i) * (before + change)
        return
    lag = group.damping[g, i] * change / h + decay * (change - start.rise[g, i])
    row = dt2 * row_scale(group, g, i) * (before + 0.5 * change + lag)
    for j in components(plane, g):
        row += own_compliance(group, g, i, j) * Z[node + j // 3, j % 3]
    F[node + i // 3, i % 3] = row / divisor(group, g, i, step)


@kernel
def jacobian(
    plane: Plane,
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    step: Step,
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``residual`` at ``Z``."""
    dt2 = step[1]
    move(plane, group, start, frames, Z)
    set_tangents(plane, group, start, frames, Z)
    for g in range(group.element.size):
        changed = changes(group, start, g)
        means = point_vectors(plane, start, g, changed, 0.5)
        add_loads(plane, group, start, frames, g, means, (-1.0, -1.0, -1.0), values)
        n, q, m = multipliers(plane, group, frames, Z, g)
        collect(plane, group, start, g, (n / dt2, q / dt2, m / dt2), means)
        ends = point_vectors(plane, start, g, changed, 1.0)
        add_equations(plane, group, start, g, ends, _factors(plane, group, g, step), values)
        for i in components(plane, g):
            if not group.rigid[g, i]:
                own = divisor(group, g, i, step)
                add_compliance(plane, group, g, i, own, values)
    add_stiffness(plane, group, start, frames, 0.5, -dt2, values)


@kernel
def _factors(plane: Plane, group: Beams, g: int, step: Step) -> Three:
    """Return the derivatives of the equations at a Gauss point by the changes of the strains."""
    _, s, n = components(plane, g)
    return (_factor(group, g, 0, step), _factor(group, g, s, step), _factor(group, g, n, step))


@kernel
def _factor(group: Beams, g: int, i: int, step: Step) -> float:
    h, dt2, decay = step
    if group.rigid[g, i]:
        return row_scale(group, g, i)
    if dt2 <= AT_ONCE:
        return 0.0
    share = dt2 * strain_share(group, g, i, h, decay) / divisor(group, g, i, step)
    return row_scale(group, g, i) * share
