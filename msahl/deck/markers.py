"""Reader of markers, of distances and angles between them, and of groups: elements -> records."""

from msahl.algebra.vector import ZERO
from msahl.check.markers import group_findings, marker_findings, sensor_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.values import Reader
from msahl.model.markers import Group, Marker, MarkerAngle, MarkerDistance, Sensor


def read_marker(element: Element, reader: Reader) -> Marker:
    """Return the record of a ``<marker>``."""
    body = text(element.find("body"))
    known = body in reader.context.axes
    position = element.find("position")
    basis = attribute(element, "basis")
    marker = Marker(
        name=text(element.find("name")),
        body=body,
        point=reader.vector(position, own=body, wanted=body) if known else ZERO,
        axes=reader.axes(element.find("orientation")),
        basis="" if basis in reader.context.grounds else basis,
    )
    found = marker_findings(marker, reader.context)
    reader.add(element, (finding for finding in found if finding.part != "basis"))
    return marker


def read_sensor(element: Element, reader: Reader) -> Sensor:
    """Return the record of a ``<distance>`` or an ``<angle>`` between markers."""
    name, start, vertex, end = (text(element.find(tag)) for tag in ("name", "from", "vertex", "to"))
    is_distance = element.tag == "distance"
    sensor: Sensor = (
        MarkerDistance(name, start, end) if is_distance else MarkerAngle(name, start, vertex, end)
    )
    reader.add(element, sensor_findings(sensor, reader.context))
    return sensor


def read_group(element: Element, reader: Reader) -> Group:
    """Return the record of a ``<group>``."""
    names: list[str] = []
    for name in map(text, element.iterfind("body")):
        names += [node.name for node in reader.beams[name]] if name in reader.beams else [name]
    group = Group(text(element.find("name")), tuple(names))
    for finding in group_findings(group, reader.context):
        # Names that do not resolve are reported where all references are checked.
        if "is not a body" not in finding.message:
            reader.faults.add(element, finding.message)
    return group
