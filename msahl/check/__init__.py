"""Check of a model's meaning: ``check(model)`` returns all faults of a model, without any XML.

Each rule is written once, as a function of a record that yields findings, in the module of its
subject. ``check`` applies the rules to every element of a model; the reader of decks applies them
to each element as it reads it, and adds file and line.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields
from typing import Any

from msahl.algebra.functions import Law
from msahl.check.beams import beam_findings
from msahl.check.bodies import body_findings
from msahl.check.contacts import contact_findings, overlap_findings
from msahl.check.context import INERTIAL, Context, add_values, context_of
from msahl.check.elastic import elastic_findings
from msahl.check.ends import is_placed
from msahl.check.events import event_findings, switchable_findings
from msahl.check.faults import Fault, Finding, ModelError, number_findings
from msahl.check.joint_fit import fit_findings, twist_findings
from msahl.check.joints import coupling_findings, joint_findings, kind_findings
from msahl.check.laws import law_findings
from msahl.check.loads import element_findings, repeated_motions, speed_jumps
from msahl.check.loads import start_findings as placed_findings
from msahl.check.markers import group_findings, marker_findings, sensor_findings
from msahl.check.names import RESERVED, name_messages, signal_name_messages, unresolved
from msahl.check.shapes import shape_findings
from msahl.check.signals import circle_findings, expression_findings, signal_findings
from msahl.check.simulation import check_simulation, simulation_findings, start_findings
from msahl.model import Beam, Joint, JointMotion, Model, RigidBody, Shape

__all__ = ["Fault", "ModelError", "check", "check_simulation", "require_sound"]

BODIES = ("parent", "child", "body", "force_basis", "moment_basis")
"""Fields that name a body or ground."""
JOINTS = ("joint", "first", "second")
"""Fields that name a joint."""

Rule = Callable[[Any, Context], Iterator[Finding]]


def check(model: Model) -> list[Fault]:
    """Return all faults of a model: what is wrong, where, and what to do; empty if there are none.

    An element with a fault that prevents further checks of it (a number that is not finite, a name
    that does not resolve) is not checked further.
    """
    context = context_of(model)
    found = [*_name_faults(model), *_signal_name_faults(model, context)]
    if not model.bodies:
        found.append(Fault("", "", "", "nothing in the model moves; add a rigid body"))
    found += _faults("", "", _gravity_findings(model))
    found += _body_faults(model, context)
    for joint in model.joints:
        found += _element_faults("joint", joint, context, [_kind, joint_findings, _fit])
    for coupling in model.couplings:
        found += _element_faults("joint", coupling, context, [coupling_findings, _lift])
    others: list[tuple[str, Any]] = [("motion", motion) for motion in model.motions]
    others += [("load", load) for load in model.loads]
    for kind, element in others:
        found += _element_faults(kind, element, context, [element_findings, placed_findings])
    for contact in model.contacts:
        rules: list[Rule] = [contact_findings, overlap_findings]
        found += _element_faults("contact", contact, context, rules)
    found += _motion_faults(model)
    for marker in model.markers:
        found += _element_faults("marker", marker, context, [marker_findings])
    for sensor in model.sensors:
        found += _element_faults("marker", sensor, context, [sensor_findings])
    for group in model.groups:
        found += _element_faults("group", group, context, [group_findings])
    for signal in model.signals:
        found += _element_faults("signal", signal, context, [signal_findings])
    for stop in model.stops:
        findings = expression_findings("when", stop.expression, context)
        found += [Fault("stop", "", finding.part, finding.message) for finding in findings]
    for event in model.events:
        found += _faults("event", event.name, event_findings(event, context))
    for name in model.released:
        found += _faults("events", "", switchable_findings("released", name, context.switchable))
    signals = {signal.name: signal for signal in model.signals}
    found += [Fault("signal", name, "", message) for name, message in circle_findings(signals)]
    run = [*simulation_findings(model.simulation), *start_findings(model)]
    return found + _faults("simulation", "", run)


def _body_faults(model: Model, context: Context) -> list[Fault]:
    """Return the faults of bodies, beams, elastic bodies and shapes."""
    found: list[Fault] = []
    for body in model.bodies:
        found += _element_faults("body", body, context, [_body])
    bodies = {body.name: body for body in model.bodies}
    for beam in model.beams:
        found += _faults("beam", beam.name, _beam(beam, bodies))
    for elastic in model.elastic_bodies:
        found += _faults("body", elastic.name, elastic_findings(elastic, bodies))
    for shape in model.shapes:
        found += _faults("body", shape.body, _shape(shape, context))
    return found


def require_sound(model: Model) -> None:
    """Raise ``ModelError`` with all faults of a model, if it has any."""
    faults = check(model)
    if faults:
        raise ModelError(faults)


def _element_faults(kind: str, element: Any, context: Context, rules: list[Rule]) -> list[Fault]:
    """Return the faults by the first of the rules that finds any."""
    for rule in (_sizes, _references, _laws, *rules):
        found = _faults(kind, element.name, rule(element, context))
        if found:
            return found
    return []


def _faults(kind: str, name: str, findings: Any) -> list[Fault]:
    return [Fault(kind, name, part, message) for part, message in findings]


def _name_faults(model: Model) -> Iterator[Fault]:
    """Yield faults of names; bodies and grounds share one set of names, all else another."""
    bodies: list[tuple[str, Any]] = [
        ("body", element) for element in (*model.grounds, *model.bodies)
    ]
    bodies += [("beam", element) for element in model.beams]
    bodies += [("marker", element) for element in (*model.markers, *model.sensors)]
    bodies += [("group", element) for element in model.groups]
    others: list[tuple[str, Any]] = [("joint", e) for e in (*model.joints, *model.couplings)]
    others += [("motion", element) for element in model.motions]
    others += [("contact", element) for element in model.contacts]
    others += [("event", element) for element in model.events]
    others += [("load", element) for element in model.loads]
    others += [("signal", element) for element in model.signals]
    others += [("beam", element) for element in model.beams]
    others += [("elastic body", element) for element in model.elastic_bodies]
    for elements, reserved in ((bodies, ()), (others, RESERVED)):
        names = [element.name for _, element in elements]
        kinds = [kind for kind, _ in elements]

        def describe(index: int, kinds: list[str] = kinds) -> str:
            return f"{kinds[index]} {kinds[: index + 1].count(kinds[index])}"

        for index, message, _ in name_messages(names, describe, reserved):
            yield Fault(kinds[index], names[index], "name", message)
        for index, name in enumerate(names):
            if not name:
                yield Fault(describe(index), "", "name", "the name is empty; give a name")


def _signal_name_faults(model: Model, context: Context) -> Iterator[Fault]:
    """Yield faults of signals that are called like a value of another element."""
    others = Context(kinds=context.kinds, markers=context.markers)
    add_values(others, ())
    names = [signal.name for signal in model.signals]
    loads = {load.name for load in model.loads}
    for index, message in signal_name_messages(names, others.values, loads):
        yield Fault("signal", names[index], "name", message)


def _gravity_findings(model: Model) -> Iterator[Finding]:
    for part, message in number_findings(model):
        if part == "gravity":
            yield Finding(part, message)


def _sizes(element: Any, context: Context) -> Iterator[Finding]:
    yield from number_findings(element)


def _references(element: Any, context: Context) -> Iterator[Finding]:
    for field in fields(element):
        name = getattr(element, field.name)
        if field.name in BODIES and (name == INERTIAL or name not in context.axes):
            yield Finding(field.name, unresolved(field.name, name, "body", context.bodies()))
        if field.name in JOINTS and name not in context.kinds:
            yield Finding(field.name, unresolved(field.name, name, "joint", context.kinds))


def _laws(element: Any, context: Context) -> Iterator[Finding]:
    for field in fields(element):
        law = getattr(element, field.name)
        if isinstance(law, Law):
            for part, message in (*number_findings(law), *law_findings(law)):
                yield Finding("/".join(filter(None, (field.name, part))), message)


def _body(body: RigidBody, context: Context) -> Iterator[Finding]:
    yield from body_findings(body)


def _beam(beam: Beam, bodies: Mapping[str, RigidBody]) -> Iterator[Finding]:
    """Find what is wrong with the numbers of a beam and the bodies that are its nodes."""
    yield from number_findings(beam)
    for name in beam.nodes:
        if name not in bodies:
            yield Finding("nodes", unresolved("node", name, "body", bodies))
            return
    yield from beam_findings(beam, ())


def _shape(shape: Shape, context: Context) -> Iterator[Finding]:
    """Find what is wrong with a shape, named as the deck's element."""
    if shape.body not in context.axes:
        yield Finding("shapes", unresolved("body", shape.body, "body", context.bodies()))
    for part, message in shape_findings(shape):
        yield Finding("/".join(filter(None, ("shapes", shape.kind, part))), message)


def _kind(joint: Joint, context: Context) -> Iterator[Finding]:
    yield from kind_findings(joint)


def _fit(joint: Joint, context: Context) -> Iterator[Finding]:
    if is_placed(joint, context):
        found = [*fit_findings(joint, context)]
        yield from found or twist_findings(joint, context)


def _lift(coupling: Any, context: Context) -> Iterator[Finding]:
    if coupling.kind == "camFollower" and coupling.lift is None:
        yield Finding("lift", "a camFollower has no lift; give a periodic law of the cam's angle")


def _motion_faults(model: Model) -> Iterator[Fault]:
    acting = [motion for motion in model.motions if motion.name not in model.released]
    motions = [motion for motion in acting if isinstance(motion, JointMotion)]
    pairs = [(motion.joint, motion.coordinate) for motion in motions]
    for index, message in repeated_motions(pairs, lambda first: f"'{motions[first].name}'"):
        yield Fault("motion", motions[index].name, "", message)
    for index, message in speed_jumps(model.motions, model.simulation):
        yield Fault("motion", model.motions[index].name, "law", message)
