"""List the signals of a model by what they depend on, before they become arrays.

An expression names signals, states and *inputs*: the time, coordinates of joints, values of
markers, reactions. ``SignalEntries`` has the inputs of all expressions that a model needs, each
once, and for each result (the load of an actuator) the inputs that it depends on.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from msahl.elements.signals import group as signals
from msahl.expressions.syntax import Name, Tree
from msahl.expressions.tape import Table
from msahl.joints.coordinates import angle_offset
from msahl.joints.expression_values import MARKER_VALUES, RATE, REACTION_VALUES
from msahl.model import Event, Marker, Model, Signal, SignalState, SignalTable
from msahl.model.loads import Actuator, ConcentratedLoad, JointActuator, MarkerActuator
from msahl.model.signals import TIME, AnySignal, element_and_value, reached, tree_of


class InputEntry(NamedTuple):
    """An input of the expressions, see ``elements.signals``."""

    name: str
    kind: int
    item: int = 0
    component: int = 0
    origin: float = 0.0


class ResultEntry(NamedTuple):
    """A result of the expressions: the load of an actuator along a coordinate, or the factor of a
    concentrated load."""

    coordinate: int  # of an actuator, or -1
    body: str  # that a concentrated load acts on, or ""
    column: int  # of the table of work
    expression: Tree
    inputs: tuple[int, ...]  # those on which it depends with a derivative


class SignalEntries(NamedTuple):
    """All that the expressions of a model consist of."""

    named: dict[str, Tree]
    tables: dict[str, Table]
    states: tuple[SignalState, ...]
    shown: tuple[Tree, ...]  # published values
    stops: tuple[Tree, ...]  # margins of the conditions that end the run
    conditions: tuple[Tree, ...]  # likewise of those of events
    values: tuple[Tree, ...]  # of states that these set, and of impulses
    inputs: tuple[InputEntry, ...]
    counted: tuple[int, ...]  # coordinates whose angle begins with its own value, not with zero
    markers: tuple[Marker, ...]
    results: tuple[ResultEntry, ...]


def _pushed(events: Iterable[Event]) -> Iterator[str]:
    """Yield the rates along which impulses of ``events`` act, of markers in all directions."""
    for impulse in (impulse for event in events for impulse in event.impulses):
        if impulse.joint:
            yield f"{impulse.joint}.{impulse.coordinate}{RATE}"
        else:
            yield from (f"{impulse.marker}.{value}" for value in ("vx", "vy", "vz"))


class SignalCollector:
    """Goes through the expressions of a model once.

    ``add`` adds a coordinate of a joint to the system, if it is not there, and returns its number;
    ``between`` that of the distance of two markers. The first ``known`` coordinates are those of
    other elements.
    """

    def __init__(
        self,
        model: Model,
        add: Callable[[str, str], int],
        between: Callable[[Marker, Marker], int],
        known: int,
    ) -> None:
        self._model, self._add, self._between, self._known = model, add, between, known
        self._joints = {joint.name: (i, joint) for i, joint in enumerate(model.joints)}
        self._markers = {marker.name: marker for marker in model.markers}
        self._signals: dict[str, AnySignal] = {signal.name: signal for signal in model.signals}
        self._inputs: dict[str, tuple[int, InputEntry]] = {}
        self._used: dict[str, int] = {}
        self._counted: dict[int, None] = {}

    def entries(self) -> SignalEntries | None:
        """Return the entries of the model; None if it has no expression."""
        model = self._model
        column = {load.name: c for c, load in enumerate(model.loads)}
        loads: list[Actuator | ConcentratedLoad] = [*model.actuators, *model.controlled]
        laws = [law for load in loads if (law := load.expression) is not None]
        trees = {s.name: tree for s in model.signals if (tree := tree_of(s)) is not None}
        conditions = tuple(event.expression for event in model.events)
        values = tuple(tree for event in model.events for tree in event.values)
        others = [*laws, *(stop.expression for stop in model.stops), *conditions, *values]
        if not trees and not others:
            return None
        for name in reached([*trees.values(), *others], {}):
            if name not in trees:
                self._input(name)
        for name in _pushed(model.events):
            self._input(name)
        published = [Name(s.name) for s in model.signals if not isinstance(s, SignalTable)]
        results = tuple(
            self._result(column[load.name], load, law)
            for load, law in zip(loads, laws, strict=True)
        )
        return SignalEntries(
            named={s.name: s.expression for s in model.signals if isinstance(s, Signal)},
            tables={s.name: s.table for s in model.signals if isinstance(s, SignalTable)},
            states=model.states,
            shown=(*published, *laws),
            stops=tuple(stop.expression for stop in model.stops),
            conditions=conditions,
            values=values,
            inputs=tuple(entry for _, entry in self._inputs.values()),
            counted=tuple(self._counted),
            markers=tuple(self._markers[name] for name in self._used),
            results=results,
        )

    def _input(self, name: str) -> None:
        if name not in self._inputs:
            self._inputs[name] = (len(self._inputs), self._new_input(name))

    def _new_input(self, name: str) -> InputEntry:
        if name == TIME:
            return InputEntry(name, signals.TIME)
        element, value = element_and_value(name)
        if element in self._markers:
            kind, component = MARKER_VALUES[value]
            return InputEntry(
                name, kind, self._used.setdefault(element, len(self._used)), component
            )
        number, joint = self._joints[element]
        if value in REACTION_VALUES:
            return InputEntry(name, signals.REACTION, number, REACTION_VALUES.index(value))
        coordinate = value.removesuffix(RATE)
        q = self._add(element, coordinate)
        if coordinate.startswith("angle") and q >= self._known:
            self._counted[q] = None
        if value.endswith(RATE):
            return InputEntry(name, signals.RATE, q)
        origin = angle_offset(joint) if coordinate == "angle" else 0.0
        return InputEntry(name, signals.COORDINATE, q, origin=origin)

    def _result(self, column: int, load: Actuator | ConcentratedLoad, tree: Tree) -> ResultEntry:
        q, body = -1, ""
        if isinstance(load, JointActuator):
            q = self._add(load.joint, load.coordinate)
        elif isinstance(load, MarkerActuator):
            q = self._between(self._markers[load.start], self._markers[load.end])
        else:
            body = load.body
        return ResultEntry(q, body, column, tree, self._dependence(tree))

    def _dependence(self, tree: Tree) -> tuple[int, ...]:
        """Return the inputs on which an expression depends, also by signals and states."""
        names = reached([tree], self._signals)
        found = [self._inputs[name] for name in names if name in self._inputs]
        return tuple(
            number for number, entry in found if entry.kind not in (signals.TIME, signals.REACTION)
        )


def input_parts(
    entries: SignalEntries, parts: np.ndarray, frame: np.ndarray, nodes: Mapping[str, np.ndarray]
) -> np.ndarray:
    """(y, 4) nodes of the four parts of every input, -1 for none and for the ground's; ``parts``
    (q, 4) are those of the coordinates, ``frame`` (p,) the markers' frames, ``nodes`` the nodes of
    all frames, the ground's last.
    """
    found = np.full((len(entries.inputs), 4), -1, dtype=np.int64)
    for j, entry in enumerate(entries.inputs):
        if entry.kind in (signals.COORDINATE, signals.RATE):
            found[j] = parts[entry.item]
        elif signals.POSITION <= entry.kind <= signals.SPIN:
            if entry.kind in (signals.POSITION, signals.VELOCITY):
                found[j, 0] = nodes["displacement"][frame[entry.item]]
            found[j, 1] = nodes["rotation"][frame[entry.item]]
    found[np.isin(found, [nodes["displacement"][-1], nodes["rotation"][-1]])] = -1
    return found
