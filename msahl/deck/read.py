"""Reader of a deck's tree: returns the model, or raises all faults at once.

    tree -> names -> axes -> bodies -> joints -> couplings, motions, loads
          -> model

Only records without faults by the schema are read further, but every name and every reference is
checked: a fault in one record neither makes references to it wrong nor hides its own references.
"""

import gc
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import IDENTITY, ZERO, Vector
from msahl.check.context import INERTIAL, Context, add_values
from msahl.check.names import RESERVED, name_messages, signal_name_messages
from msahl.check.signals import circle_findings
from msahl.deck.alike import BodiesAlike, joints_alike
from msahl.deck.attachments import attach_to_beams
from msahl.deck.bodies import BODIES
from msahl.deck.contacts import CONTACTS, is_switchable, read_contacts
from msahl.deck.couplings import read_coupling
from msahl.deck.events import EVENTS, read_event, read_released
from msahl.deck.faults import KINDS, Element, Faults, attribute, text
from msahl.deck.joint_start import gives_starts
from msahl.deck.joints import read_joint
from msahl.deck.line_loads import read_beam_force, read_line_load
from msahl.deck.loads import (
    read_body_force,
    read_concentrated,
    read_distributed,
    read_joint_load,
    read_point_load,
)
from msahl.deck.markers import read_group, read_marker, read_sensor
from msahl.deck.motions import (
    check_prescribed_once,
    check_speeds,
    read_joint_motion,
    read_point_motion,
)
from msahl.deck.references import check_references, is_complete, plain_names
from msahl.deck.shapes import read_shapes
from msahl.deck.signals import declare_signals, read_actuator, read_signal, read_stop
from msahl.deck.simulation import Assembly, read_assembly, read_simulation
from msahl.deck.springs import read_bushing, read_joint_spring, read_spring_damper
from msahl.deck.units import Parameter
from msahl.deck.values import Reader
from msahl.joints.registry import KINDS as JOINT_KINDS
from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.model import Ground, Model, RigidBody, Simulation
from msahl.model.contacts import Contact
from msahl.model.couplings import COORDINATES, Coupling
from msahl.model.events import Event
from msahl.model.joints import Joint
from msahl.model.loads import ConcentratedLoad, Load
from msahl.model.shapes import Shape
from msahl.model.signals import AnySignal, SignalState, Stop

if TYPE_CHECKING:
    from msahl.deck.beams import BuiltBeam
    from msahl.deck.elastic import BuiltElasticBody
    from msahl.deck.includes import Parts

Read = Callable[[Element, Reader], Any]

MOTIONS: Mapping[str, Read] = {"jointMotion": read_joint_motion, "pointMotion": read_point_motion}
LOADS: Mapping[str, Read] = {
    "concentrated": read_concentrated,
    "bodyForce": read_body_force,
    "distributed": read_distributed,
    "springDamper": read_spring_damper,
    "torsionalSpringDamper": read_joint_spring,
    "slideSpringDamper": read_joint_spring,
    "bushing": read_bushing,
    **dict.fromkeys(POINT_LAWS, read_point_load),
    **dict.fromkeys(JOINT_LAWS, read_joint_load),
    "actuator": read_actuator,
}
STILL = {"ground", "beamOfBodies"}
"""Elements among the bodies that have no frame that moves."""
ON_BEAMS: Mapping[str, Callable[[Element, Reader], Iterable[ConcentratedLoad]]] = {
    "bodyForce": read_beam_force,
    "distributed": read_line_load,
}
MARKERS = ("marker", "distance", "angle")
ELASTIC = ("beam", "beamOfBodies", "elasticBody")
"""Bodies that have columns beside those of loads in work.csv."""
TAGS = frozenset(
    (
        *BODIES,
        "beam",
        "beamOfBodies",
        "elasticBody",
        *JOINT_KINDS,
        *COORDINATES,
        *MOTIONS,
        *CONTACTS,
        *EVENTS,
        *LOADS,
        *MARKERS,
        "group",
    )
)
"""Tags of all records."""

ONE_NAME = (
    ("bodies", "markers", "groups"),
    ("joints", "motions", "contacts", "events", "loads", "signals"),
)
"""Groups whose records share one set of names. Columns of results are called NAME.VALUE, and values
of bodies, markers and groups and those of other elements have different names."""


def read_tree(
    root: Element, path: Path, settings: Sequence[str] | None, faults: Faults, parts: "Parts"
) -> Model:
    """Return the model of a tree, which has been compared with the schema, with other numbers;
    raise ``DeckError`` with every fault found.

    The tree of the deck at ``path`` is expanded in place (see ``deck.expand``) unless ``settings``
    are None: it has plain numbers only. ``parts`` are files that were read already.
    """
    model = read_what_is_sound(root, path, settings, faults, parts)
    faults.raise_if_any()
    return model


def read_what_is_sound(
    root: Element,
    path: Path,
    settings: Sequence[str] | None,
    faults: Faults,
    parts: "Parts",
) -> Model:
    """Return what can be read of a tree (see ``read_tree``), and add its faults to ``faults``.

    Elements may refer to others that are missing. Raises ``DeckError`` if a part cannot be read.
    """
    parameters: dict[str, Parameter] = {}
    if settings is not None:
        from msahl.deck.expand import expand  # which other decks do without

        parameters = expand(root, path, settings, faults, parts)
    with _without_collector():
        return _read_model(root, faults, parameters)


@contextmanager
def _without_collector() -> Iterator[None]:
    """Pause the search for cycles of objects: records have none, and it would go through all of
    them again and again as they become more.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()


def _read_model(root: Element, faults: Faults, parameters: Mapping[str, Parameter]) -> Model:
    """Return what can be read of the deck; it is complete if ``faults`` stays empty."""
    simulation = root.find("simulation")
    usable = simulation is not None and faults.sound(simulation)
    assembly = read_assembly(root) if usable else Assembly()
    released = frozenset(map(text, root.iterfind("system/events/released")))
    context = Context(project=assembly.position == "project", released=released)
    reader = Reader(_unit_system(root), faults, context, parameters)
    sound = {group: _sound(root.iterfind(f"system/{group}/*"), faults) for group in KINDS}
    _check_names(root, faults)
    beams, elastic, alike = _place_all(root, sound["bodies"], reader)
    bodies = _read_bodies(sound["bodies"], alike, reader)
    beams += _read_beams_of_bodies(sound["bodies"], reader)
    _check_some_body(root, faults)
    joints, couplings = _read_joints(sound["joints"], reader)
    motions = _read_motions(sound["motions"], reader)
    markers = [read_marker(e, reader) for e in sound["markers"] if e.tag == "marker"]
    reader.context.markers.update({marker.name: marker.body for marker in markers})
    signals = _read_signals(root, reader)
    run = _simulation(root, reader)
    check_speeds(sound["motions"], motions, run, reader)
    contacts = tuple(read_contacts(sound["contacts"], reader))
    loads = _settable(signals, _read_loads(sound["loads"], reader), reader)
    events = _read_events(sound["events"], root, contacts, reader)
    return Model(
        gravity=_gravity(root, reader),
        grounds=tuple(body for body in bodies if isinstance(body, Ground)),
        bodies=tuple(body for body in bodies if isinstance(body, RigidBody)),
        joints=tuple(joints),
        loads=loads,
        simulation=run,
        unit_system=reader.unit_system,
        couplings=tuple(couplings),
        motions=tuple(motions),
        contacts=contacts,
        events=events,
        released=tuple(read_released(e, reader) for e in sound["events"] if e.tag == "released"),
        position=assembly.position,
        velocity=assembly.velocity,
        signals=signals,
        stops=_read_stops(root, reader),
        markers=tuple(markers),
        sensors=tuple(read_sensor(e, reader) for e in sound["markers"] if e.tag != "marker"),
        groups=tuple(read_group(e, reader) for e in sound["groups"]),
        shapes=tuple(_read_shapes(root, sound["bodies"], reader)),
        beams=tuple(built.beam for built in beams if built.beam is not None),
        beam_shapes=tuple(built.shape for built in beams if built.shape is not None),
        elastic_bodies=tuple(built.body for built in elastic if built.body is not None),
        places=_places(root, faults),
    )


def _unit_system(root: Element) -> str:
    return "US" if text(root.find("unitSystem")) == "US" else "SI"


def _places(root: Element, faults: Faults) -> dict[str, str]:
    """Return file and line of what a run may have to say something of, by name."""
    return {
        text(_label(element)): faults.place_of(element)
        for group in ("motions", "contacts", "loads", "signals")
        for element in root.iterfind(f"system/{group}/*")
    }


def _place_all(
    root: Element, bodies: list[Element], reader: Reader
) -> "tuple[list[BuiltBeam], list[BuiltElasticBody], BodiesAlike]":
    """Make the axes of all bodies known and check all references; return the beams, the elastic
    bodies, and the bodies that are alike."""
    attach_to_beams(root, reader)
    alike = _read_axes(root, bodies, reader)
    _read_kinds(root, reader)
    elastic = _read_elastic_bodies(bodies, reader)
    beams = _read_beams(bodies, reader)
    check_references(root, TAGS, reader)
    if gives_starts(root):
        from msahl.deck.placement import place_by_joints  # which few decks need

        place_by_joints(root, reader)
    return beams, elastic, alike


def _read_beams(sound: list[Element], reader: Reader) -> "list[BuiltBeam]":
    """Return the beams, whose nodes become known by name, axes and place."""
    elements = [element for element in sound if element.tag == "beam"]
    if not elements:
        return []
    from msahl.deck.beams import read_beam  # which few decks need

    built = []
    for element in elements:
        if text(element.find("name")) in reader.meshes:
            built.append(read_beam(element, reader))
            reader.beams[text(element.find("name"))] = built[-1].nodes
    return built


def _read_elastic_bodies(sound: list[Element], reader: Reader) -> "list[BuiltElasticBody]":
    """Return the elastic bodies, whose bodies become known as the nodes of beams do."""
    elements = [element for element in sound if element.tag == "elasticBody"]
    if not elements:
        return []
    from msahl.deck.elastic import read_elastic_body  # which few decks need

    built = [read_elastic_body(element, reader) for element in elements]
    for element, one in zip(elements, built, strict=True):
        reader.beams[text(element.find("name"))] = one.bodies
    return built


def _read_bodies(
    sound: list[Element], alike: BodiesAlike, reader: Reader
) -> list[Ground | RigidBody]:
    """Return the records of grounds and bodies; nodes of beams are bodies."""
    found: list[Ground | RigidBody] = []
    for element, record in zip(sound, alike.records(), strict=True):
        if record is not None:
            reader.context.place(record.name, record.position)
            reader.bodies[record.name] = record
            found.append(record)
        elif element.tag in ("beam", "elasticBody"):
            found += reader.beams.get(text(element.find("name")), ())
        elif element.tag != "beamOfBodies":
            found.append(_read_body(element, reader))
    return found


def _read_beams_of_bodies(sound: list[Element], reader: Reader) -> "list[BuiltBeam]":
    """Return the beams between bodies, which have been read."""
    elements = [element for element in sound if element.tag == "beamOfBodies"]
    if not elements:
        return []
    from msahl.deck.beam_of_bodies import read_beam_of_bodies  # which few decks need
    from msahl.deck.beams import BuiltBeam

    found = [read_beam_of_bodies(element, reader) for element in elements]
    return [BuiltBeam(records[0], (), records[1]) for records in found if records]


def _read_shapes(root: Element, elements: list[Element], reader: Reader) -> Iterator[Shape]:
    """Yield the shapes, of grounds before those of bodies."""
    if not root.xpath("boolean(system/bodies/*/shapes)"):
        return
    elements = [element for element in elements if element.find("shapes") is not None]
    for element in sorted(elements, key=lambda element: element.tag != "ground"):
        yield from read_shapes(element, reader)


def _read_loads(elements: list[Element], reader: Reader) -> Iterator[Load]:
    """Yield the loads; one on a beam is one on each node."""
    for element in elements:
        if element.tag in ON_BEAMS and text(element.find("body")) in reader.meshes:
            yield from ON_BEAMS[str(element.tag)](element, reader)
        else:
            yield LOADS[str(element.tag)](element, reader)


def _read_joints(sound: list[Element], reader: Reader) -> tuple[list[Joint], list[Coupling]]:
    """Return the joints, and the couplings of two of them."""
    elements = [element for element in sound if element.tag in JOINT_KINDS]
    joints = []
    for element, record in zip(elements, joints_alike(elements, reader), strict=True):
        joints.append(read_joint(element, reader) if record is None else record)
        if record is not None:
            reader.joints[record.name] = record
    return joints, [read_coupling(e, reader) for e in sound if e.tag in COORDINATES]


def _read_motions(sound: list[Element], reader: Reader) -> list[Any]:
    """Return the prescribed motions, of which no two are of one coordinate."""
    motions = [MOTIONS[str(element.tag)](element, reader) for element in sound]
    check_prescribed_once(sound, reader)
    return motions


def _read_signals(root: Element, reader: Reader) -> tuple[AnySignal, ...]:
    """Return the signals, states and tables, once joints and markers are known by name."""
    elements = list(root.iterfind("system/signals/*"))
    names = [attribute(element, "name") for element in elements]
    loads = {text(name) for name in root.iterfind("system/loads/*/name")}
    add_values(reader.context, ())
    for index, message in signal_name_messages(names, reader.context.values, loads):
        reader.faults.add(elements[index], message)
    declare_signals(elements, reader)
    sound = _sound(elements, reader.faults)
    signals = [read_signal(element, reader) for element in sound]
    by_name = dict(zip((signal.name for signal in signals), sound, strict=True))
    for name, message in circle_findings({signal.name: signal for signal in signals}):
        reader.faults.add(by_name[name], message)
    return tuple(signals)


def _settable(
    signals: Iterable[AnySignal], given: Iterable[Load], reader: Reader
) -> tuple[Load, ...]:
    """Return the loads, and make them and the states known: events may set them."""
    loads = tuple(given)
    states = (signal.name for signal in signals if isinstance(signal, SignalState))
    reader.context.states.update(dict.fromkeys(states))
    reader.context.loads.update((load.name, load) for load in loads)
    return loads


def _read_events(
    sound: list[Element], root: Element, contacts: Sequence[Contact], reader: Reader
) -> tuple[Event, ...]:
    """Return the events, once all that they may name is known."""
    if not sound:
        return ()
    for path in ("joints/*", "motions/*", "contacts/*"):
        names = [e.find("name") for e in root.iterfind(f"system/{path}") if is_switchable(e)]
        reader.context.switchable.update((text(name), None) for name in names)
    rigid = (contact.name for contact in contacts if contact.compliance is None)
    reader.context.switchable.update(dict.fromkeys(rigid))
    return tuple(read_event(element, reader) for element in sound if element.tag == "event")


def _read_stops(root: Element, reader: Reader) -> tuple[Stop, ...]:
    """Return the conditions that end the run, once signals are known by name."""
    elements = _sound(root.iterfind("simulation/stop"), reader.faults)
    return tuple(read_stop(element, reader) for element in elements)


def _sound(elements: Iterable[Element], faults: Faults) -> list[Element]:
    """Return the elements that are free of faults so far."""
    return [element for element in elements if faults.sound(element)]


def _check_names(root: Element, faults: Faults) -> None:
    """Add a fault for every name that is taken within its groups or cannot head a column."""
    for groups in ONE_NAME:
        _check_names_of(groups, root, faults)


def _check_names_of(groups: Collection[str], root: Element, faults: Faults) -> None:
    """Check the names of ``groups`` that share one set of names."""
    reserved = RESERVED if "loads" in groups else ()
    if _names_are_right(groups, root, faults, reserved):
        return
    records = [record for group in groups for record in root.iterfind(f"system/{group}/*")]
    if "loads" in groups:
        records += [record for tag in ELASTIC for record in root.iterfind(f"system/bodies/{tag}")]
    labels = [label for record in records if (label := _label(record)) is not None]
    names = [text(label) if label.tag == "name" else attribute(label, "name") for label in labels]

    def line(index: int) -> str:
        return faults.line_in_words(labels[index])

    for index, message, first in name_messages(names, line, reserved):
        faults.add(labels[index], message)
        if first is not None:
            faults.doubt(labels[first])  # a reference may mean either of the two


def _names_are_right(
    groups: Collection[str], root: Element, faults: Faults, reserved: Collection[str]
) -> bool:
    """Return whether the names of ``groups`` are seen to be right without their elements."""
    paths = [f"system/{group}/*" for group in groups]
    paths += [f"system/bodies/{tag}" for tag in ELASTIC] if "loads" in groups else []
    found = [plain_names(root, path, faults) for path in paths]
    names = [name for some in found if some is not None for name in some]
    return None not in found and not any(name_messages(names, str, reserved))


def _label(record: Element) -> Element | None:
    """Return the element that holds the name of a record: a child, or itself by an attribute."""
    return record if record.get("name") is not None else record.find("name")


def _read_axes(root: Element, sound: list[Element], reader: Reader) -> BodiesAlike:
    """Make every body's axes known before anything refers to them; return those that are alike.

    A body with faults is known by name, so that references to it resolve.
    """
    context = reader.context
    path = "system/bodies/*[not(self::beamOfBodies)]"
    for name in plain_names(root, path, reader.faults) or _texts(root, f"{path}/name"):
        context.axes.setdefault(name, IDENTITY)
    for element in root.iterfind("system/bodies/ground"):
        context.grounds[text(element.find("name"))] = None
    if not is_complete(root, "bodies", TAGS):
        context.grounds.setdefault(INERTIAL)
    alike = BodiesAlike(sound, reader)
    names = plain_names(root, "system/bodies/*", reader.faults)
    names = [text(e.find("name")) for e in sound] if names is None else names
    for element, name, axes in zip(sound, names, alike.axes(), strict=True):
        if element.tag == "beamOfBodies":
            continue
        if axes is None:
            orientation = reader.orientation(element)
            axes = IDENTITY if orientation is ZERO else matrix(orientation)
        context.axes[name] = axes
    return alike


def _texts(root: Element, path: str) -> list[str]:
    return list(map(text, cast(list[Element], root.xpath(path))))


def _read_kinds(root: Element, reader: Reader) -> None:
    """Make every joint's kind known, with faults or without, before anything refers to it."""
    elements = list(root.iterfind("system/joints/*"))
    names = plain_names(root, "system/joints/*", reader.faults)
    names = [text(e.find("name")) for e in elements] if names is None else names
    for element, name in zip(elements, names, strict=True):
        if element.tag in JOINT_KINDS:
            reader.context.kinds.setdefault(name, str(element.tag))


def _read_body(element: Element, reader: Reader) -> Ground | RigidBody:
    """Return the record of a ground or body, and make its place known if that has no fault."""
    body = BODIES[str(element.tag)](element, reader)
    start = element.find("initialConditions")
    placed = start is None or reader.faults.sound(start)
    label = element.find("name")
    placed &= body.name not in reader.unplaced
    if placed and label is not None and reader.faults.sound(label):
        reader.context.place(body.name, getattr(body, "position", ZERO))
    if isinstance(body, RigidBody) and reader.faults.sound(element):
        reader.bodies[body.name] = body
    return body


def _check_some_body(root: Element, faults: Faults) -> None:
    """Add a fault if the model has no rigid body."""
    bodies = root.find("system/bodies")
    for system in root.iterfind("system") if bodies is None else ():
        faults.add(system, "<bodies> is missing; add it to <system>")
    if (
        bodies is not None
        and faults.sound(bodies)
        and {e.tag for e in bodies.iterfind("*")} <= STILL
    ):
        faults.add(bodies, "nothing here moves; add a <rigidBody>, <beam> or <elasticBody>")


def _gravity(root: Element, reader: Reader) -> Vector:
    """Return the acceleration of gravity [m/s^2], inertial axes; zero without element."""
    element = root.find("system/gravity")
    usable = element is not None and reader.faults.sound(element)
    return reader.components(element) if usable else ZERO


def _simulation(root: Element, reader: Reader) -> Simulation:
    """Return the record of ``<simulation>``; an empty one if it has a fault by the schema."""
    element = root.find("simulation")
    if element is None or not reader.faults.sound(element):
        return Simulation("", 0.0, 0.0)
    return read_simulation(element, reader)
