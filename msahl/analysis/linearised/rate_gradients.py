"""Derivatives of the rates of all constraint equations by the places, at fixed v and W: B.

    coinciding points    g' = v_b + W_b x r_b - v_a - W_a x r_a
                         B = -[W][r] for b, +[W][r] for a
    scalar equations     g' = sum c S'(q) q'
                         B = sum c (S' dq'/dq + S'' q' q_q)

Plain Python: a millisecond an equation.
"""

import numpy as np

from msahl.algebra.functions import evaluate as law
from msahl.analysis.linearised.coefficients import coefficients, skews
from msahl.analysis.linearised.plain_units import acting_rows, coordinate_numbers
from msahl.elements.constraints import coordinates
from msahl.elements.constraints.coordinate_jacobians import rate_gradient
from msahl.elements.constraints.coordinate_kinds import Derivatives
from msahl.elements.constraints.products import PARTS, U_B
from msahl.system import evaluate
from msahl.system.arrays import (
    State,
    System,
    SystemWorkspace,
    new_system_workspace,
    node_count,
)


def rates_by_place(system: System, state: State) -> np.ndarray:
    """(c, n) B of all constraint equations in plain units."""
    start = new_system_workspace(system, state)
    evaluate.prepare(system, state, start)
    B = np.zeros((3 * system.coincide.a.size, node_count(system), 3))
    _coinciding(system, start, B.reshape(-1, 3, node_count(system), 3))
    if system.scalar:
        B = np.concatenate([B, _scalar(system, start)[acting_rows(system)]])
    flat: np.ndarray = B.reshape(len(B), 3 * node_count(system))[:, coordinate_numbers(system)]
    if system.beams is None:
        return flat
    strains = coefficients(system, state).constraint_rate[len(B) :]
    return np.concatenate([flat, strains.toarray()])


def _coinciding(system: System, start: SystemWorkspace, B: np.ndarray) -> None:
    """Set ``B`` (k, 3, nodes, 3)."""
    group, frames, W = system.coincide, system.frames, start.frames.W
    each = np.arange(group.a.size)
    for bodies, arms, sign in (
        (group.a, start.coincide.r_a, 1.0),
        (group.b, start.coincide.r_b, -1.0),
    ):
        B[each, :, frames.rotation[bodies], :] += sign * skews(W[bodies]) @ skews(arms)


def _scalar(system: System, start: SystemWorkspace) -> np.ndarray:
    """(r, nodes, 3) B of the scalar equations."""
    assert system.scalar is not None
    frames, motion, scratch = system.frames, start.frames, np.zeros_like(system.constant)
    coords, own, rows = (
        system.scalar.coordinates,
        start.scalar.coordinates,
        system.scalar.equations,
    )
    still = np.zeros((node_count(system), 3))
    coordinates.evaluate(coords, own, frames, still)
    coordinates.differentiate(coords, own, frames, still)
    coordinates.rates(coords, own, motion.v, motion.W, start.scalar.rate)
    out = Derivatives(scratch, scratch, scratch, still)
    B = np.zeros((rows.function.size, node_count(system), 3))
    sums = system.scalar.sums
    terms = [
        (r, int(rows.coordinate[r, side]), side, float(rows.coefficient[r, side]))
        for r, side in np.argwhere(rows.coordinate >= 0).tolist()
    ]
    if sums is not None:
        more = zip(sums.row, sums.coordinate, sums.weight, strict=True)
        terms += [(int(r), int(q), 0, float(w)) for r, q, w in more]
    for r, q, side, c in terms:
        curve = 0.0
        if side == 1 and rows.function[r] >= 0:
            _, slope, second = law(system.laws, int(rows.function[r]), float(own.value[q]))
            c, curve = c * slope, c * second * float(start.scalar.rate[q])
        half = rate_gradient(coords, own, frames, motion, q, out)
        first = coords.first[q]
        for part in range(PARTS):
            frame = coords.products.a[first] if part < U_B else coords.products.b[first]
            node = (frames.rotation if part % 2 else frames.displacement)[frame]
            by_unknown = 2.0 * c * np.array(half[part]) + curve * own.slope[q, part]
            B[r, node] += by_unknown * (frames.length[frame] if part % 2 else 1.0)
    return B
