"""Reduce the model of a faulty deck to what can be drawn: elements whose references resolve."""

from dataclasses import replace
from typing import Any

from msahl.check.bodies import body_findings
from msahl.check.shapes import shape_findings
from msahl.model import Model, RigidBody

TINY = 1e-6
"""Inertia [kg m^2] by which a body is drawn whose own is impossible: as small as can be seen."""


def drawable(model: Model) -> Model:
    """Return the model without elements that refer to missing ones, or that are impossible."""
    bodies = tuple(map(_possible, model.bodies))
    named = {ground.name for ground in model.grounds} | {body.name for body in bodies}
    joints = _resolved(model.joints, ("parent", "child"), named)
    jointed = {joint.name for joint in joints}
    markers = _resolved(model.markers, ("body",), named)
    marked = {marker.name for marker in markers}

    def known(records: tuple[Any, ...]) -> tuple[Any, ...]:
        of_bodies = _resolved(records, ("parent", "child", "body"), named)
        of_joints = _resolved(of_bodies, ("joint", "first", "second"), jointed)
        return _resolved(of_joints, ("start", "vertex", "end"), marked)

    return replace(
        model,
        bodies=bodies,
        joints=joints,
        couplings=known(model.couplings),
        motions=known(model.motions),
        contacts=known(model.contacts),
        loads=known(model.loads),
        markers=markers,
        sensors=known(model.sensors),
        shapes=tuple(s for s in known(model.shapes) if not any(shape_findings(s))),
        signals=(),
        stops=(),
        events=(),
        released=(),
    )


def _resolved(
    records: tuple[Any, ...], fields: tuple[str, ...], names: set[str]
) -> tuple[Any, ...]:
    """Return the records whose ``fields``, if they have them, are among the ``names``."""

    def resolves(record: Any) -> bool:
        return all(getattr(record, field) in names for field in fields if hasattr(record, field))

    return tuple(record for record in records if resolves(record))


def _possible(body: RigidBody) -> RigidBody:
    """Return a body, with a tiny inertia if its own is impossible."""
    if not any(body_findings(body)):
        return body
    inertia = ((TINY, 0.0, 0.0), (0.0, TINY, 0.0), (0.0, 0.0, TINY))
    return replace(body, mass=1.0, inertia=inertia)
