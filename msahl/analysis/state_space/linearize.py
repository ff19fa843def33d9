"""A model linearised at a point: x' = A x + B w, y = C x + D w, with inputs and outputs by name.

x, w and y are changes from the values at the point. Inputs are those of ``inputs``, outputs
columns of the tables of a run (``columns``), states those of ``states``. With Z the
changes of the states by the columns of ``variations``, Z' those of their rates, Y of the outputs

    A = Z' Z^-1 ,   B = Z' ,   C = Y Z^-1 ,   D = Y         in the columns of states, and of inputs
"""

from collections.abc import Sequence

import numpy as np

from msahl.algebra.functions import evaluate as law
from msahl.analysis.linearised.coefficients import (
    Coefficients,
    coefficients,
    evaluated,
)
from msahl.analysis.linearised.plain_units import coordinate_numbers
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.steady import Equilibrium, equilibrium
from msahl.analysis.linearised.variations import Inputs, Variations, variations
from msahl.analysis.no_contacts import require_no_contacts
from msahl.analysis.state_space.check import disagreement
from msahl.analysis.state_space.columns import Column, Columns, columns_by_table, shared_reactions
from msahl.analysis.state_space.inputs import (
    INPUT,
    Input,
    input_faults,
    resolve_inputs,
    with_signals,
)
from msahl.analysis.state_space.model import Accuracy, LinearModel, Quantity
from msahl.analysis.state_space.states import (
    CHOICES,
    COORDINATES,
    Others,
    States,
    by_coordinates,
    by_null_space,
    with_others,
)
from msahl.expressions.syntax import nearest
from msahl.formulations.absolute.frames import moving_count
from msahl.run.column_units import quantity
from msahl.run.options import OptionError
from msahl.start.velocities import StartError
from msahl.system.names import describe_row

LARGEST = 150
"""Most bodies of a model, whose matrices are dense."""
DISAGREES = 1e-6
"""Difference from the nonlinear equations, relative to the largest acceleration, above which a
warning states it."""
UNSURE = 1e-8
"""Error of the differences of columns, relative to the largest, above which a warning states it."""
ILL = 1e8
"""Condition number of the states above which a warning states it."""


def linearize(
    point: Point, inputs: Sequence[str], outputs: Sequence[str], states: str = COORDINATES
) -> LinearModel:
    """Return the model linearised at a ``point``, with ``inputs`` and ``outputs`` by name.

    Raises ``OptionError`` for names that do not exist, ``StartError`` where there is no such model,
    or if it has contacts or events.
    """
    _check(point, inputs, outputs, states)
    point = with_signals(point, inputs)
    here = evaluated(point.system, point.state)
    found = coefficients(point.system, point.state, here)
    resolved = resolve_inputs(point, here, inputs)
    changes = variations(point, here, found, _acting(resolved, found))
    place = _input_columns(point, resolved, changes)
    columns = Columns(point, here, changes, _fed(resolved, place, changes))
    balance = equilibrium(point, found)
    chosen = _states(columns, states, balance)
    chosen = with_others(chosen, point.model, changes, _others(point, resolved, changes, found))
    shown = {name: _output(columns, name) for name in outputs}
    A, B, C, D, condition = _matrices(chosen, place, list(shown.values()))
    accuracy = Accuracy(
        condition=condition,
        disagreement=disagreement(point, found, changes),
        error=max([chosen.error, *(column.error for column in shown.values())]),
    )
    return LinearModel(
        A=A,
        B=B,
        C=C,
        D=D,
        states=tuple(map(Quantity, chosen.names, chosen.units, chosen.value.tolist())),
        inputs=tuple(Quantity(each.name, each.unit, each.value) for each in resolved),
        outputs=tuple(
            Quantity(name, quantity(name, point.model).unit, column.value)
            for name, column in shown.items()
        ),
        rates=chosen.rate,
        time=point.time,
        title=point.model.simulation.title,
        equilibrium=balance,
        chosen=states,
        accuracy=accuracy,
        redundant=changes.linear.redundant,
        warnings=(
            *_warnings(point, balance, changes, outputs),
            *_axes(chosen, balance),
            *_doubts(accuracy),
        ),
    )


def _states(columns: Columns, states: str, balance: Equilibrium) -> States:
    """Return the states of this choice."""
    frames, model = columns.point.system.frames, columns.point.model
    length = float(np.mean(frames.length[: moving_count(frames)]))
    if states == COORDINATES:
        return by_coordinates(model, columns, columns.changes, length)
    return by_null_space(model, columns, columns.changes, length, balance.axes)


def _axes(chosen: States, balance: Equilibrium) -> list[str]:
    """Return that coordinates along inertial axes do not suit a rotating motion, if so."""
    if not (balance.axes.any() and chosen.inertial):
        return []
    return [
        f"the steady motion rotates, and {chosen.inertial[0]} is along inertial axes, in which its "
        "coefficients are not constant; choose the states nullspace"
    ]


def _doubts(accuracy: Accuracy) -> list[str]:
    """Return what is less accurate than it should be."""
    found = []
    if not accuracy.disagreement <= DISAGREES:
        found.append(
            "differences of the nonlinear equations give accelerations that differ by "
            f"{accuracy.disagreement:.1e}"
        )
    if accuracy.error > UNSURE:
        found.append(f"derivatives of columns are uncertain by {accuracy.error:.1e} of the largest")
    if accuracy.condition > ILL:
        found.append(
            f"the coordinates hardly describe all motions (condition {accuracy.condition:.1e}); "
            "choose the states nullspace"
        )
    return found


def _check(point: Point, inputs: Sequence[str], outputs: Sequence[str], states: str) -> None:
    """Raise ``OptionError`` for inputs and outputs that do not exist, or another choice of states,
    all at once.
    """
    require_no_contacts(point.model)
    known = [name for names in columns_by_table(point.model).values() for name in names]
    every, twice = set(known), sorted({name for name in outputs if outputs.count(name) > 1})
    faults = input_faults(point, inputs)
    faults += [
        f"'{name}' is no output: name a column of a table of results that the motion determines"
        f"{nearest(name, known)}"
        for name in outputs
        if name not in every
    ]
    faults += [f"'{name}' is an output twice; name it once" for name in twice]
    if states not in CHOICES:
        faults.append(f"states: it is {states!r}; choose {' or '.join(CHOICES)}")
    if faults:
        raise OptionError(faults)
    if len(point.model.bodies) > LARGEST:
        raise StartError(
            f"a model of {len(point.model.bodies)} bodies is too large to be linearised by dense "
            f"matrices; the most are {LARGEST}"
        )


def _acting(resolved: Sequence[Input], found: Coefficients) -> Inputs:
    """Return what the inputs act on, but those that are auxiliary states already."""
    acting = [each for each in resolved if not each.signal]
    n, s = found.coordinate.size, found.state_rate.size
    return Inputs(
        np.array([each.force for each in acting]).reshape(len(acting), n).T,
        np.array([each.state_rate for each in acting]).reshape(len(acting), s).T,
        np.array([each.motion for each in acting], dtype=int),
    )


def _input_columns(point: Point, resolved: Sequence[Input], changes: Variations) -> list[int]:
    """Return which column of the changes belongs to each input."""
    first = changes.degrees_of_freedom + changes.rate_degrees_of_freedom
    states = [s.name for s in point.model.states]
    acting = iter(range(changes.inputs, changes.places.shape[1]))
    return [
        first + states.index(INPUT.format(each.name)) if each.signal else next(acting)
        for each in resolved
    ]


def _fed(
    resolved: Sequence[Input], place: Sequence[int], changes: Variations
) -> dict[str, np.ndarray]:
    """Return the changes of columns of signals.csv that inputs are added to."""
    fed: dict[str, np.ndarray] = {}
    for each, column in zip(resolved, place, strict=True):
        if each.shown:
            fed[each.shown] = np.zeros(changes.places.shape[1])
            fed[each.shown][column] = 1.0
    return fed


def _others(
    point: Point, resolved: Sequence[Input], changes: Variations, found: Coefficients
) -> Others:
    """Return auxiliary states and the prescribed motions that are inputs."""
    number = found.state_rate.size - sum(each.signal for each in resolved)
    moved = [each for each in resolved if each.motion >= 0]
    points, scalar = 3 * point.system.coincide.a.size, point.system.scalar
    laws = np.zeros((3, len(moved)))
    for k, each in enumerate(moved):
        assert scalar is not None
        number_of_law = int(scalar.equations.law[each.motion - points])
        laws[:, k] = law(point.system.laws, number_of_law, point.time)
    return Others(
        states=point.state.auxiliary[:number],
        state_rates=found.state_rate[:number],
        names=[each.name for each in moved],
        units=[each.unit.removesuffix("/s^2") for each in moved],
        laws=laws,
        driven=changes.motion.u_ddot,
    )


def _output(columns: Columns, name: str) -> Column:
    """Return the column ``name``, from the first table that has it."""
    tables = columns_by_table(columns.point.model)
    return columns.table(next(table for table in tables if name in tables[table]))[name]


def _matrices(
    chosen: States, place: list[int], shown: Sequence[Column]
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, float]:
    """Return A, B, C, D of the ``chosen`` states, of the inputs in the columns ``place`` and of the
    outputs ``shown``, and the condition of the states.
    """
    columns = chosen.own
    slopes = np.array([column.slope for column in shown]).reshape(len(shown), len(chosen.slope.T))
    Z = chosen.slope[:, columns]
    # Rows of a length of 1, so that the condition does not depend on units.
    size = np.linalg.norm(Z, axis=1)
    condition = float(np.linalg.cond(Z / size[:, None])) if len(Z) else 1.0
    inverse = np.linalg.inv(Z)
    A, B = chosen.rate_slope[:, columns] @ inverse, chosen.rate_slope[:, place]
    for i, j in _rates_among(chosen.names):
        A[i], A[i, j], B[i] = 0.0, 1.0, 0.0  # to the last digit
    return A, B, slopes[:, columns] @ inverse, slopes[:, place], condition


def _rates_among(names: list[str]) -> list[tuple[int, int]]:
    """Return the pairs of states of which the second is the rate of the first."""
    number = {name: i for i, name in enumerate(names)}
    return [(i, number[f"{name}Rate"]) for i, name in enumerate(names) if f"{name}Rate" in number]


def _warnings(
    point: Point, balance: Equilibrium, changes: Variations, outputs: Sequence[str]
) -> list[str]:
    """Return what the matrices do not say."""
    found = []
    if not balance.holds:
        flat = coordinate_numbers(point.system)[balance.coordinate]
        where = describe_row(point.model, point.system, int(flat))
        found.append(
            f"this is no equilibrium and no steady motion: {balance.residual:.3g} N are not "
            f"balanced ({where}); the matrices are those of this moment, and the states change at "
            "the rates given beside them"
        )
    shared = sorted(set(outputs) & _shared(point, changes))
    if shared:
        found.append(
            f"redundant constraints leave {', '.join(shared)} open; the smallest reactions are "
            "given"
        )
    return found


def _shared(point: Point, changes: Variations) -> set[str]:
    """Return the columns of reactions that redundant constraints leave open."""
    return shared_reactions(point) if changes.linear.redundant else set()
