"""Writer of models: records -> text of a deck that is read back to equal records.

All numbers are in SI, with as many digits as reading the same double needs. Where a deck has a
short form, such as the one axis of a joint, it is taken if it is read back to the same numbers;
otherwise all of them are written. What a deck computed before it became records, such as the values
of its parameters or the nodes of a beam, is written as numbers.
"""

from collections.abc import Iterator
from dataclasses import fields

from lxml import etree

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, Matrix
from msahl.check.context import context_of
from msahl.check.directions import frame
from msahl.deck.elements import child, deck_bytes, lay_out, number, number_unless, numbers, vector
from msahl.deck.faults import Element
from msahl.deck.units import DEFAULTS, UNITS, to_si
from msahl.deck.values import INERTIAL_BASIS
from msahl.deck.write_elements import WRITERS, number_table, write_coupling, write_joint
from msahl.expressions.conditions import margin
from msahl.expressions.syntax import Name, Number, parse, postorder
from msahl.expressions.text import text_of
from msahl.model import (
    Beam,
    BeamShape,
    Event,
    Marker,
    Model,
    RigidBody,
    Shape,
    Signal,
    SignalTable,
    Simulation,
    Stop,
)
from msahl.model.events import Impulse, ParameterChange
from msahl.model.markers import MarkerAngle, Sensor
from msahl.model.settable import settable
from msahl.model.settings import Limits
from msahl.model.shapes import SIZES
from msahl.model.signals import AnySignal

ATTRIBUTES = {
    "start": "start",
    "scheme": "scheme",
    "degree": "degree",
    "damping": "damping",
    "rotation_update": "rotationUpdate",
    "reactions": "reactions",
    "accelerations": "accelerations",
    "joint_table": "jointTable",
    "impact_law": "impactLaw",
}
"""Attributes of ``<simulation>``, by the fields of its record."""


def write_deck(model: Model, note: str = "") -> bytes:
    """Return the text of a deck that is read back to an equal ``model``; a ``note`` is written at
    its head.

    Raises ``ValueError`` for what no deck can say: several conditions to stop at, and laws of more
    coefficients than a deck has.
    """
    root = etree.Element("data")
    child(root, "unitSystem", model.unit_system)
    conditions: tuple[Stop | Event, ...] = (*model.stops, *model.events)
    parameters = dict(pair for one in conditions for pair in _parameters(one))
    if parameters:
        holder = child(root, "parameters")
        for name, value in parameters.items():
            child(holder, "parameter", repr(value), name=name)
    _write_system(child(root, "system"), model)
    _write_simulation(child(root, "simulation"), model)
    lay_out(root)
    return deck_bytes(root, f" {note} " if note else "")


def _write_system(system: Element, model: Model) -> None:
    """Add all elements of a model, without groups that are empty."""
    vector(system, "gravity", model.gravity)
    _write_bodies(child(system, "bodies"), model)
    context = context_of(model)
    joints = child(system, "joints")
    for joint in model.joints:
        write_joint(joints, joint, context)
    for coupling in model.couplings:
        write_coupling(joints, coupling)
    for tag, records in (
        ("motions", model.motions),
        ("contacts", model.contacts),
        ("loads", model.loads),
    ):
        group = child(system, tag)
        for record in records:
            WRITERS[type(record)](group, record, context)
    events = child(system, "events")
    for name in model.released:
        child(events, "released", name)
    for event in model.events:
        _write_event(events, event, model)
    signals, markers, groups = (child(system, tag) for tag in ("signals", "markers", "groups"))
    for signal in model.signals:
        _write_signal(signals, signal)
    for marker in model.markers:
        _write_marker(markers, marker)
    for sensor in model.sensors:
        _write_sensor(markers, sensor)
    for chosen in model.groups:
        element = child(groups, "group")
        child(element, "name", chosen.name)
        for body in chosen.bodies:
            child(element, "body", body)
    for group in list(system):
        if not len(group):
            system.remove(group)


def _write_event(group: Element, event: Event, model: Model) -> None:
    repeats = {"repeats": "true"} if event.repeats else {}
    element = child(group, "event", name=event.name, when=event.condition, **repeats)
    for tag, names in (("release", event.releases), ("engage", event.engages)):
        for name in names:
            child(element, tag, name)
    for change in event.states:
        child(element, "set", text_of(change.expression), name=change.state)
    for parameter in event.parameters:
        name = f"{parameter.load}.{parameter.parameter}"
        child(element, "set", repr(float(parameter.value)), name=name, **_si_unit(model, parameter))
    for impulse in event.impulses:
        _write_impulse(child(element, "impulse"), impulse)
    if event.message:
        child(element, "message", event.message)


def _si_unit(model: Model, change: ParameterChange) -> dict[str, str]:
    """Return the attribute of the unit of a number of a load, none of a pure number."""
    load = next(load for load in model.loads if load.name == change.load)
    quantity = settable(load)[change.parameter]
    return {"units": DEFAULTS["SI"][quantity]} if quantity else {}


def _write_impulse(element: Element, impulse: Impulse) -> None:
    if impulse.joint:
        child(element, "joint", impulse.joint)
        child(element, "coordinate", impulse.coordinate)
    else:
        child(element, "marker", impulse.marker)
        vector(element, "direction", impulse.direction, impulse.basis)
    tag = "velocityChange" if impulse.changes_velocity else "size"
    child(element, tag, text_of(impulse.expression))


def _write_bodies(group: Element, model: Model) -> None:
    shapes: dict[str, list[Shape]] = {}
    for shape in model.shapes:
        shapes.setdefault(shape.body, []).append(shape)
    for ground in model.grounds:
        element = child(group, "ground")
        child(element, "name", ground.name)
        _write_shapes(element, shapes.get(ground.name, []))
    inertial = model.grounds[0].name if model.grounds else INERTIAL_BASIS
    elastic = {one.name: one for one in model.elastic_bodies}
    followers = {name for one in model.elastic_bodies for name in one.bodies}
    bodies = {body.name: body for body in model.bodies}
    for body in model.bodies:
        if body.name in elastic:
            from msahl.deck.elastic import write_elastic_body  # which few decks need

            own = elastic[body.name]
            element = child(group, "elasticBody")
            write_elastic_body(element, own, [bodies[name] for name in own.bodies])
        if body.name in followers:
            continue
        element = child(group, "rigidBody")
        _write_body(element, body, inertial)
        _write_shapes(element, shapes.get(body.name, []))
    for beam, beam_shape in zip(model.beams, model.beam_shapes, strict=True):
        _write_beam(child(group, "beamOfBodies"), beam, beam_shape)


def _write_body(element: Element, body: RigidBody, inertial: str) -> None:
    """Write a rigid body; ``inertial`` names the inertial axes."""
    child(element, "name", body.name)
    number(element, "mass", body.mass, "mass")
    vector(element, "rGB", body.r_BG)
    moi, J = child(element, "moi"), body.inertia
    for i, tag in enumerate(("Ixx", "Iyy", "Izz")):
        number(moi, tag, J[i][i], "inertia")
    for tag, value in (("Ixy", J[0][1]), ("Ixz", J[0][2]), ("Iyz", J[1][2])):
        number_unless(moi, 0.0, tag, value, "inertia")
    start = child(element, "initialConditions")
    vector(start, "position", body.position, inertial if any(body.orientation) else "")
    if any(body.orientation):
        orientation = child(start, "orientation")
        for tag, value in zip(("P1", "P2", "P3"), body.orientation, strict=True):
            number_unless(orientation, 0.0, tag, value)
    vector(start, "velocity", body.velocity)
    vector(start, "angularVelocity", body.angular_velocity)
    if not len(start):
        element.remove(start)


def _write_shapes(body: Element, shapes: list[Shape]) -> None:
    holder = child(body, "shapes") if shapes else body
    for shape in shapes:
        element = child(holder, shape.kind, colour=shape.colour, href=shape.file)
        if shape.kind == "mesh":
            (size,) = shape.size
            known = (name for name in UNITS["length"] if to_si(1.0, name, "length") == size)
            element.set("units", next(known, "m"))
            if to_si(1.0, element.get("units", "m"), "length") != size:
                element.set("scale", repr(float(size)))
        else:
            for tag, value in zip(SIZES[shape.kind], shape.size, strict=True):
                number(element, tag, value, "length")
        vector(element, "position", shape.position)
        if (
            shape.axes != IDENTITY
            and frame(shape.axes[2]) == shape.axes
            and max(shape.axes[2]) == 1
        ):
            vector(element, "axis", shape.axes[2])
        else:
            _write_axes(element, shape.axes)


def _write_axes(element: Element, axes: Matrix) -> None:
    if axes != IDENTITY:
        numbers(child(element, "orientation"), "axes", [a for row in axes for a in row])


def _write_beam(element: Element, beam: Beam, shape: BeamShape) -> None:
    child(element, "name", beam.name)
    child(element, "degree", str(beam.degree))
    for node in beam.nodes:
        child(element, "node", node)
    numbers(element, "lengths", beam.lengths)
    numbers(element, "stations", beam.stations)
    for strain in beam.strain if len(set(beam.strain)) > 1 else beam.strain[:1]:
        numbers(element, "strain", strain)
    for rows in beam.compliance if len(set(beam.compliance)) > 1 else beam.compliance[:1]:
        numbers(element, "compliance", [a for row in rows for a in row])
    if any(beam.damping):
        numbers(element, "dampingTimes", beam.damping)
    for outline in dict.fromkeys((shape.start, shape.end)):
        numbers(element, "outline", [a for point in outline for a in point])
    if shape.colour:
        element.set("colour", shape.colour)


def _write_signal(group: Element, signal: AnySignal) -> None:
    if isinstance(signal, SignalTable):
        _write_table(group, signal)
        return
    if isinstance(signal, Signal):
        element = child(group, "signal", text_of(signal.expression), name=signal.name)
    elif signal.is_input:
        element = child(group, "input", name=signal.name, value=repr(float(signal.initial)))
    else:
        element = child(group, "state", text_of(signal.rate), name=signal.name)
        element.set("initial", repr(float(signal.initial)))
    if signal.unit:
        element.set("units", signal.unit)


def _write_table(group: Element, signal: SignalTable) -> None:
    given = signal.table
    element = child(group, "table", name=signal.name, interpolation=given.kind)
    if isinstance(given, Law):
        number_table(element, given)
        return
    numbers(element, "x", given.x)
    numbers(element, "y", given.y)
    for row in given.values:
        numbers(element, "values", row)


def _write_marker(group: Element, marker: Marker) -> None:
    element = child(group, "marker", basis=marker.basis)
    child(element, "name", marker.name)
    child(element, "body", marker.body)
    vector(element, "position", marker.point)
    _write_axes(element, marker.axes)


def _write_sensor(group: Element, sensor: Sensor) -> None:
    is_angle = isinstance(sensor, MarkerAngle)
    element = child(group, "angle" if is_angle else "distance")
    child(element, "name", sensor.name)
    child(element, "from", sensor.start)
    if isinstance(sensor, MarkerAngle):
        child(element, "vertex", sensor.vertex)
    child(element, "to", sensor.end)


def _parameters(stop: Stop | Event) -> Iterator[tuple[str, float]]:
    """Yield the parameters that a condition names, whose values its expression has."""
    named = postorder(margin(parse(stop.condition)))
    for name, value in zip(named, postorder(stop.expression), strict=True):
        if isinstance(name, Name) and isinstance(value, Number):
            yield name.text, value.value


def _write_simulation(element: Element, model: Model) -> None:
    simulation, default = model.simulation, {f.name: f.default for f in fields(Simulation)}
    for field, attribute in ATTRIBUTES.items():
        value = getattr(simulation, field)
        if value != default[field]:
            element.set(attribute, str(value))
    if simulation.title:
        child(element, "title", simulation.title)
    number(element, "deltaT", simulation.dt, "time")
    number(element, "tFinal", simulation.t_final, "time")
    number(element, "outputInterval", simulation.output_interval, "time")
    number(element, "tolerance", simulation.tolerance, "length")
    number(element, "localTolerance", simulation.local_tolerance, "length")
    if len(model.stops) > 1:
        raise ValueError("a deck has one condition to stop at; join them by 'or'")
    for stop in model.stops:
        child(element, "stop", when=stop.condition)
    _write_start(element, model)


def _write_start(element: Element, model: Model) -> None:
    """Write how the start is made consistent, and the limits of the verdict."""
    if (model.position, model.velocity) != ("check", "keepAngular"):
        child(element, "assembly", position=model.position, velocity=model.velocity)
    limits = model.simulation.limits
    if limits != Limits():
        verdict = child(element, "verdict")
        number(verdict, "accuracy", limits.accuracy, "length")
        number(verdict, "energy", limits.energy)
        number(verdict, "constraintViolation", limits.violation, "length")
