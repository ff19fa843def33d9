"""Split a model into subsystems: parts that nothing couples are solved apart.

Each is built, reduced and solved apart; only the columns of the results bring them together. Bodies
are coupled by joints, by couplings and motions of joints, by forces between them, by a load whose
components rotate with another body, and by expressions of the motion: a signal couples all that it
depends on with all that depends on it.
"""

from collections.abc import Hashable
from dataclasses import fields, replace
from functools import cache
from typing import Any, cast

from msahl.expressions.syntax import Lookup, Name, Tree, postorder
from msahl.model import (
    Beam,
    ElasticBody,
    Event,
    Joint,
    MarkerActuator,
    Model,
    Signal,
    SignalState,
    SignalTable,
)
from msahl.model.signals import element_and_value

KINDS = (
    *("joints", "couplings", "motions", "contacts", "events"),
    *("loads", "signals", "stops", "beams", "elastic_bodies"),
)
"""What may couple bodies, as a model holds it."""


def split(model: Model) -> list[Model]:
    """Return the subsystems of ``model``, in the order of their first bodies."""
    signals = {signal.name: signal for signal in model.signals}
    # Bodies and signals have names of their own: a signal counts as (name,).
    leader: dict[Hashable, Hashable] = {body.name: body.name for body in model.bodies}
    leader |= {(name,): (name,) for name in signals}

    def find(name: Hashable) -> Hashable:
        while leader[name] != name:
            leader[name] = leader[leader[name]]
            name = leader[name]
        return name

    owners = _Owners(model)
    touched = {
        kind: [
            [name for name in owners.touched(element) if name in leader]
            for element in getattr(model, kind)
        ]
        for kind in KINDS
    }
    for names in (names for lists in touched.values() for names in lists):
        for name in names[1:]:
            leader[find(name)] = find(names[0])
    subsystems: dict[Hashable, dict[str, list[Any]]] = {}
    for body in model.bodies:
        subsystem = subsystems.setdefault(
            find(body.name), {kind: [] for kind in ("bodies", *KINDS)}
        )
        subsystem["bodies"].append(body)
    first = next(iter(subsystems))
    for kind, lists in touched.items():
        for element, names in zip(getattr(model, kind), lists, strict=True):
            # Signals that depend on no body are those of the first subsystem.
            place = find(names[0]) if names else first
            subsystems.get(place, subsystems[first])[kind].append(element)
    parts: list[dict[str, Any]] = [
        {kind: tuple(elements) for kind, elements in subsystem.items()}
        for subsystem in subsystems.values()
    ]
    return [replace(model, **part) for part in parts]


class _Owners:
    """What the elements of a model act between, or depend on, by name."""

    def __init__(self, model: Model) -> None:
        self._joints = {joint.name: joint for joint in model.joints}
        self._switched = {
            element.name: element
            for element in (*model.joints, *model.couplings, *model.motions, *model.contacts)
        }
        self._bodies = {marker.name: marker.body for marker in model.markers}
        self._signals = {signal.name for signal in model.signals}
        self._loads = {load.name: load for load in model.loads}

    def touched(self, element: Any) -> list[Hashable]:
        """Names of the bodies and grounds, and of the signals, that an element couples."""
        names: set[Hashable] = set(_touched(element, self._joints))
        if isinstance(element, Event):
            for name in element.elements:
                names |= _touched(self._switched[name], self._joints)
            names |= self._changed(element)
        if isinstance(element, Beam):
            names |= set(element.nodes)
        if isinstance(element, ElasticBody):
            names |= set(element.bodies)
        if isinstance(element, MarkerActuator):
            names |= {self._bodies[element.start], self._bodies[element.end]}
        if isinstance(element, Signal | SignalState | SignalTable):
            names.add((element.name,))
        tree = getattr(element, "expression", getattr(element, "rate", None))
        trees = [] if tree is None else [tree]
        trees += element.values if isinstance(element, Event) else ()
        for node in (node for tree in trees for node in postorder(tree)):
            names |= self._used(node)
        return sorted(names, key=repr)

    def _changed(self, event: Event) -> set[Hashable]:
        """Names of what an event sets, and of the bodies on which its impulses act."""
        names: set[Hashable] = {(change.state,) for change in event.states}
        for change in event.parameters:
            names |= _touched(self._loads[change.load], self._joints)
        for impulse in event.impulses:
            names |= _touched(impulse, self._joints) if impulse.joint else set()
            names |= {self._bodies[impulse.marker], impulse.basis} if impulse.marker else set()
        return names

    def _used(self, node: Tree) -> set[Hashable]:
        """Names on which a part of an expression depends."""
        if isinstance(node, Lookup):
            return {(node.table,)}
        if not isinstance(node, Name):
            return set()
        if node.text in self._signals:
            return {(node.text,)}
        element, _ = element_and_value(node.text)
        if element in self._bodies:
            return {self._bodies[element]}
        return set(_touched(self._joints[element], {})) if element in self._joints else set()


def _touched(element: Any, joints: dict[str, Joint]) -> set[str]:
    """Names of the bodies and grounds that an element acts between."""
    of_bodies, of_joints = _references(cast(Hashable, type(element)))
    names = {getattr(element, key) for key in of_bodies}
    for key in of_joints:
        names |= _touched(joints[getattr(element, key)], joints)
    return names


@cache
def _references(kind: Hashable) -> tuple[frozenset[str], frozenset[str]]:
    """Fields of a kind of record that name bodies, and those that name joints."""
    keys = frozenset(field.name for field in fields(cast(Any, kind)))
    of_bodies = keys & {"parent", "child", "body", "force_basis", "moment_basis"}
    return of_bodies, keys & {"joint", "first", "second"}
