"""Equations of beams over a step of the schemes of order 2.

    elastic:   w J ((eps0 + eps1)/2 + tau (eps1 - eps0)/h + chi/2 (eps1 - eps0 - s) + C lam) = 0
    rigid:     w J eps1 = 0                                               where C has zero rows

lam is the mean over the step, minus the stress resultants (``group``); eps counts from the
reference. chi and s are those of the decaying scheme, as with a spring (``forces.spring``). The
work of the beam's forces is lam . w J (eps1 - eps0) exactly (``strain``), so over a step the bodies
receive what w J eps . C^-1 eps/2 loses, less what damping takes, for any h and any stiffness.

An elastic equation is divided by 1 + c/dt2, c = w J C mass of its own multiplier, and by more with
damping: for a stiff beam it is a constraint, and for h -> 0 it determines the multiplier by the
strain at the start.
"""

import numpy as np

from msahl.algebra.vector import (
    Vector,
    add,
    at,
    combine,
    cross,
    matrix_at,
    multiple,
    product,
    scale,
)
from msahl.elements.beams.group import (
    BEND_Q,
    COMPONENTS,
    STRETCH_Q,
    STRETCH_U,
    Beams,
    BeamsWorkspace,
)
from msahl.elements.beams.stiffness import add_loads, add_stiffness
from msahl.elements.beams.strain import (
    Point,
    changes,
    director_loads,
    move,
    node_gradient,
    node_vectors,
    nodes_of,
    point_vectors,
    set_change,
    set_tangents,
)
from msahl.elements.frames import Frames, first_multiplier, push
from msahl.jit.kernel import kernel, optional

AT_ONCE = 1e-150
"""A dt2 [s^2] below this is no step: the equations are those of one configuration."""


@kernel
def multipliers(group: Beams, frames: Frames, Z: np.ndarray, g: int) -> tuple[Vector, Vector]:
    """Return lam of Gauss point ``g`` of multipliers by mass ``Z``: forces [N], moments [N m]."""
    node = first_multiplier(frames) + group.place[g]
    mass = group.mass[g]
    return scale(mass, at(Z, node)), scale(mass * group.length[g], at(Z, node + 1))


@kernel
def row_scale(group: Beams, g: int, i: int) -> float:
    """Return w J [m], times the length that makes an equation of kappa one in metres."""
    return group.weight[g] * (1.0 if i < 3 else group.length[g])


@kernel
def own_compliance(group: Beams, g: int, i: int, j: int) -> float:
    """Return w J C mass [s^2] of equation ``i`` and multiplier ``j`` by mass, both scaled."""
    length = 1.0 if j < 3 else group.length[g]
    return row_scale(group, g, i) * group.compliance[g, i, j] * group.mass[g] * length


@kernel
def strain_share(group: Beams, g: int, i: int, h: float, decay: float) -> float:
    """Return the derivative of an elastic equation ``i``, over w J, by the change of its strain."""
    return 0.5 + group.damping[g, i] / h + decay


@kernel
def divisor(group: Beams, g: int, i: int, step: tuple[float, float, float]) -> float:
    """Return what an elastic equation ``i``, times dt2, is divided by [s^2]."""
    h, dt2, decay = step
    return 2.0 * dt2 * strain_share(group, g, i, h, decay) + own_compliance(group, g, i, i)


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
    dt2 = step[1]
    move(group, start, frames, Z)
    for g in range(group.element.size):
        changed = changes(group, start, g)
        means = set_change(start, g, changed)
        n, m = multipliers(group, frames, Z, g)
        push_loads(
            group, start, frames, g, (scale(1.0 / dt2, n), scale(1.0 / dt2, m)), means, dt2, F
        )
        _set_equations(group, start, frames, g, step, Z, F)


@kernel
def push_loads(
    group: Beams,
    start: BeamsWorkspace,
    frames: Frames,
    g: int,
    lam: tuple[Vector, Vector],
    means: Point,
    dt2: float,
    F: np.ndarray,
) -> None:
    """Subtract the forces of ``lam`` at Gauss point ``g`` from the equations of its nodes."""
    by_r, by_d, by_slope = director_loads(lam[0], lam[1], means)
    first, count = nodes_of(group, g)
    for a in range(count):
        node = group.node[first + a]
        d, arm = node_vectors(start, node, 0.5)
        c, lever = group.weight[g] * group.value[g, a], group.weight[g] * group.slope[g, a]
        on = combine(c, by_d, multiple(lever, by_slope))
        force = scale(lever, by_r)
        moment = add(cross(d[0], on[0]), add(cross(d[1], on[1]), cross(d[2], on[2])))
        push(frames, dt2, F, group.frame[node], force, add(moment, cross(arm, force)))


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
    dt2 = step[1]
    move(group, start, frames, Z)
    set_tangents(group, start, frames, Z)
    for g in range(group.element.size):
        changed = changes(group, start, g)
        means = point_vectors(start, g, changed, 0.5)
        add_loads(group, start, frames, g, means, -1.0, values)
        n, m = multipliers(group, frames, Z, g)
        lam = (scale(1.0 / dt2, n), scale(1.0 / dt2, m))
        add_stiffness(group, start, frames, g, lam, (means, 0.5, -dt2), values)
        _add_equations(group, start, g, point_vectors(start, g, changed, 1.0), step, values)
        _add_compliance(group, g, step, values)


@kernel
def _add_equations(
    group: Beams,
    start: BeamsWorkspace,
    g: int,
    ends: Point,
    step: tuple[float, float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of the equations at Gauss point ``g`` by the places of its nodes;
    ``ends`` are the vectors there at the end of the step.
    """
    h, dt2, decay = step
    first, count = nodes_of(group, g)
    for a in range(count):
        m = group.node[first + a]
        d, arm = node_vectors(start, m, 1.0)
        G = matrix_at(start.tangent, m)
        gamma, kappa = node_gradient(d, arm, ends, group.value[g, a], group.slope[g, a])
        by_q = (product(gamma, G), product(kappa, G))
        places = group.load_block[g, a]
        for i in range(COMPONENTS):
            c = row_scale(group, g, i)
            if not group.rigid[g, i]:
                c *= strain_share(group, g, i, h, decay) * dt2 / divisor(group, g, i, step)
            if dt2 < AT_ONCE and not group.rigid[g, i]:
                c = 0.0
            row = i % 3
            place = places[STRETCH_Q] if i < 3 else places[BEND_Q]
            if place > 0:
                for k in range(3):
                    values[place + 3 * row + k] += c * by_q[i // 3][row][k]
            if i < 3 and places[STRETCH_U] > 0:
                for k in range(3):
                    values[places[STRETCH_U] + 3 * row + k] += (
                        c * group.slope[g, a] * ends[0][row][k]
                    )


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
            lost = 0.0
            for i in range(COMPONENTS):
                for j in range(COMPONENTS):
                    lag = group.damping[g, j] * start.change[g, j] / h
                    lost += start.change[g, i] * group.stiffness[g, i, j] * lag
            work[column] -= group.weight[g] * lost
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
