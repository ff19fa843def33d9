"""Split a model into subsystems: parts that nothing couples are solved apart.

Each is built, reduced and solved apart; only the columns of the results bring them together. Bodies
are coupled by joints, by couplings and motions of joints, by forces between them, and by a load
whose components rotate with another body.
"""

from collections.abc import Hashable
from dataclasses import fields, replace
from functools import cache
from typing import Any, cast

from msahl.model import Joint, Model

KINDS = ("joints", "couplings", "motions", "loads")
"""What may couple bodies, as a model holds it."""


def split(model: Model) -> list[Model]:
    """Return the subsystems of ``model``, in the order of their first bodies."""
    leader = {body.name: body.name for body in model.bodies}

    def find(name: str) -> str:
        while leader[name] != name:
            leader[name] = leader[leader[name]]
            name = leader[name]
        return name

    joints = {joint.name: joint for joint in model.joints}
    touched = {
        kind: [
            [name for name in _touched(element, joints) if name in leader]
            for element in getattr(model, kind)
        ]
        for kind in KINDS
    }
    for names in (names for lists in touched.values() for names in lists):
        for name in names[1:]:
            leader[find(name)] = find(names[0])
    subsystems: dict[str, dict[str, list[Any]]] = {}
    for body in model.bodies:
        subsystem = subsystems.setdefault(
            find(body.name), {kind: [] for kind in ("bodies", *KINDS)}
        )
        subsystem["bodies"].append(body)
    for kind, lists in touched.items():
        for element, names in zip(getattr(model, kind), lists, strict=True):
            subsystems[find(names[0])][kind].append(element)
    parts: list[dict[str, Any]] = [
        {kind: tuple(elements) for kind, elements in subsystem.items()}
        for subsystem in subsystems.values()
    ]
    return [replace(model, **part) for part in parts]


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
