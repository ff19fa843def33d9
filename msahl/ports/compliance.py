"""Springs in the compliance form: their loads are unknowns of the step, as multipliers are.

The law is that of ``laws.spring`` with a damper, divided by the stiffness:

    lam/k + e + T_0/k + tau e_dot = 0          load lam along q [N, or N m along an angle]

e = q - q_free  elongation [m or rad]           tau = c/k   retardation time of the damper [s]

Over a step of size h of the midpoint element, with e1 = e0 + dq and the mean load lam,

    lam/k + (e0 + e1)/2 + T_0/k + tau dq/h + chi/2 (dq - s) = 0

which is that of ``coordinate`` in exact arithmetic: energy and work are the same. But a step
solves for lam and for the positions together. So a large stiffness is a small compliance: no large
number multiplies the round-off of positions, and Newton's method converges as it does for a
constraint. The elongation is carried on by its changes, like a violation; its round-off is that of
the motion over the steps, not that of positions.

In collocation steps the law is an equation at each node c_i, where lam acts as all forces do. At
one configuration the load follows from places and rates, so accelerations, equilibria and linear
models have it as a force; there the unknown stands alone, in an equation with the factor one.

An equation is divided by 1 + c/dt2, c = mass/k, and by more with damping, as those of elastic
strains are (``elements.beams.midpoint``): a stiff spring has the equation of a constraint, and that
of a soft one determines its load. Multipliers are scaled as all are
(``formulations.absolute.multipliers``).
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import Laws
from msahl.algebra.rotation import to_increment
from msahl.algebra.vector import at, put
from msahl.elements.constraints import coordinates
from msahl.elements.constraints.coordinate_jacobians import rate_gradient
from msahl.elements.constraints.coordinate_kinds import (
    Coordinates,
    CoordinatesWorkspace,
    Derivatives,
)
from msahl.elements.constraints.coordinates import part_frame, row_factor
from msahl.elements.constraints.products import PARTS, U_A, U_B
from msahl.formulations.absolute.frames import (
    Frames,
    FramesWorkspace,
    displacement_node,
    put_rotation,
    rotation_increment,
)
from msahl.formulations.absolute.multipliers import by_unknown, multiplier, place_of
from msahl.jit.kernel import kernel, optional
from msahl.ports import coordinate as spring
from msahl.ports.coordinate import AlongForces


class Compliances(NamedTuple):
    """The springs whose loads are unknowns of the step; units are those of the coordinate."""

    spring: np.ndarray  # (c,) number among all springs
    place: np.ndarray  # (c, 2) of multiplier and equation: multipliers' node, and its slot
    compliance: np.ndarray  # (c,) 1/k
    mass: np.ndarray  # (c,) [kg]
    scale: np.ndarray  # (c,) [m] for one along an angle, or 1
    force_block: np.ndarray  # (c, 4) starts of the blocks of the coordinate's parts by the node
    equation_block: np.ndarray  # (c, 4) and of the node by the parts
    own_block: np.ndarray  # (c,) and of the node by itself


@kernel
def coordinate_of(group: Compliances, springs: AlongForces, j: int) -> int:
    """Return the coordinate along which spring ``j`` acts."""
    q: int = springs.coordinate[group.spring[j]]
    return q


@kernel
def retardation(group: Compliances, springs: AlongForces, j: int) -> float:
    """Return tau [s]."""
    tau: float = group.compliance[j] * springs.damping[group.spring[j]]
    return tau


@kernel
def own_compliance(group: Compliances, j: int) -> float:
    """Return c [s^2], by which an equation changes with its multiplier by mass, both scaled."""
    c: float = group.scale[j] * group.scale[j] * group.mass[j] * group.compliance[j]
    return c


@kernel
def share_of_change(group: Compliances, springs: AlongForces, j: int, h: float) -> float:
    """Return the derivative of an equation over a step, before scaling, by the change of q."""
    decay = group.compliance[j] * springs.decay[group.spring[j]]
    return 0.5 + retardation(group, springs, j) / h + decay


@kernel
def strain(group: Compliances, springs: AlongForces, j: int, elongation: float) -> float:
    """Return e + T_0/k."""
    return elongation + group.compliance[j] * springs.constants[group.spring[j], 0]


@optional()
def set_loads(
    group: Compliances,
    springs: AlongForces,
    laws: Laws,
    frames: Frames,
    start: CoordinatesWorkspace,
    rate: np.ndarray,
    load: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set ``load`` (c,) to the loads by places and ``rate`` (q,), and the equations of the index-1
    problem to the multipliers of these.
    """
    for j in range(group.spring.size):
        s, q = group.spring[j], coordinate_of(group, springs, j)
        T, _ = spring.tension(springs, laws, s, spring.elongation(springs, start, s))
        load[j] = -T - springs.damping[s] * rate[q]
        node, slot = place_of(group, frames, j)
        F[node, slot] = load[j] / by_unknown(group, 1.0, j)


@optional()
def add_loads(
    group: Compliances, springs: AlongForces, load: np.ndarray, start: CoordinatesWorkspace
) -> None:
    """Add ``load`` (c,) to the coordinates' loads."""
    for j in range(group.spring.size):
        q = coordinate_of(group, springs, j)
        start.load[q] += load[j]
        start.size[q] += abs(load[j])


@optional()
def add_derivatives(
    group: Compliances,
    springs: AlongForces,
    laws: Laws,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    out: Derivatives,
) -> None:
    """Add the derivatives of the loads by places and rates, of ``set_loads``, by mass."""
    for j in range(group.spring.size):
        spring.add_derivative(
            springs, laws, group.spring[j], coords, start, frames, motion, (0.0, 0.0), out
        )


@optional()
def isolate_multipliers(group: Compliances, values: np.ndarray) -> None:
    """Set the derivatives of the equations by their own multipliers to one, as they are at one
    configuration, where they have no others.
    """
    for j in range(group.spring.size):
        values[_own_place(group, j)] = 1.0


@kernel
def _own_place(group: Compliances, j: int) -> int:
    place: int = group.own_block[j] + 4 * group.place[j, 1]
    return place


@kernel
def divisor(group: Compliances, springs: AlongForces, j: int, step: tuple[float, float]) -> float:
    """Return what an equation, times dt2, is divided by [s^2]; ``step`` is (h, dt2)."""
    h, dt2 = step
    return 2.0 * dt2 * share_of_change(group, springs, j, h) + own_compliance(group, j)


@optional()
def mean_residual(
    group: Compliances,
    springs: AlongForces,
    start: CoordinatesWorkspace,
    elongation: np.ndarray,
    stretch: np.ndarray,
    frames: Frames,
    step: tuple[float, float],
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Add the multipliers to the coordinates' loads, and set their equations over the ``step``
    (h, dt2); ``elongation`` (c,) is that at its start, ``stretch`` (s,) are the smoothed changes.
    """
    h, dt2 = step
    for j in range(group.spring.size):
        s, q = group.spring[j], coordinate_of(group, springs, j)
        node, slot = place_of(group, frames, j)
        lam = multiplier(group, frames, Z, dt2, j)
        start.load[q] += lam
        start.size[q] += abs(lam)
        row = strain(group, springs, j, elongation[j])
        row += share_of_change(group, springs, j, h) * start.change[q]
        row -= group.compliance[j] * springs.decay[s] * stretch[s]
        row = dt2 * group.scale[j] * row + own_compliance(group, j) * Z[node, slot]
        F[node, slot] = row / divisor(group, springs, j, step)


@optional()
def mean_jacobian(
    group: Compliances,
    springs: AlongForces,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    step: tuple[float, float],
    values: np.ndarray,
) -> None:
    """Add the derivatives of ``mean_residual``, but for those of the unit forces."""
    h, dt2 = step
    for j in range(group.spring.size):
        own = divisor(group, springs, j, step)
        share = dt2 * share_of_change(group, springs, j, h) / own
        _add_blocks(group, springs, coords, start, frames, (-dt2, share), j, values)
        values[_own_place(group, j)] = own_compliance(group, j) / own


@kernel
def _add_blocks(
    group: Compliances,
    springs: AlongForces,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    factors: tuple[float, float],
    j: int,
    values: np.ndarray,
) -> None:
    """Add the first of the ``factors`` times the derivatives of the accelerations by multiplier
    ``j``, whose unknown is as much times it by mass, and the second times those of q by the places.
    """
    factor, share = factors
    q, slot = coordinate_of(group, springs, j), group.place[j, 1]
    for part in range(PARTS):
        down, right = group.force_block[j, part], group.equation_block[j, part]
        if down > 0:
            by_lam = by_unknown(group, factor, j) * row_factor(coords, frames, factor, q, part)
            for i in range(3):
                values[down + 3 * i + slot] += by_lam * start.force[q, part, i]
                slope = group.scale[j] * start.slope[q, part, i]
                values[right + 3 * slot + i] += share * slope


@optional()
def accept(
    group: Compliances,
    springs: AlongForces,
    start: CoordinatesWorkspace,
    elongation: np.ndarray,
) -> None:
    """Advance ``elongation`` (c,) by the changes over the step evaluated last."""
    for j in range(group.spring.size):
        elongation[j] += start.change[coordinate_of(group, springs, j)]


@optional()
def set_stage_elongations(
    group: Compliances,
    springs: AlongForces,
    coords: Coordinates,
    begin: CoordinatesWorkspace,
    frames: Frames,
    increments: np.ndarray,
    elongations: tuple[np.ndarray, np.ndarray],
) -> None:
    """Set the second of ``elongations`` (c,) to those after the ``increments`` (nodes, 3) u and l Q
    since the start of the step, whose workspace is ``begin`` and whose elongations are the first.
    """
    coordinates.evaluate(coords, begin, frames, increments)
    for j in range(group.spring.size):
        change = begin.change[coordinate_of(group, springs, j)]
        elongations[1][j] = elongations[0][j] + change


@optional()
def set_increments(
    group: Compliances,
    springs: AlongForces,
    coords: Coordinates,
    frames: Frames,
    Z: np.ndarray,
    increments: np.ndarray,
) -> None:
    """Set the ``increments`` (nodes, 3) u and l Q of the springs' frames by the displacements and
    rotation parameters ``Z``.
    """
    for j in range(group.spring.size):
        for part in (U_A, U_B):
            f = part_frame(coords, coordinate_of(group, springs, j), part)
            u = displacement_node(frames, f)
            put(increments, u, at(Z, u))
            put_rotation(frames, increments, f, to_increment(rotation_increment(frames, Z, f)))


@optional()
def correct_elongations(
    group: Compliances,
    springs: AlongForces,
    start: CoordinatesWorkspace,
    share: float,
    elongation: np.ndarray,
) -> None:
    """Bring ``elongation`` (c,), which follows by increments, nearer to that of the configuration
    by a ``share`` of the difference, which is round-off; 1 sets it.
    """
    for j in range(group.spring.size):
        s = group.spring[j]
        difference = spring.elongation(springs, start, s) - springs.free[s] - elongation[j]
        elongation[j] += share * difference


@kernel
def stage_divisor(group: Compliances, springs: AlongForces, j: int, h: float) -> float:
    """Return what an equation at a node, times h^2/2, is divided by [s^2]."""
    return h * (0.5 * h + retardation(group, springs, j)) + own_compliance(group, j)


@optional()
def set_stage_equations(
    group: Compliances,
    springs: AlongForces,
    frames: Frames,
    node_values: tuple[np.ndarray, np.ndarray, np.ndarray],
    h: float,
    Z: np.ndarray,
    F: np.ndarray,
) -> None:
    """Set the equations at a node c_i and its loads by the multipliers; ``node_values`` are
    elongations (c,), rates (q,) and loads (c,), ``Z`` the unknowns of that stage.
    """
    elongation, rate, load = node_values
    dt2 = 0.5 * h * h
    for j in range(group.spring.size):
        q = coordinate_of(group, springs, j)
        node, slot = place_of(group, frames, j)
        load[j] = multiplier(group, frames, Z, dt2, j)
        row = strain(group, springs, j, elongation[j])
        row += retardation(group, springs, j) * rate[q]
        row = dt2 * group.scale[j] * row + own_compliance(group, j) * Z[node, slot]
        F[node, slot] = row / stage_divisor(group, springs, j, h)


@optional()
def add_stage_derivatives(
    group: Compliances,
    springs: AlongForces,
    coords: Coordinates,
    start: CoordinatesWorkspace,
    frames: Frames,
    motion: FramesWorkspace,
    h: float,
    out: Derivatives,
) -> None:
    """Add the derivatives of the accelerations by multipliers by mass, of the equations over h by
    places and by rates, and of the equations by their own multipliers.
    """
    for j in range(group.spring.size):
        divided_by, tau = stage_divisor(group, springs, j, h), retardation(group, springs, j)
        share = 0.5 * h / divided_by
        _add_blocks(group, springs, coords, start, frames, (1.0, share), j, out.by_place)
        out.by_place[_own_place(group, j)] += own_compliance(group, j) / divided_by
        if tau > 0.0:
            q, slot, c = coordinate_of(group, springs, j), group.place[j, 1], share * tau
            half = rate_gradient(coords, start, frames, motion, q, out)
            for part in range(PARTS):
                right = group.equation_block[j, part] + 3 * slot
                if group.equation_block[j, part] > 0:
                    for i in range(3):
                        of_rate = c * group.scale[j]
                        out.by_rate[right + i] += of_rate * start.slope[q, part, i]
                        out.by_place[right + i] += 2.0 * of_rate * half[part][i]
