"""Coordinates over a step and at one configuration: values, changes, rates, unit forces.

A coordinate (``coordinate_kinds``) has four *parts*: the displacement and the rotation of its frame
A, and those of its frame B. Its unit force is what a multiplier of 1 exerts on the four parts:
sum w_i (-f, t_A, f, t_B)_i over its scalar products. Springs, friction and the multipliers of
constraint equations add their loads [N or N m] along a coordinate; ``push`` then adds the unit
forces times these loads to the frames' equations. Derivatives are in ``coordinate_jacobians``.
"""

import math

import numpy as np

from msahl.elements.constraints import products, surfaces
from msahl.elements.constraints.coordinate_kinds import (
    ANGLE,
    PLAIN,
    Coordinates,
    CoordinatesWorkspace,
    value,
    weigh,
)
from msahl.elements.constraints.products import PARTS, Q_A, Q_B, SURFACE, U_A, U_B
from msahl.formulations.absolute.equations import force_factor, moment_factor
from msahl.formulations.absolute.frames import Frames, displacement_node, rotation_node
from msahl.jit.kernel import apart, kernel, unit


@kernel
def prepare(
    group: Coordinates, x: np.ndarray, R: np.ndarray, angle: np.ndarray, start: CoordinatesWorkspace
) -> None:
    """Evaluate products and coordinates at the start, or those of them along which something acts;
    ``angle`` (q,) are the counted angles.
    """
    own, m, partial = group.products, start.products, start.partial[0]
    for k in range(own.kind.size):
        if not (partial and group.idle[group.coordinate[k]]):
            products.prepare(own, x, R, m, k)
    surfaces.prepare(own.surfaces, own, R, m)
    for q in range(group.kind.size):
        if not (partial and group.idle[q]):
            start.value[q] = value(group, start, angle[q], q)


@unit
def evaluate(
    group: Coordinates, start: CoordinatesWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Set changes, weights and unit forces at ``Z``, and the loads and their sizes to 0; of
    coordinates along which nothing acts the changes are set to 0 and all else is left.
    """
    for node in range(start.term_size.size):
        start.term_size[node] = 0.0
    own, m = group.products, start.products
    for k in range(own.kind.size):
        if group.idle[group.coordinate[k]]:
            continue
        if own.kind[k] == SURFACE:
            surfaces.evaluate(own.surfaces, own, m, frames, Z, k)
        else:
            products.evaluate(own, m, frames, Z, k)
    for q in range(group.kind.size):
        start.load[q] = start.size[q] = 0.0
        if group.idle[q]:
            start.change[q] = 0.0
            continue
        weigh(group, start, q)
        first = group.first[q]
        for i in range(3):
            f, t_a, t_b = 0.0, 0.0, 0.0
            for k in range(first, group.first[q + 1]):
                w = start.weights[q, k - first]
                f += w * m.f[k, i]
                t_a += w * m.t_a[k, i]
                t_b += w * m.t_b[k, i]
            start.force[q, U_A, i] = -f
            start.force[q, Q_A, i] = t_a
            start.force[q, U_B, i] = f
            start.force[q, Q_B, i] = t_b


@unit
def differentiate(
    group: Coordinates, start: CoordinatesWorkspace, frames: Frames, Z: np.ndarray
) -> None:
    """Set the derivatives of the changes by the unknowns at ``Z``, after ``evaluate``, but of
    coordinates along which nothing acts.
    """
    own, m = group.products, start.products
    for k in range(own.kind.size):
        if group.idle[group.coordinate[k]]:
            continue
        if own.kind[k] == SURFACE:
            surfaces.differentiate(own.surfaces, own, m, frames, Z, k)
        else:
            products.differentiate(own, m, frames, Z, k)
    for q in range(group.kind.size):
        if group.idle[q]:
            continue
        first = group.first[q]
        for part in range(PARTS):
            for i in range(3):
                start.slope[q, part, i] = 0.0
        for k in range(first, group.first[q + 1]):
            c = start.slopes[q, k - first]
            for i in range(3):
                start.slope[q, U_A, i] -= c * m.j_u[k, i]
                start.slope[q, Q_A, i] += c * m.j_a[k, i]
                start.slope[q, U_B, i] += c * m.j_u[k, i]
                start.slope[q, Q_B, i] += c * m.j_b[k, i]


@apart
def push(
    group: Coordinates, start: CoordinatesWorkspace, frames: Frames, factor: float, F: np.ndarray
) -> None:
    """Add ``factor`` times the gathered loads by mass to the equations of the frames."""
    for q in range(group.kind.size):
        if group.idle[q]:
            continue
        for part in range(PARTS):
            c = row_factor(group, frames, factor, q, part)
            node = part_node(group, frames, q, part)
            for i in range(3):
                arm = c * start.force[q, part, i]
                F[node, i] += arm * start.load[q]
                start.term_size[node] = max(start.term_size[node], abs(arm) * start.size[q])


@kernel
def extent(group: Coordinates, start: CoordinatesWorkspace, q: int) -> float:
    """Size [m, or 1 for an angle] of what the coordinate is computed from at the start: it is known
    no better than the round-off of that.
    """
    if group.kind[q] == ANGLE:
        return max(1.0, abs(start.value[q]))
    m, largest = start.products, 0.0
    for k in range(group.first[q], group.first[q + 1]):
        for i in range(3):
            largest = max(largest, abs(m.D[k, i]), abs(m.r_a[k, i]), abs(m.r_b[k, i]))
    return largest


@kernel
def row_factor(group: Coordinates, frames: Frames, factor: float, q: int, part: int) -> float:
    """Return what a unit force on a ``part`` adds to its rows: ``factor`` by mass, where ``factor``
    is 1 at one configuration and -dt2 over a step of the midpoint element.
    """
    first = group.first[q]
    body = group.products.a[first] if part < U_B else group.products.b[first]
    if part % 2 == U_A:
        return force_factor(frames, factor, body)
    return moment_factor(frames, factor, body)


@kernel
def part_frame(group: Coordinates, q: int, part: int) -> int:
    """Return the frame of a ``part``."""
    first = group.first[q]
    frame: int = group.products.a[first] if part < U_B else group.products.b[first]
    return frame


@kernel
def part_node(group: Coordinates, frames: Frames, q: int, part: int) -> int:
    """Return the node of the unknowns and equations of a ``part``."""
    first = group.first[q]
    body = group.products.a[first] if part < U_B else group.products.b[first]
    is_displacement = part % 2 == U_A
    return displacement_node(frames, body) if is_displacement else rotation_node(frames, body)


@kernel
def slopes(group: Coordinates, start: CoordinatesWorkspace) -> None:
    """Set the derivatives of q and of w to those at the start, as for a step without motion."""
    for q in range(group.kind.size):
        if group.idle[q]:
            continue
        for k in range(group.first[q], group.first[q + 1]):
            start.products.change[k] = 0.0
        weigh(group, start, q)


@kernel
def count_rotations(group: Coordinates, start: CoordinatesWorkspace, angle: np.ndarray) -> None:
    """Set the counted angles (q,) to those at the start, less than half a revolution away."""
    for q in range(group.kind.size):
        if group.kind[q] == ANGLE:
            first = group.first[q]
            m = start.products.value
            change = math.atan2(m[first], m[first + 1]) - angle[q]
            angle[q] += change - 2.0 * math.pi * round(change / (2.0 * math.pi))
            start.value[q] = angle[q]


@kernel
def product_rates(
    group: Coordinates, start: CoordinatesWorkspace, v: np.ndarray, W: np.ndarray, k: int
) -> tuple[float, float]:
    """Return the rate of a product, and its second derivative at zero accelerations."""
    own, m = group.products, start.products
    if own.kind[k] == SURFACE:
        return (
            surfaces.rate(own.surfaces, own, m, v, W, k),
            surfaces.rate_of_slip(own.surfaces, own, m, v, W, k),
        )
    return products.free_acceleration(own, m, v, W, k)


@unit
def rates(
    group: Coordinates, start: CoordinatesWorkspace, v: np.ndarray, W: np.ndarray, rate: np.ndarray
) -> None:
    """Set ``rate`` (q,) to the rates at the start, after ``slopes`` or ``evaluate``; to 0 where
    nothing acts.
    """
    for q in range(group.kind.size):
        first = group.first[q]
        rate[q] = 0.0
        if group.idle[q]:
            continue
        for k in range(first, group.first[q + 1]):
            m_rate, _ = product_rates(group, start, v, W, k)
            rate[q] += start.slopes[q, k - first] * m_rate


@kernel
def coordinate_acceleration(
    group: Coordinates, start: CoordinatesWorkspace, v: np.ndarray, W: np.ndarray, q: int
) -> float:
    """Return the second derivative of a coordinate at zero accelerations, after ``evaluate`` with
    the unknowns 0.
    """
    first, last = group.first[q], group.first[q + 1]
    total = 0.0
    for k in range(first, last):
        rate, second = product_rates(group, start, v, W, k)
        total += start.slopes[q, k - first] * second
        if group.kind[q] == PLAIN:
            continue
        for i in range(first, last):
            other, _ = product_rates(group, start, v, W, i)
            total += 2.0 * start.curves[q, k - first, i - first] * rate * other
    return total
