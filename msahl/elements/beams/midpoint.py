"""Equations of beams over a step of the schemes of order 2.

    elastic:   w J ((eps0 + eps1)/2 + tau (eps1 - eps0)/h + chi/2 (eps1 - eps0 - s) + C lam) = 0
    rigid:     w J eps1 = 0                                               where C has zero rows

lam is the mean over the step, minus the stress resultants (``group``); eps counts from the
reference. chi and s are those of the decaying scheme, as with a spring (``ports.coordinate``). The
work of the beam's forces is lam . w J (eps1 - eps0) exactly (``strain``), so over a step the bodies
receive what w J eps . C^-1 eps/2 loses, less what damping takes, for any h and any stiffness.

An elastic equation is divided by 1 + c/dt2, c = w J C mass of its own multiplier, and by more with
damping: for a stiff beam it is a constraint, and for h -> 0 it determines the multiplier by the
strain at the start.
"""

import numpy as np

from msahl.algebra.vector import Matrix, Vector, add, combine, cross, multiple, scale
from msahl.elements.beams import plane_midpoint
from msahl.elements.beams.group import COMPONENTS, Beams, BeamsWorkspace
from msahl.elements.beams.plane import either
from msahl.elements.beams.rows import ALL, add_equations, multipliers, own_compliance, row_scale
from msahl.elements.beams.step_scales import AT_ONCE, divisor, strain_share
from msahl.elements.beams.stiffness import add_loads, add_stiffness, collect
from msahl.elements.beams.strain import (
    changes,
    director_loads,
    move,
    node_vectors,
    nodes_of,
    point_vectors,
    set_change,
    set_tangents,
)
from msahl.formulations.absolute.equations import push
from msahl.formulations.absolute.frames import Frames, first_multiplier
from msahl.jit.kernel import kernel, optional


@kernel
def _residual(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    step: tuple[float, float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    dt2 = step[1]
    move(group, start, frames, Z)
    for g in range(group.element.size):
        changed = changes(group, start, g)
        means = set_change(start, g, changed)
        n, m = multipliers(group, frames, Z, g)
        loads = director_loads(scale(1.0 / dt2, n), scale(1.0 / dt2, m), means)
        push_loads(group, start, frames, g, loads, dt2, F)
        _set_equations(group, start, frames, g, step, Z, F)


@kernel
def push_loads(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    loads: tuple[Vector, Matrix, Matrix],
    dt2: float,
    F: np.ndarray,
) -> None:
    """Subtract the forces at Gauss point ``g`` from the equations of its nodes; ``loads`` are the
    derivatives of ``strain.director_loads``.
    """
    first, count = nodes_of(group, g)
    for a in range(count):
        force, moment = node_load(group, start, g, a, loads)
        push(frames, -dt2, F, group.frame[group.node[first + a]], force, moment)


@kernel
def node_load(
    group: Beams, start: BeamsWorkspace, g: int, a: int, loads: tuple[Vector, Matrix, Matrix]
) -> tuple[Vector, Vector]:
    """Return force and moment of Gauss point ``g`` on node ``a`` of its element; ``loads`` are the
    derivatives of ``strain.director_loads``, the node's vectors the means over the step.
    """
    d, arm = node_vectors(start, group.node[group.first[group.element[g]] + a], 0.5)
    c, lever = group.weight[g] * group.value[g, a], group.weight[g] * group.slope[g, a]
    on = combine(c, loads[1], multiple(lever, loads[2]))
    force = scale(lever, loads[0])
    moment = add(cross(d[0], on[0]), add(cross(d[1], on[1]), cross(d[2], on[2])))
    return force, add(moment, cross(arm, force))


@kernel
def _set_equations(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    step: tuple[float, float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equations of the strains at Gauss point ``g``."""
    h, dt2, decay = step
    node = first_multiplier(frames) + group.place[g]
    for i in range(COMPONENTS):
        before, change = start.strain[g, i], start.change[g, i]
        if group.rigid[g, i]:
            row = row_scale(group, g, i) * (before + change)
        else:
            lag = group.damping[g, i] * change / h + decay * (change - start.rise[g, i])
            row = dt2 * row_scale(group, g, i) * (before + 0.5 * change + lag)
            for j in range(COMPONENTS):
                row += own_compliance(group, g, i, j) * Z[node + j // 3, j % 3]
            row /= divisor(group, g, i, step)
        F[node + i // 3, i % 3] = row


@kernel
def _jacobian(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    step: tuple[float, float, float],
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    dt2 = step[1]
    move(group, start, frames, Z)
    set_tangents(group, start, frames, Z)
    for g in range(group.element.size):
        changed = changes(group, start, g)
        means = point_vectors(start, g, changed, 0.5)
        add_loads(group, start, frames, g, means, (-1.0, ALL), values)
        n, m = multipliers(group, frames, Z, g)
        lam = (scale(1.0 / dt2, n), scale(1.0 / dt2, m))
        collect(group, start, g, lam, means)
        _set_factors(group, start, g, step)
        add_equations(group, start, g, point_vectors(start, g, changed, 1.0), values)
        _add_compliance(group, g, step, values)
    add_stiffness(group, start, frames, 0.5, -dt2, values)


@kernel
def _set_factors(
    group: Beams, start: BeamsWorkspace, g: int, step: tuple[float, float, float]
) -> None:
    """Set the derivatives of the equations at Gauss point ``g`` by the changes of the strains."""
    h, dt2, decay = step
    for i in range(COMPONENTS):
        start.factor[g, i] = row_scale(group, g, i)
        if not group.rigid[g, i]:
            share = dt2 * strain_share(group, g, i, h, decay) / divisor(group, g, i, step)
            start.factor[g, i] *= share if dt2 > AT_ONCE else 0.0


@kernel
def _add_compliance(
    group: Beams, g: int, step: tuple[float, float, float], values: np.ndarray
) -> None:
    """Add the derivatives of the equations at Gauss point ``g`` by its multipliers."""
    for i in range(COMPONENTS):
        if not group.rigid[g, i]:
            own = divisor(group, g, i, step)
            for j in range(COMPONENTS):
                place = group.compliance_block[g, i // 3, j // 3] + 3 * (i % 3) + j % 3
                values[place] += own_compliance(group, g, i, j) / own


_residual_of = either(__name__, "_residual_of", _residual, plane_midpoint.residual)
_jacobian_of = either(__name__, "_jacobian_of", _jacobian, plane_midpoint.jacobian)


@optional()
def residual(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    step: tuple[float, float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Subtract the mean forces from the frames' equations and set those of the strains; ``step`` is
    (h, dt2, chi/2).
    """
    _residual_of(group.plane, group, start, frames, step, Z, F)


@optional()
def jacobian(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    step: tuple[float, float, float],
    Z: np.ndarray,
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``residual`` at ``Z``."""
    _jacobian_of(group.plane, group, start, frames, step, Z, values)


@optional()
def accept(
    group: Beams, start: BeamsWorkspace, h: float, strain: np.ndarray, work: np.ndarray
) -> None:
    """Advance the ``strain`` (g, 6) by the solved step, and add the work of damping [J] to its
    columns of ``work``.
    """
    for g in range(group.element.size):
        column = group.column[group.beam[g]]
        if column >= 0:
            dissipated = 0.0
            for i in range(COMPONENTS):
                for j in range(COMPONENTS):
                    lag = group.damping[g, j] * start.change[g, j] / h
                    dissipated += start.change[g, i] * group.stiffness[g, i, j] * lag
            work[column] -= group.weight[g] * dissipated
        for i in range(COMPONENTS):
            strain[g, i] += start.change[g, i]


@optional(0.0)
def smooth(group: Beams, start: BeamsWorkspace, decay: float, pole: float) -> float:
    """Advance the smoothed changes of the strains of a decaying scheme by the accepted step; return
    the energy [J] that the scheme took from the beams. ``decay`` is chi/2.
    """
    loss = 0.0
    for g in range(group.element.size):
        for i in range(COMPONENTS):
            for j in range(COMPONENTS):
                lag = start.change[g, j] - start.rise[g, j]
                k = decay * group.weight[g] * group.stiffness[g, i, j]
                loss += start.change[g, i] * k * lag
        for i in range(COMPONENTS):
            start.rise[g, i] = pole * start.rise[g, i] + (1.0 - pole) * start.change[g, i]
    return loss
