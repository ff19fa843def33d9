"""Whose numbers are none: the element that made a nan or an overflow, by name.

Asked once, when a run ends on one; so it looks at what the kernels left behind, in plain Python.
"""

from collections.abc import Iterator

import numpy as np

from msahl.algebra.functions import evaluate
from msahl.algebra.rotation import compose, from_axis_angle
from msahl.elements.constraints import scalar
from msahl.expressions.known_times import users
from msahl.expressions.tape import HELD
from msahl.model import Model, Signal, SignalState
from msahl.model.model import in_deck
from msahl.ports import forces
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace
from msahl.system.evaluate import prepare
from msahl.system.names import workers

EXPRESSION = "the expression of "
"""Begins the name of a signal, state, load or condition whose expression has no finite value."""
LOOK_AHEAD = (0.0, 0.5, 1.0, 2.0, 4.0)
"""Where expressions are evaluated after a failed step, in steps: velocities may increase."""


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
    if name.startswith(EXPRESSION):
        return (
            f"t = {t:g} s: {name} has no finite value after this time. Look for a root, logarithm, "
            "power or quotient outside its domain, and at the last rows of signals.csv for values "
            "that grow without bound."
        )
    return (
        f"t = {t:g} s: the numbers of {name} went beyond what a computer holds. Look at the last "
        "rows for forces or speeds that grow without bound, and at its figures in the deck for a "
        "slip of the pen or of units."
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
    names = workers(model)
    for column, numbers in forces.numbers_at_points(system.forces, start.forces, state.v):
        yield f"load '{names[column]}'", numbers
    if system.scalar is None:
        return
    coords, rows = start.scalar.coordinates, system.scalar.equations
    elements = model.constrained
    for r, (node, _) in enumerate(rows.place):
        number = int(system.multipliers.element[node])
        if number >= len(elements):  # of an elastic body, whose own numbers are finite
            continue
        element = elements[number]
        parts = [coords.value[q] for q in rows.coordinate[r] if q >= 0]
        if rows.law[r] >= 0:
            parts += evaluate(system.laws, rows.law[r], t)
            parts += evaluate(system.laws, rows.law[r], t + h)
        yield f"{type(element).__name__.lower()} '{element.name}'", np.array(parts)
    for column, numbers in forces.numbers_along(system.forces, coords):
        yield f"load '{names[column]}'", numbers


def find_undefined(model: Model, system: System, state: State, h: float) -> str | None:
    """Return the first expression of the motion that has no finite value in the ``state`` or where
    its velocities lead within a few steps ``h``, in words; None if there is none.
    """
    group = system.forces.signals
    if group is None:
        return None
    places = [*group.shown, *group.rate, *group.stop]
    with np.errstate(all="ignore"):
        for part in LOOK_AHEAD:
            finite = np.isfinite(_values(system, _moved(state, part * h))[places])
            if not finite.all():
                return f"{EXPRESSION}{_names_of_expressions(model)[int(np.argmin(finite))]}"
    return None


def names_of_users(model: Model, system: System, switch: int) -> list[str]:
    """Return the names of the states and loads whose expressions depend on a switch, with file and
    line where they are known.
    """
    group = system.forces.signals
    if group is None:
        return []
    found, places = [], [*group.shown, *group.rate]
    for place, name in zip(places, _names_of_expressions(model), strict=False):
        used = users(group.tape, np.array([place]))
        held = any(group.tape.op[i] == HELD and group.tape.c[i] == switch for i in used)
        if held and not name.startswith("signal") and name not in found:
            found.append(name)
    return [name + in_deck(model, name.split("'")[1]) for name in found]


def _names_of_expressions(model: Model) -> list[str]:
    """Names of published values, rates of states and conditions, in the order of the signals."""
    states = [f"state '{s.name}'" for s in model.states]
    published = [s for s in model.signals if isinstance(s, Signal | SignalState)]
    names = [
        f"{'signal' if isinstance(signal, Signal) else 'state'} '{signal.name}'"
        for signal in published
    ]
    names += [f"load '{load.name}'" for load in (*model.actuators, *model.controlled)]
    return [*names, *states, *(f"the condition '{stop.condition}'" for stop in model.stops)]


def _moved(state: State, dt: float) -> State:
    """Return the ``state`` after the time ``dt`` [s] at the present velocities."""
    moved = State(*(array.copy() for array in state))
    moved.time[0] += dt
    moved.x[:] += dt * state.v
    for b, w in enumerate(state.w):
        speed = float(np.sqrt(w @ w))
        if speed > 0.0:
            moved.p[b] = compose(tuple(state.p[b]), from_axis_angle(tuple(w / speed), speed * dt))
    return moved


def _values(system: System, state: State) -> np.ndarray:
    """Return the values of the tape of all expressions in a ``state``."""
    start, group = new_system_workspace(system, state), system.forces.signals
    prepare(system, state, start)
    scalar.count_rotations(system.scalar, start.scalar, state.angle)
    prepare(system, state, start)
    forces.set_expressions(group, start.forces, system.scalar)
    return np.asarray(start.forces.signals.values.value)
