"""Elements of a system that events release and engage: joints, couplings and prescribed motions.

The equations of a released element have the coefficients 0, so that any motion satisfies them and
they push nothing; their multipliers are no unknowns. So it is with open contacts
(``system.contacts``). A system is built with all elements engaged.

The constants of equations that the deck does not give (of motions, couplings, screws) are what the
coordinates are when the element is engaged: a motion goes on by the changes of its law.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from msahl.algebra.functions import evaluate
from msahl.elements.constraints.coordinate_kinds import CoordinatesWorkspace
from msahl.formulations.absolute.frames import first_multiplier
from msahl.joints.joint import Equation
from msahl.model import Joint, Model
from msahl.system.arrays import System
from msahl.system.build import Places, build_system
from msahl.system.collect import collect, equations_of
from msahl.system.parameters import tape_of

RISES, FALLS, NEVER = 1, -1, 0
"""What a condition waits for: to become true, to become false, or nothing any more."""


class Switches(NamedTuple):
    """The switched elements, and their equations as they are when engaged."""

    names: tuple[str, ...]
    engaged: np.ndarray  # (n,) which elements act; changes during a run
    element: np.ndarray  # (m,) number of the element of each equation
    row: np.ndarray  # (m,) constraint equations
    coefficient: np.ndarray  # (m, 2)
    law: np.ndarray  # (m,) of time
    given: np.ndarray  # (m,) whether the deck gives the constant
    offset: np.ndarray  # (m,) the constant, where it is given
    idle: int  # law of released motions, which is 0


class Conditions(NamedTuple):
    """The conditions of events."""

    place: np.ndarray  # (e,) of the margin on the tape
    awaits: np.ndarray  # (e,) RISES, FALLS or NEVER; changes during a run
    near: np.ndarray  # (e,) margin that is zero but for round-off; changes during a run


def conditions_of(model: Model) -> Conditions | None:
    """Return the conditions of the events of a ``model``; None if it has none."""
    entries = collect(model).signals if model.events else None
    if entries is None:
        return None
    place = tape_of(entries)[1][-1]
    return Conditions(place, np.full(place.size, RISES), np.zeros(place.size))


def switches_of(model: Model, system: System) -> Switches | None:
    """Return the switched elements of a ``system`` of the ``model``, as it was built; None if it
    has none.
    """
    spans = list(_spans(model, system))
    if not spans or system.scalar is None:
        return None
    rows = system.scalar.equations
    row = np.array([r for _, numbers, _ in spans for r in numbers], dtype=np.int64)
    return Switches(
        names=tuple(name for name, _, _ in spans),
        engaged=np.ones(len(spans), dtype=bool),
        element=np.repeat(np.arange(len(spans)), [len(numbers) for _, numbers, _ in spans]),
        row=row,
        coefficient=rows.coefficient[row],
        law=rows.law[row],
        given=np.array([known for _, _, given in spans for known in given], dtype=bool),
        offset=rows.offset[row],
        idle=system.laws.kind.size - 1,
    )


def _spans(model: Model, system: System) -> Iterator[tuple[str, list[int], list[bool]]]:
    """Yield the name of each switched element, its equations, and whether their constants are
    given.
    """
    first, switched = system.reactions.first_equation, model.switched
    for j, joint in enumerate(model.joints):
        if joint.name in switched:
            numbers = list(range(int(first[j]), int(first[j + 1])))
            yield joint.name, numbers, _given(joint)
    for row, element in zip(
        system.shown.load_equation, (*model.couplings, *model.motions), strict=False
    ):
        if element.name in switched:
            yield element.name, [int(row)], [False]


def _given(joint: Joint) -> list[bool]:
    equations = (one for one in equations_of(joint, True) if isinstance(one, Equation))
    return [one.value is not None and not one.rate for one in equations]


def with_own_laws(system: System) -> System:
    """Return the system with laws of equations of its own, which can change: others share those of
    its topology.
    """
    assert system.scalar is not None
    rows = system.scalar.equations
    own = system.scalar._replace(equations=rows._replace(law=rows.law.copy()))
    return system._replace(scalar=own)


def build_at_start(
    model: Model, relaxed: bool = False, places: Places | None = None
) -> tuple[System, Switches | None]:
    """Return the system of a model at t = 0, and the elements that events release or engage;
    ``relaxed`` and ``places`` as in ``build_system``.
    """
    system = build_system(model, relaxed, places)
    found = switches_of(model, system) if model.switched else None
    if found is not None:
        system = with_own_laws(system)
        for k, name in enumerate(found.names):
            if name in model.released:
                release(system, found, k)
    return system, found


def build_released(model: Model) -> System:
    """Return the system of a ``model`` with all switched elements released: what always holds."""
    system = build_system(model)
    found = switches_of(model, system) if model.switched else None
    if found is None:
        return system
    system = with_own_laws(system)
    for k in range(len(found.names)):
        release(system, found, k)
    return system


def with_all_engaged(system: System, switches: Switches | None) -> System:
    """Return the system with all switched elements engaged, at constants of no meaning."""
    if switches is None or system.scalar is None:
        return system
    rows = system.scalar.equations
    coefficient, law = rows.coefficient.copy(), rows.law.copy()
    coefficient[switches.row] = switches.coefficient
    law[switches.row] = switches.law
    equations = rows._replace(coefficient=coefficient, law=law)
    return system._replace(scalar=system.scalar._replace(equations=equations))


def without(switches: Switches, dropped: np.ndarray) -> Switches:
    """Return the elements of the system without the ``dropped`` (r,) equations."""
    number, kept = np.cumsum(~dropped) - 1, ~dropped[switches.row]
    fewer = {
        name: getattr(switches, name)[kept]
        for name in ("element", "coefficient", "law", "given", "offset")
    }
    return switches._replace(row=number[switches.row[kept]], **fewer)


def release(system: System, switches: Switches, k: int) -> None:
    """Release element ``k``."""
    assert system.scalar is not None
    rows, own = system.scalar.equations, switches.row[switches.element == k]
    rows.coefficient[own], rows.offset[own] = 0.0, 0.0
    rows.law[own] = np.where(rows.law[own] >= 0, switches.idle, -1)
    switches.engaged[k] = False


def engage(system: System, switches: Switches, k: int, offset: np.ndarray) -> None:
    """Engage element ``k`` with these constants ``offset`` of its equations."""
    assert system.scalar is not None
    rows, of = system.scalar.equations, switches.element == k
    own = switches.row[of]
    rows.coefficient[own], rows.law[own] = switches.coefficient[of], switches.law[of]
    rows.offset[own] = offset
    switches.engaged[k] = True


def left_sides(
    system: System, switches: Switches, k: int, start: CoordinatesWorkspace, t: float
) -> np.ndarray:
    """Return the left-hand sides of the equations of element ``k`` less their laws at ``t`` [s],
    where the coordinates have the values in ``start``.
    """
    assert system.scalar is not None
    rows, laws, found = system.scalar.equations, system.laws, []
    for m in np.flatnonzero(switches.element == k):
        r = switches.row[m]
        first, second = (float(start.value[q]) if q >= 0 else 0.0 for q in rows.coordinate[r])
        if rows.function[r] >= 0:
            second = evaluate(laws, rows.function[r], second)[0]
        law = evaluate(laws, switches.law[m], t)[0] if switches.law[m] >= 0 else 0.0
        found.append(switches.coefficient[m] @ (first, second) - law)
    return np.array(found)


def multipliers(system: System, switches: Switches, engaged: bool) -> np.ndarray:
    """Return the flat unknowns that are multipliers of all switched elements, or of those that are
    ``engaged``.
    """
    assert system.scalar is not None
    chosen = switches.row[switches.engaged[switches.element] | (not engaged)]
    place = system.scalar.equations.place[chosen]
    flat: np.ndarray = 3 * (first_multiplier(system.frames) + place[:, 0]) + place[:, 1]
    return flat
