"""Equilibria in words."""

from collections.abc import Sequence

import numpy as np

from msahl.algebra.rotation import compose, to_axis_angle
from msahl.algebra.rotation import inverse as opposite
from msahl.algebra.vector import at
from msahl.analysis.equilibria.equilibrium import Solution, size_of
from msahl.analysis.equilibria.stability import stability
from msahl.analysis.equilibria.tables import state_row
from msahl.analysis.linearised.contact_lines import RANGE, contact_lines, sticks
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.steady import residual_in_words
from msahl.analysis.modes.mode_lines import counted

ROUND_OFF = 1e-12
"""Position, over the size of the model, and rotation [rad] that are shown as zero: thousands of
machine epsilons, by which searches and closed joints leave what is zero."""
MOST_BODIES = 20
"""Bodies whose places are printed; the table has all."""


def lines(start: Point, found: list[Solution], in_space: Sequence[str] = ()) -> list[str]:
    """Return a paragraph for each equilibrium; that of the first has what is known of the error
    ``in_space``.
    """
    title = start.model.simulation.title or "model"
    if len(found) != 1:
        title += f": {len(found)} equilibria"
    shown = [title]
    for number, solution in enumerate(found, start=1):
        point, balance = solution.place.point, solution.place.balance
        flat = solution.flat
        head = f"equilibrium {number}: {stability(point, bool(flat))}"
        shown += [
            "",
            head,
            f"  residual {residual_in_words(balance.residual, balance.relative)}, "
            f"{counted(solution.iterations, 'iteration')} of {solution.method}"
            + (f"; {counted(flat, 'direction')} without stiffness" if flat else ""),
            *(f"  {line}" for line in contact_lines(point)),
            *([f"  {RANGE}"] if sticks(point) else []),
            *_places(start, point),
            *(in_space if number == 1 else ()),
        ]
    return shown


def _rounded(value: float, size: float) -> float:
    """Return a ``value``, or 0 where it is round-off beside a ``size``."""
    return 0.0 if abs(value) <= ROUND_OFF * size else value


def _places(start: Point, point: Point) -> list[str]:
    """Return lines with the reference points of bodies, and how far they moved from the start; of
    each beam those of its last node.
    """
    states, first, model = state_row(point), state_row(start), point.model
    nodes = {name for beam in model.beams for name in beam.nodes} | set(model.hidden)
    bodies = [b for b, body in enumerate(model.bodies) if body.name not in nodes]
    ends = {beam.nodes[-1]: beam.name for beam in model.beams}
    shown, size = [], size_of(point)
    for b in bodies[:MOST_BODIES] + [b for b, body in enumerate(model.bodies) if body.name in ends]:
        row, before = states[12 * b : 12 * b + 3], first[12 * b : 12 * b + 3]
        place = ", ".join(f"{_rounded(x, size):.9g}" for x in row)
        relative = compose(at(point.state.p, b), opposite(at(start.state.p, b)))
        angle = _rounded(to_axis_angle(relative)[1], 1.0)
        moved = _rounded(float(np.linalg.norm(row - before)), size)
        name = model.bodies[b].name
        shown.append(
            f"  {f'last node of {ends[name]}' if name in ends else name}: ({place}) m, moved "
            f"{moved:.4g} m, rotated {np.degrees(angle):.4g} deg"
        )
    if len(bodies) > MOST_BODIES:
        shown.append(f"  and {len(bodies) - MOST_BODIES} more bodies")
    return shown
