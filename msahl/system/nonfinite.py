"""Whose numbers are none: the element that made a nan or an overflow, by name.

Asked once, when a run ends on one; so it looks at what the kernels left behind, in plain Python.
"""

from collections.abc import Iterator

import numpy as np

from msahl.algebra.functions import evaluate
from msahl.elements import forces
from msahl.model import Model
from msahl.system.arrays import State, System, SystemWorkspace


def find_nonfinite(
    model: Model, system: System, state: State, start: SystemWorkspace, h: float
) -> str | None:
    """Return the first element of the subsystem ``model`` whose part of the step ``h`` from its
    prepared ``state`` is not finite, in words; None if there is none.
    """
    with np.errstate(all="ignore"):
        for name, numbers in _parts(model, system, state, start, h):
            if not np.isfinite(numbers).all():
                return name
    return None


def overflow(t: float, name: str) -> str:
    """The numbers of the element ``name`` are none at the time ``t`` [s], in a sentence."""
    return (
        f"t = {t:g} s: the numbers of {name} went beyond what a computer holds. Look at the last "
        "rows for forces or speeds that grow without bound, and at its figures in the deck for a "
        "slip of the pen or of units; an expression such as sqrt has no value outside its domain."
    )


def _parts(
    model: Model, system: System, state: State, start: SystemWorkspace, h: float
) -> Iterator[tuple[str, np.ndarray]]:
    """Names and numbers of all elements: bodies first, then what acts on them."""
    t = float(state.time[0])
    for b, body in enumerate(model.bodies):
        motion = np.stack([state.x[b], state.v[b], state.w[b], state.p[b]])
        weight = body.mass * system.bodies.gravity * state.x[b]
        # What moments are divided by.
        inertia = body.mass * system.frames.length[b] ** 2
        size = np.array([inertia, 1.0 / inertia, 0.0])
        numbers = np.concatenate([motion, motion**2 * body.mass, np.stack([weight, size])])
        yield f"body '{body.name}'", numbers
    workers = (*model.loads, *model.motions)
    for column, numbers in forces.numbers_at_points(system.forces, start.forces, state.v):
        yield f"load '{workers[column].name}'", numbers
    for column, numbers in forces.numbers_of_results(system.forces, start.forces):
        yield f"the expression of load '{workers[column].name}'", numbers
    if system.scalar is None:
        return
    coords, rows = start.scalar.coordinates, system.scalar.equations
    elements = [*model.joints, *model.couplings, *model.motions]
    for r, (node, _) in enumerate(rows.place):
        element = elements[int(system.multipliers.element[node])]
        parts = [coords.value[q] for q in rows.coordinate[r] if q >= 0]
        if rows.law[r] >= 0:
            parts += evaluate(system.laws, rows.law[r], t)
            parts += evaluate(system.laws, rows.law[r], t + h)
        yield f"{type(element).__name__.lower()} '{element.name}'", np.array(parts)
    for column, numbers in forces.numbers_along(system.forces, coords):
        yield f"load '{workers[column].name}'", numbers
