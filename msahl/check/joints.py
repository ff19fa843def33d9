"""Rules about joints and couplings: ends, parameters, frames, and what a coupling relates."""

from collections.abc import Iterator

from msahl.algebra.many import isnan
from msahl.check.context import Context
from msahl.check.ends import ends_findings, frame_findings
from msahl.check.faults import Finding
from msahl.joints.registry import KINDS
from msahl.model.couplings import COORDINATES, Coupling
from msahl.model.joints import Joint

SCALES = {"gear": "ratio", "rackAndPinion": "radius"}
"""What the one number of a coupling is called in the deck, by its kind."""


def kind_findings(joint: Joint) -> Iterator[Finding]:
    """Find a kind of joint that does not exist, and parameters that are not those of the kind."""
    kind = KINDS.get(joint.kind)
    if kind is None:
        message = f"unknown kind of joint '{joint.kind}'; expected one of {', '.join(KINDS)}"
        yield Finding("kind", message)
        return
    wanted = [name for name, *_ in kind.parameters]
    if sorted(wanted) != sorted(name for name, _ in joint.parameters):
        message = f"a {joint.kind} has the parameters {' and '.join(wanted) or 'none'}; give these"
        yield Finding("parameters", message)


def joint_findings(joint: Joint, context: Context) -> Iterator[Finding]:
    """Find ends, parameters and frames that make no joint of its kind."""
    kind = KINDS[joint.kind]
    yield from ends_findings(joint, context)
    parent = joint.parent
    if kind.on_ground and parent in context.axes and parent not in context.grounds:
        message = f"the parent of a {joint.kind} is a ground; '{parent}' is a body"
        yield Finding("parent", message)
    values = dict(joint.parameters)
    for name, _, default, bound in kind.parameters:
        value = values[name]
        is_default = default is not None and isnan(value)
        if not is_default and not value > bound:
            yield Finding(name, f"it is {value:g}; it must be greater than {bound:g}")
    yield from frame_findings(joint.parent_axes, "parent_axes")
    yield from frame_findings(joint.child_axes, "child_axes")


def coordinate_findings(
    part: str, joint: str, coordinate: str, context: Context
) -> Iterator[Finding]:
    """Find a ``coordinate`` (angle or slide) that the joint which ``part`` names does not have."""
    kind = context.kinds.get(joint)
    if kind not in KINDS or coordinate in KINDS[kind].coordinates:
        return
    others = [name for name, record in KINDS.items() if coordinate in record.coordinates]
    if not others:
        yield Finding("coordinate", f"unknown coordinate '{coordinate}'; expected angle or slide")
        return
    has = " and ".join(KINDS[kind].coordinates) or "none"
    message = (
        f"joint '{joint}', a {kind}, has no coordinate {coordinate} (it has: {has}); name one of "
        f"{', '.join(others)}"
    )
    yield Finding(part, message)


def coupling_findings(coupling: Coupling, context: Context) -> Iterator[Finding]:
    """Find a coupling of one joint, of coordinates that do not exist, or by a ratio of zero."""
    if coupling.kind not in COORDINATES:
        known = ", ".join(COORDINATES)
        message = f"unknown kind of coupling '{coupling.kind}'; expected one of {known}"
        yield Finding("kind", message)
        return
    first, second = COORDINATES[coupling.kind]
    found = [
        *coordinate_findings("first", coupling.first, first, context),
        *coordinate_findings("second", coupling.second, second, context),
    ]
    yield from found
    if coupling.first == coupling.second and not found:
        yield Finding("", f"first and second are both '{coupling.first}'; couple two joints")
    tag = SCALES.get(coupling.kind)
    if tag and coupling.ratio == 0.0:
        message = f"the {tag} is zero, which couples nothing; give another (negative: reversed)"
        yield Finding(tag, message)
