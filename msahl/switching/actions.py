"""What events of the deck set and push: auxiliary states, numbers of laws, impulses.

Values are those of the motion at the time of the event, before it changes anything, with reactions
of the same time. A number that a spring has from then on changes its elastic energy: that change is
work of the event, as that of its impulses.
"""

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from msahl.contact.events import PUSHES, SETS
from msahl.model import Model
from msahl.model.events import Event
from msahl.ports import forces
from msahl.start.velocities import solve_accelerations
from msahl.switching.impulses import Impulses
from msahl.switching.parameters import LawParameters
from msahl.system import evaluate
from msahl.system.arrays import State, System
from msahl.system.switches import Conditions
from msahl.system.unknowns import Unknowns
from msahl.system.work_arrays import WorkArrays, energy


class Done(NamedTuple):
    """What an action did: the fields of its row in ``events.csv``, and its work [J]."""

    kind: str
    element: str
    before: float = 0.0
    after: float = 0.0
    impulse: float = 0.0
    work: float = 0.0


class NoVelocity(Exception):  # noqa: N818 - an outcome
    """A change of velocity is asked for along what joints and motions prescribe."""


class Actions:
    """Carries out what the events of a ``model`` set and push."""

    def __init__(
        self,
        model: Model,
        conditions: Conditions,
        system: System,
        state: State,
        work_arrays: WorkArrays,
    ) -> None:
        self.system, self.state, self.work_arrays = system, state, work_arrays
        ends = np.cumsum([len(event.values) for event in model.events])
        self.places = np.split(conditions.value, ends[:-1])
        self.number = {signal.name: n for n, signal in enumerate(model.states)}
        sets = any(event.parameters for event in model.events)
        self.parameters = LawParameters(model, system) if sets else None
        pushes = any(event.impulses for event in model.events)
        self.impulses = Impulses(model, system, state, work_arrays) if pushes else None

    def values(self, k: int, unknowns: Unknowns) -> list[float]:
        """Return the values that event ``k`` needs in the present state, whose ``unknowns`` are
        those of steps.
        """
        if not self.places[k].size:
            return []
        system, state, arrays = self.system, self.state, self.work_arrays
        signals = system.forces.signals
        solve_accelerations(system, state, unknowns, None, arrays)
        arrays.call(evaluate.prepare, system, state, arrays.start)
        last = arrays.start.forces.signals.reaction.copy()
        given = arrays.start.forces, system.scalar, state.reaction, last
        forces.set_expressions_by(signals, *given)
        return [forces.expression_at(signals, arrays.start.forces, int(p)) for p in self.places[k]]

    def carry_out(self, event: Event, values: list[float], unknowns: Unknowns) -> Iterator[Done]:
        """Set and push what an ``event`` says by its ``values``; ``unknowns`` are those without
        contacts. Raises ``NoVelocity`` with the name of a joint or marker.
        """
        for change, value in zip(event.states, values, strict=False):
            self.state.auxiliary[self.number[change.state]] = value
            yield Done(SETS, change.state)
        for parameter in event.parameters:
            assert self.parameters is not None
            before = energy(self.system, self.state, self.work_arrays)
            self.parameters.set(parameter)
            work = energy(self.system, self.state, self.work_arrays) - before
            yield Done(SETS, f"{parameter.load}.{parameter.parameter}", work=work)
        for impulse, value in zip(event.impulses, values[len(event.states) :], strict=True):
            assert self.impulses is not None
            given = self.impulses.give(impulse, value, unknowns)
            if given is None:
                raise NoVelocity(impulse.element)
            rates = given.before, given.after
            yield Done(PUSHES, impulse.element, *rates, given.size, given.work)

    @property
    def key(self) -> bytes:
        """What differs where other numbers of laws are set."""
        return b"" if self.parameters is None else self.parameters.key

    @property
    def counters(self) -> dict[str, Any]:
        """The numbers of laws that are set, by load and parameter."""
        return {} if self.parameters is None else self.parameters.values

    def restore(self, values: dict[str, Any]) -> None:
        """Restore what ``counters`` returned."""
        if self.parameters is not None:
            self.parameters.restore(values)
