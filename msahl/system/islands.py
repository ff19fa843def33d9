"""Islands: parts of a scene that no joint and no load couples are scenes of their own.

Each is built, reduced and solved apart; only the columns of the results bring them together. A
load whose components turn with another body couples the two.
"""

from dataclasses import replace
from typing import NamedTuple

from msahl.model import Model


class Island(NamedTuple):
    """A scene of its own, and where its bodies, joints and loads stand in the whole one's."""

    model: Model
    bodies: tuple[int, ...]
    joints: tuple[int, ...]
    loads: tuple[int, ...]


def split(model: Model) -> list[Island]:
    """The islands of ``model``, in the order of their first bodies."""
    leader = {body.name: body.name for body in model.bodies}

    def find(name: str) -> str:
        while leader[name] != name:
            leader[name] = leader[leader[name]]
            name = leader[name]
        return name

    for names in _couplings(model):
        moving = [find(name) for name in names if name in leader]
        for name in moving[1:]:
            leader[name] = moving[0]
    groups: dict[str, list[int]] = {}
    for i, body in enumerate(model.bodies):
        groups.setdefault(find(body.name), []).append(i)
    return [_island(model, bodies) for bodies in groups.values()]


def whole(model: Model) -> Island:
    """The scene as one island."""
    return Island(
        model,
        tuple(range(len(model.bodies))),
        tuple(range(len(model.joints))),
        tuple(range(len(model.loads))),
    )


def _couplings(model: Model) -> list[tuple[str, ...]]:
    joints = [(joint.parent, joint.child) for joint in model.joints]
    loads = [(load.body, load.force_basis, load.moment_basis) for load in model.loads]
    return [*joints, *loads]


def _island(model: Model, bodies: list[int]) -> Island:
    names = {model.bodies[i].name for i in bodies}
    joints = [i for i, j in enumerate(model.joints) if j.parent in names or j.child in names]
    loads = [i for i, load in enumerate(model.loads) if load.body in names]
    part = replace(
        model,
        bodies=tuple(model.bodies[i] for i in bodies),
        joints=tuple(model.joints[i] for i in joints),
        loads=tuple(model.loads[i] for i in loads),
    )
    return Island(part, tuple(bodies), tuple(joints), tuple(loads))
