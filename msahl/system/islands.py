"""Islands: parts of a scene that nothing couples are scenes of their own.

Each is built, reduced and solved apart; only the columns of the results bring them together. Bodies
are coupled by joints, by couplings and motions of joints, by forces between them, and by a load
whose components turn with another body.
"""

from dataclasses import fields, replace
from typing import Any

from msahl.model import Joint, Model


def split(model: Model) -> list[Model]:
    """The islands of ``model``, in the order of their first bodies."""
    leader = {body.name: body.name for body in model.bodies}

    def find(name: str) -> str:
        while leader[name] != name:
            leader[name] = leader[leader[name]]
            name = leader[name]
        return name

    joints = {joint.name: joint for joint in model.joints}
    for element in (*model.joints, *model.couplings, *model.motions, *model.loads):
        moving = [find(name) for name in _touched(element, joints) if name in leader]
        for name in moving[1:]:
            leader[find(name)] = find(moving[0])
    groups: dict[str, set[str]] = {}
    for body in model.bodies:
        groups.setdefault(find(body.name), set()).add(body.name)
    return [_island(model, joints, names) for names in groups.values()]


def _touched(element: Any, joints: dict[str, Joint]) -> set[str]:
    """Names of the bodies and grounds that an element acts between."""
    keys = {field.name for field in fields(element)}
    of_bodies = keys & {"parent", "child", "body", "force_basis", "moment_basis"}
    names = {getattr(element, key) for key in of_bodies}
    for key in keys & {"joint", "first", "second"}:
        names |= _touched(joints[getattr(element, key)], joints)
    return names


def _island(model: Model, joints: dict[str, Joint], names: set[str]) -> Model:
    def belonging(elements: tuple[Any, ...]) -> tuple[Any, ...]:
        return tuple(e for e in elements if _touched(e, joints) & names)

    return replace(
        model,
        bodies=tuple(body for body in model.bodies if body.name in names),
        joints=belonging(model.joints),
        couplings=belonging(model.couplings),
        motions=belonging(model.motions),
        loads=belonging(model.loads),
    )
