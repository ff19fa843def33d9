"""Places on beams where a deck names a body: names of beams become names of their nodes.

    <body node="last">Blade</body>           the last node; or first, or a number from 1
    <body station="0.25">Blade</body>        the node at a quarter of the length, made if needed
    <body>Blade.3</body>                     a node by its name; or Blade.first, Blade.last
    <force basis="Blade">                    the axes of the node that the element attaches to

So all readers see names of bodies. Some loads, and groups, take all nodes of a beam.
"""

from collections.abc import Iterator
from typing import NamedTuple

from msahl.beams.mesh import Mesh, mesh
from msahl.deck.faults import KINDS, Element, attribute, text
from msahl.deck.joint_start import gives_starts
from msahl.deck.references import BODIES
from msahl.deck.values import INERTIAL_BASIS, Reader

ALL_NODES = ("distributed", "bodyForce", "group")
"""Elements whose body may be a beam, all nodes of it."""

ENDS = ("first", "last")

MOST_ELEMENTS, MOST_DEGREE = 10_000, 8


class _Place(NamedTuple):
    """A place on a ``beam`` that an element names: a ``node`` ("": at the ``station``)."""

    label: Element
    beam: str
    node: str
    station: float


def attach_to_beams(root: Element, reader: Reader) -> None:
    """Put the names of nodes where places on beams are named, and make known the mesh of every
    beam, which has nodes at these places."""
    names = {text(e.find("name")): e for e in root.iterfind("system/bodies/beam")}
    if not names:
        _refuse_places(root, reader)
        return
    places = list(_places(root, set(names), reader))
    stations: dict[str, set[float]] = {name: set() for name in names}
    for place in places:
        if not place.node:
            stations[place.beam].add(place.station)
    for beam, station in _ends_of_loads(root, reader):
        stations.get(beam, set()).add(station)
    for name, element in names.items():
        if reader.faults.sound(element):
            reader.meshes[name] = _read_mesh(element, stations[name], reader)
    _check_node_names(root, set(names), reader)
    for place in places:
        _name_node(place, reader)
    _name_bases(root, set(names), reader)


def _refuse_places(root: Element, reader: Reader) -> None:
    """Add a fault for every place on a beam in a deck without beams."""
    # XPath is evaluated by libxml2, and ``iterfind`` by Python.
    paths = BODIES if reader.faults.none else ("system/descendant::*",)
    places = "@*[name() = 'node' or name() = 'station']"
    if not any(root.xpath(f"boolean({path}/{places})") for path in paths):
        return
    for label in root.iterfind("system/*//*"):
        if label.get("node") or label.get("station"):
            _refuse(label, reader)


def _refuse(label: Element, reader: Reader) -> None:
    given = next(key for key in ("node", "station") if label.get(key) is not None)
    message = f"'{text(label)}' is no beam and has no {given}s; delete {given}"
    reader.faults.add(label, message)


def _places(root: Element, beams: set[str], reader: Reader) -> Iterator[_Place]:
    """Yield the places that are named, as far as they are free of faults."""
    for path in BODIES:
        for label in root.iterfind(path):
            place = _place(label, beams, reader) if reader.faults.sound(label) else None
            if place is not None:
                yield place


def _place(label: Element, beams: set[str], reader: Reader) -> _Place | None:
    """Return the place on a beam that a label names; None for another body, or a beam
    with all its nodes."""
    given, node, station = text(label), attribute(label, "node"), attribute(label, "station")
    beam, named = _split(given, beams)
    if not beam:
        if node or station:
            _refuse(label, reader)
        return None
    if sum(map(bool, (named, node, station))) > 1:
        reader.faults.add(label, "the place on the beam is given twice; keep one of node, station")
        return None
    node = node or named
    if node or station:
        where = float(station) if station else 0.0
        return _Place(label, beam, node, where)
    owner = label.getparent()
    if owner is None or owner.tag not in ALL_NODES:
        message = f"'{beam}' is a beam; say where on it"
        reader.faults.add(label, f'{message}: node="first", "last" or a number, or station="0.5"')
    return None


def _split(name: str, beams: set[str]) -> tuple[str, str]:
    """Return the beam that a name means and the node of it, "" for none."""
    if name in beams:
        return name, ""
    beam, _, node = name.rpartition(".")
    is_node = beam in beams and (node in ENDS or (node.isascii() and node.isdigit()))
    return (beam, node) if is_node else ("", "")


def _ends_of_loads(root: Element, reader: Reader) -> Iterator[tuple[str, float]]:
    """Yield beam and station of the ends of distributed loads."""
    for load in root.iterfind("system/loads/distributed"):
        if reader.faults.sound(load):
            for tag in ("startStation", "endStation"):
                for element in load.iterfind(tag):
                    yield text(load.find("body")), float(element.text or "")


def _read_mesh(beam: Element, stations: set[float], reader: Reader) -> Mesh:
    elements = _count(beam, "elements", 8, MOST_ELEMENTS, reader)
    return mesh(_count(beam, "degree", 3, MOST_DEGREE, reader), elements, stations)


def _count(beam: Element, tag: str, default: int, most: int, reader: Reader) -> int:
    """Return a number from 1 on."""
    element = beam.find(tag)
    value = float(default) if element is None else reader.number(element)
    if value.is_integer() and 1.0 <= value <= most:
        return int(value)
    assert element is not None
    reader.faults.add(element, f"it is {value:g}; give an integer from 1 to {most}")
    return 1


def _check_node_names(root: Element, beams: set[str], reader: Reader) -> None:
    """Add a fault for every other element with a name that a node of a beam has."""
    for group in ("bodies", "markers", "groups"):
        for label in root.iterfind(f"system/{group}/*/name"):
            beam, node = _split(text(label), beams)
            if node:
                message = f"the name is that of a node of the beam '{beam}'; choose another"
                reader.faults.add(label, message)


def _name_node(place: _Place, reader: Reader) -> None:
    """Put the name of a node in place of that of its beam."""
    label, nodes = place.label, reader.meshes.get(place.beam)
    if nodes is None:
        reader.faults.doubt(label)  # the beam has a fault, or one of two that are called alike
        return
    if not place.node:
        number = nodes.node_at(place.station)
    elif place.node in ENDS:
        number = 1 if place.node == "first" else nodes.count
    else:
        number = int(place.node)
    if not 1 <= number <= nodes.count:
        message = f"beam '{place.beam}' has no node {number}; its nodes are 1 to {nodes.count}"
        reader.faults.add(label, message)
        return
    label.text = f"{place.beam}.{number}"
    for key in ("node", "station"):
        label.attrib.pop(key, "")


def _name_bases(root: Element, beams: set[str], reader: Reader) -> None:
    """Put the names of nodes in place of those of beams where these name axes."""
    by_joints = gives_starts(root)
    for element in root.iterfind("system//*[@basis]"):
        if by_joints:
            _check_beams_own(element, reader)
        beam, node = _split(attribute(element, "basis"), beams)
        if not beam or not reader.faults.sound(element):
            continue
        owner, end = _owner(element)
        if owner.tag == "beam" and (node or beam != text(owner.find("name"))):
            message = "a beam is placed before other beams; name the axes of a body or ground"
            reader.faults.add(element, message)
        elif owner.tag == "beam":
            continue
        elif node in ENDS:
            mesh_of = reader.meshes.get(beam)
            last = mesh_of.count if mesh_of else 1
            element.set("basis", f"{beam}.{1 if node == 'first' else last}")
        elif not node:
            _name_own_basis(element, beam, owner, end, reader)


def _check_beams_own(element: Element, reader: Reader) -> None:
    """Add a fault if a beam is placed in axes that may follow from joints."""
    owner, basis = _owner(element)[0], attribute(element, "basis")
    root = element.getroottree().getroot()
    grounds = [text(label) for label in root.iterfind("system/bodies/ground/name")]
    if owner.tag == "beam" and basis not in (INERTIAL_BASIS, *grounds, text(owner.find("name"))):
        message = f"where '{basis}' is may follow from joints; give the components in the axes"
        reader.faults.add(element, f"{message} of a ground")


def _owner(element: Element) -> tuple[Element, Element]:
    """Return the record that an element belongs to, and the parent or child of it, or itself."""
    end = element
    for step in (element, *element.iterancestors()):
        if step.tag in ("parent", "child"):
            end = step
        holder = step.getparent()
        if holder is not None and holder.tag in KINDS:
            return step, end if end is not element else step
    return element, element


def _name_own_basis(
    element: Element, beam: str, owner: Element, end: Element, reader: Reader
) -> None:
    """Name the axes of the node of a beam to which the element itself attaches."""
    label = end.find("name") if end is not owner else owner.find("body")
    body = text(label)
    if body == beam and owner.tag in ALL_NODES:
        return  # each node has its own load
    if body.rpartition(".")[0] == beam:
        element.set("basis", body)
        return
    message = f"'{beam}' is a beam, whose nodes have axes of their own"
    reader.faults.add(element, f"{message}; name one, such as '{beam}.first' or '{beam}.last'")
