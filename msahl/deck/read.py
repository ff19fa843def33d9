"""A deck file -> the model. All faults at once.

    bytes -> tree -> schema -> names -> axes -> bodies -> joints, loads -> model

Only records that the schema finds sound are read further, but every name counts: a slip in one
record does not make references to it look wrong.
"""

from collections.abc import Callable, Iterable, Mapping
from os import PathLike
from pathlib import Path
from typing import Any

from msahl.deck.bodies import read_ground, read_rigid_body
from msahl.deck.faults import KINDS, Element, Faults, line_of, text
from msahl.deck.joints import read_spherical
from msahl.deck.loads import read_concentrated
from msahl.deck.parse import parse, read_bytes
from msahl.deck.schema import check_schema
from msahl.deck.simulation import read_simulation
from msahl.deck.values import Reader
from msahl.model import Ground, Model, RigidBody, Simulation
from msahl.rotation import matrix
from msahl.vector import IDENTITY, ZERO, Vector

BODIES: Mapping[str, Callable[[Element, Reader], Any]] = {
    "ground": read_ground,
    "rigidBody": read_rigid_body,
}
JOINTS: Mapping[str, Callable[[Element, Reader], Any]] = {"spherical": read_spherical}
LOADS: Mapping[str, Callable[[Element, Reader], Any]] = {"concentrated": read_concentrated}

FORBIDDEN = frozenset(",;\"'")
"""Characters no name may hold, beside those that do not print: names become CSV columns."""


def read_deck(path: str | PathLike[str], thorough: bool = False) -> Model:
    """The model of the deck at ``path``; raises ``DeckError`` with every fault found.

    ``thorough`` has the schema enforced by both validators (see ``deck.schema``).
    """
    path = Path(path)
    faults = Faults(str(path))
    root = parse(read_bytes(path, faults), faults)
    check_schema(root, faults, thorough)
    model = _read_model(root, faults)
    faults.raise_if_any()
    return model


def _read_model(root: Element, faults: Faults) -> Model:
    """What can be read of the deck; complete if ``faults`` stays empty."""
    unit_system = text(root.find("unitSystem"))
    reader = Reader("US" if unit_system == "US" else "SI", faults)
    sound = {group: _sound(root.iterfind(f"system/{group}/*"), faults) for group in KINDS}
    for group in KINDS:
        _check_names(root, group, faults)
    _read_axes(root, sound["bodies"], reader)
    bodies = [_read_body(element, reader) for element in sound["bodies"]]
    _check_some_body(root, faults)
    return Model(
        gravity=_gravity(root, reader),
        grounds=tuple(body for body in bodies if isinstance(body, Ground)),
        bodies=tuple(body for body in bodies if isinstance(body, RigidBody)),
        joints=tuple(JOINTS[str(e.tag)](e, reader) for e in sound["joints"]),
        loads=tuple(LOADS[str(e.tag)](e, reader) for e in sound["loads"]),
        simulation=_simulation(root, reader),
        unit_system=reader.unit_system,
    )


def _sound(elements: Iterable[Element], faults: Faults) -> list[Element]:
    """Those elements which are free of faults so far."""
    return [element for element in elements if faults.sound(element)]


def _check_names(root: Element, group: str, faults: Faults) -> None:
    """Names are printable, fit to head a column, and unique within their group."""
    taken: dict[str, Element] = {}
    for record in root.iterfind(f"system/{group}/*"):
        label = record.find("name")
        name = text(label)
        if label is None or not name:
            continue  # told by the schema
        if name in taken:
            first = line_of(taken[name])
            faults.add(label, f"the name is taken by line {first}; choose another")
            faults.doubt(taken[name])  # which of the two others mean is not known
        taken.setdefault(name, label)
        bad = sorted({c for c in name if c in FORBIDDEN or not c.isprintable()})
        if bad:
            shown = " ".join(ascii(c)[1:-1] for c in bad)
            faults.add(label, f"a name must not contain {shown} (names head columns of results)")


def _read_axes(root: Element, sound: list[Element], reader: Reader) -> None:
    """Make every body's axes known before anything refers to them.

    A body with faults is known by name, so that references to it hold.
    """
    for element in root.iterfind("system/bodies/*/name"):
        reader.axes.setdefault(text(element), IDENTITY)
    for element in sound:
        name = text(element.find("name"))
        if element.tag == "ground":
            reader.grounds.append(name)
        reader.axes[name] = matrix(reader.orientation(element))


def _read_body(element: Element, reader: Reader) -> Ground | RigidBody:
    """Record of a ground or body; its place becomes known to the joints if it has no fault."""
    body: Ground | RigidBody = BODIES[str(element.tag)](element, reader)
    start = element.find("initialConditions")
    placed = start is None or reader.faults.sound(start)
    label = element.find("name")
    if placed and label is not None and reader.faults.sound(label):
        reader.origins[body.name] = getattr(body, "position", ZERO)
    return body


def _check_some_body(root: Element, faults: Faults) -> None:
    """A scene has something that moves."""
    bodies = root.find("system/bodies")
    if bodies is not None and faults.sound(bodies) and bodies.find("rigidBody") is None:
        faults.add(bodies, "nothing here moves; add a <rigidBody>")


def _gravity(root: Element, reader: Reader) -> Vector:
    """Acceleration of gravity [m/s^2], inertial axes; zero without element."""
    element = root.find("system/gravity")
    usable = element is not None and reader.faults.sound(element)
    return reader.components(element) if usable else ZERO


def _simulation(root: Element, reader: Reader) -> Simulation:
    """Record of ``<simulation>``; an empty one if the schema found fault with it."""
    element = root.find("simulation")
    if element is None or not reader.faults.sound(element):
        return Simulation("", 0.0, 0.0)
    return read_simulation(element, reader)
