"""Beams in collocation steps: rigid strains are constraints, elastic ones forces with multipliers.

At the time nodes t_j of the constraints      w J eps = 0                          rigid
at the nodes c_i of the forces                w J (eps + tau d(eps)/dt + C lam) = 0    elastic

The multipliers of elastic strains act at their own c_i, as all forces do, so the schemes have their
orders; a stiff beam has no large number in its equations. Strains are those of the start of the
step and their changes (``strain``). Equations and multipliers are scaled as in ``midpoint``.
"""

import numpy as np

from msahl.algebra.rotation import to_increment
from msahl.algebra.vector import Matrix, Vector, add, at, cross, matrix_at, product, put, scale
from msahl.elements.beams import plane, plane_stage
from msahl.elements.beams.group import (
    BEND_Q,
    COMPONENTS,
    STRETCH_Q,
    STRETCH_U,
    Beams,
    BeamsWorkspace,
)
from msahl.elements.beams.instant import motion_at, point_at, strain_rates
from msahl.elements.beams.midpoint import node_load
from msahl.elements.beams.plane import either
from msahl.elements.beams.rows import (
    ELASTIC,
    RIGID,
    add_equations,
    add_rows,
    chosen,
    multipliers,
    own_compliance,
    row_scale,
)
from msahl.elements.beams.step_scales import stage_divisor
from msahl.elements.beams.stiffness import add_loads, add_stiffness, collect
from msahl.elements.beams.strain import (
    changes,
    director_loads,
    move,
    node_gradient,
    node_vectors,
    nodes_of,
    set_change,
    set_tangents,
    strain_at,
)
from msahl.formulations.absolute.equations import push
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    displacement_node,
    first_multiplier,
    put_rotation,
    rotation_increment,
)
from msahl.jit.kernel import kernel, optional


@kernel
def _set_changes(
    group: Beams, begin: BeamsWorkspace, frames: Frames, increments: np.ndarray
) -> None:
    """Set the changes of the strains by the displacements and rotation ``increments``."""
    move(group, begin, frames, increments)
    for g in range(group.element.size):
        set_change(begin, g, changes(group, begin, g))


set_changes = either(__name__, "set_changes", _set_changes, plane.set_changes)


@optional()
def set_strains(
    group: Beams,
    begin: BeamsWorkspace,
    frames: Frames,
    increments: np.ndarray,
    strain: np.ndarray,
) -> None:
    """Set ``strain`` (g, 6) to that after the ``increments`` (nodes, 3) u and l Q since the start
    of the step, whose workspace is ``begin``.
    """
    set_changes(group.plane, group, begin, frames, increments)
    for g in range(group.element.size):
        for i in range(COMPONENTS):
            strain[g, i] = begin.strain[g, i] + begin.change[g, i]


@optional()
def accept(
    group: Beams,
    begin: BeamsWorkspace,
    frames: Frames,
    Z: np.ndarray,
    increments: np.ndarray,
    strain: np.ndarray,
) -> None:
    """Set ``strain`` (g, 6) to that at the end of the step, where ``Z`` are the displacements and
    rotation parameters; ``increments`` (nodes, 3) is a work array.
    """
    for m in range(group.frame.size):
        f = group.frame[m]
        u = displacement_node(frames, f)
        put(increments, u, at(Z, u))
        put_rotation(frames, increments, f, to_increment(rotation_increment(frames, Z, f)))
    set_changes(group.plane, group, begin, frames, increments)
    for g in range(group.element.size):
        for i in range(COMPONENTS):
            strain[g, i] += begin.change[g, i]


@optional()
def correct_strains(group: Beams, start: BeamsWorkspace, share: float) -> None:
    """Bring the strains, which follow by increments, nearer to those of the configuration by a
    ``share`` of the difference, which is round-off.
    """
    for g in range(group.element.size):
        gamma, kappa = strain_at(group, start, g)
        for i in range(3):
            start.strain[g, i] += share * (gamma[i] - start.strain[g, i])
            start.strain[g, 3 + i] += share * (kappa[i] - start.strain[g, 3 + i])


@optional()
def set_multipliers(
    group: Beams, frames: Frames, h: float, Z: np.ndarray, at_rest: np.ndarray
) -> None:
    """Set the multipliers by mass in ``at_rest`` by the unknowns ``Z``, h^2/2 times these."""
    for g in range(group.element.size):
        node = first_multiplier(frames) + group.place[g]
        for k in range(2):
            put(at_rest, node + k, scale(2.0 / (h * h), at(Z, node + k)))


@kernel
def _add_forces(
    group: Beams, node: BeamsWorkspace, frames: Frames, which: int, Z: np.ndarray, F: np.ndarray
) -> None:
    for g in range(group.element.size):
        n, m = multipliers(group, frames, Z, g)
        n, m = chosen(group, g, 0, which, n), chosen(group, g, 3, which, m)
        loads = director_loads(n, m, point_at(node, g))
        first, count = nodes_of(group, g)
        for a in range(count):
            force, moment = node_load(group, node, g, a, loads)
            push(frames, 1.0, F, group.frame[group.node[first + a]], force, moment)


_forces = either(__name__, "_forces", _add_forces, plane_stage.add_forces)
"""Adds the forces of the multipliers ``which``, by mass in ``Z``, to the accelerations ``F``."""


@optional()
def add_rigid_forces(
    group: Beams, node: BeamsWorkspace, frames: Frames, Z: np.ndarray, F: np.ndarray
) -> None:
    """Add the forces of rigid strains, multipliers by mass in ``Z``, to the accelerations ``F``."""
    _forces(group.plane, group, node, frames, RIGID, Z, F)


@optional()
def add_elastic_forces(
    group: Beams, node: BeamsWorkspace, frames: Frames, Z: np.ndarray, F: np.ndarray
) -> None:
    """Add the forces of elastic strains, as ``add_rigid_forces``."""
    _forces(group.plane, group, node, frames, ELASTIC, Z, F)


@optional()
def set_violations(group: Beams, node: BeamsWorkspace, frames: Frames, F: np.ndarray) -> None:
    """Set the equations of rigid strains to these, times w J [m]."""
    for g in range(group.element.size):
        place = first_multiplier(frames) + group.place[g]
        for i in range(COMPONENTS):
            if group.rigid[g, i]:
                F[place + i // 3, i % 3] = row_scale(group, g, i) * node.strain[g, i]


@kernel
def _set_elastic_equations(
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    dt2 = 0.5 * h * h
    for g in range(group.element.size):
        place = first_multiplier(frames) + group.place[g]
        rate = strain_rates(point_at(node, g), motion_at(group, node, motion.v, motion.W, g)[0])
        for i in range(COMPONENTS):
            if group.rigid[g, i]:
                continue
            strain = node.strain[g, i] + group.damping[g, i] * rate[i // 3][i % 3]
            row = dt2 * row_scale(group, g, i) * strain
            for j in range(COMPONENTS):
                row += own_compliance(group, g, i, j) * Z[place + j // 3, j % 3]
            F[place + i // 3, i % 3] = row / stage_divisor(group, g, i, h)


_elastic_equations = either(
    __name__, "_elastic_equations", _set_elastic_equations, plane_stage.set_elastic_equations
)


@optional()
def set_elastic_equations(
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equations of elastic strains at c_i; ``Z`` are the unknowns of that stage."""
    _elastic_equations(group.plane, group, node, frames, motion, h, Z, F)


@kernel
def _add_rigid_derivatives(
    group: Beams, node: BeamsWorkspace, frames: Frames, Z: np.ndarray, values: np.ndarray
) -> None:
    set_tangents(group, node, frames, Z)
    for g in range(group.element.size):
        here = point_at(node, g)
        _add_force_derivatives(group, node, frames, g, RIGID, Z, values)
        for i in range(COMPONENTS):
            rigid = group.rigid[g, i]
            node.factor[g, i] = row_scale(group, g, i) if rigid else 0.0
        add_equations(group, node, g, here, values)
    add_stiffness(group, node, frames, 1.0, 1.0, values)


_rigid_derivatives = either(
    __name__, "_rigid_derivatives", _add_rigid_derivatives, plane_stage.add_rigid_derivatives
)


@optional()
def add_rigid_derivatives(
    group: Beams, node: BeamsWorkspace, frames: Frames, Z: np.ndarray, values: np.ndarray
) -> None:
    """Add the derivatives at one configuration: of ``add_rigid_forces`` by places and multipliers
    by mass, and of the equations of rigid strains by places.
    """
    _rigid_derivatives(group.plane, group, node, frames, Z, values)


@kernel
def _add_force_derivatives(
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
    here = point_at(node, g)
    add_loads(group, node, frames, g, here, (1.0, which), values)
    n, m = multipliers(group, frames, Z, g)
    lam = (chosen(group, g, 0, which, n), chosen(group, g, 3, which, m))
    collect(group, node, g, lam, here)


@kernel
def _add_elastic_derivatives(
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    Z: np.ndarray,
    out: tuple[np.ndarray, np.ndarray],
) -> None:
    by_place, by_rate = out
    set_tangents(group, node, frames, Z)
    for g in range(group.element.size):
        here = point_at(node, g)
        _add_force_derivatives(group, node, frames, g, ELASTIC, Z, by_place)
        damped = False
        for i in range(COMPONENTS):
            c = 0.0
            if not group.rigid[g, i]:
                c = 0.5 * h * row_scale(group, g, i) / stage_divisor(group, g, i, h)
            node.factor[g, i] = c
            damped = damped or group.damping[g, i] * c > 0.0
        add_equations(group, node, g, here, by_place)
        if damped:
            for i in range(COMPONENTS):
                node.factor[g, i] *= group.damping[g, i]
            add_equations(group, node, g, here, by_rate)
            add_rate_slopes(group, node, motion, g, by_place)
        _add_compliance(group, g, h, by_place)
    add_stiffness(group, node, frames, 1.0, 1.0, by_place)


_elastic_derivatives = either(
    __name__, "_elastic_derivatives", _add_elastic_derivatives, plane_stage.add_elastic_derivatives
)


@optional()
def add_elastic_derivatives(
    group: Beams,
    node: BeamsWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    Z: np.ndarray,
    out: tuple[np.ndarray, np.ndarray],
) -> None:
    """Add the derivatives of ``add_elastic_forces`` by places and multipliers by mass, and of the
    equations of elastic strains over h by places and by rates, and by their own multipliers, to
    ``out``: by places and by rates.
    """
    _elastic_derivatives(group.plane, group, node, frames, motion, h, Z, out)


@kernel
def _add_compliance(group: Beams, g: int, h: float, values: np.ndarray) -> None:
    """Add the derivatives of the elastic equations at Gauss point ``g`` by their unknowns."""
    for i in range(COMPONENTS):
        if not group.rigid[g, i]:
            for j in range(COMPONENTS):
                place = group.compliance_block[g, i // 3, j // 3] + 3 * (i % 3) + j % 3
                values[place] += own_compliance(group, g, i, j) / stage_divisor(group, g, i, h)


@kernel
def add_rate_slopes(
    group: Beams, node: BeamsWorkspace, motion: FramesWorkspace, g: int, values: np.ndarray
) -> None:
    """Add ``node.factor`` times the derivatives of the rates of the strains at Gauss point ``g`` by
    the places, at fixed velocities: those of the strains with rates of the vectors in place of the
    vectors, w_b the angular velocity of the node.
    """
    (D, B, r), (D1, B1, r1) = point_at(node, g), motion_at(group, node, motion.v, motion.W, g)[0]
    first, count = nodes_of(group, g)
    for b in range(count):
        m = group.node[first + b]
        w, places = at(motion.W, group.frame[m]), group.load_block[g, b]
        slope, G = group.slope[g, b], matrix_at(node.tangent, m)
        seen = (_seen(D, w, D1), _seen(B, w, B1), add(cross(r, w), r1))
        d, arm = node_vectors(node, m, 1.0)
        gamma, kappa = node_gradient(d, arm, seen, group.value[g, b], slope)
        add_rows(node, g, 0, places[STRETCH_Q], product(gamma, G), values)
        add_rows(node, g, 3, places[BEND_Q], product(kappa, G), values)
        by_u = (scale(slope, D1[0]), scale(slope, D1[1]), scale(slope, D1[2]))
        add_rows(node, g, 0, places[STRETCH_U], by_u, values)


@kernel
def _seen(a: Matrix, w: Vector, rate: Matrix) -> Matrix:
    """Return the rows a_i x w plus those of ``rate``."""
    return (
        add(cross(a[0], w), rate[0]),
        add(cross(a[1], w), rate[1]),
        add(cross(a[2], w), rate[2]),
    )
