"""Reader of shapes of bodies and grounds: elements -> records. Files of meshes are not opened."""

from collections.abc import Iterator

from msahl.algebra.vector import IDENTITY, Matrix
from msahl.check.directions import frame, unit
from msahl.check.loads import direction_findings
from msahl.check.shapes import shape_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.units import DEFAULTS, to_si
from msahl.deck.values import Reader
from msahl.model.shapes import SIZES, Shape


def read_shapes(body: Element, reader: Reader) -> Iterator[Shape]:
    """Yield the records of the shapes of a ``<rigidBody>`` or ``<ground>``."""
    name = text(body.find("name"))
    for element in body.iterfind("shapes/*"):
        if name in reader.context.axes and reader.faults.sound(element):
            yield _read_shape(element, name, reader)


def _read_shape(element: Element, body: str, reader: Reader) -> Shape:
    kind = str(element.tag)
    if kind == "mesh":
        units = attribute(element, "units") or DEFAULTS[reader.unit_system]["length"]
        scale = float(attribute(element, "scale", "1"))
        size: tuple[float, ...] = (scale * to_si(1.0, units, "length"),)
    else:
        size = reader.numbers(element, SIZES[kind], "length")
    shape = Shape(
        body=body,
        kind=kind,
        size=size,
        position=reader.vector(element.find("position"), own=body, wanted=body),
        axes=_axes(element, body, reader),
        colour=attribute(element, "colour").lower(),
        file=attribute(element, "href"),
    )
    reader.add(element, shape_findings(shape))
    return shape


def _axes(element: Element, body: str, reader: Reader) -> Matrix:
    """Return x, y, z of a shape as rows, in the axes of its body."""
    axis, orientation = element.find("axis"), element.find("orientation")
    if axis is not None and orientation is not None:
        reader.faults.add(element, "<axis> is given beside <orientation>; keep one")
    if axis is None or orientation is not None:
        return reader.axes(orientation)
    direction = reader.vector(axis, own=body, wanted=body)
    if not any(direction):
        reader.add(axis, direction_findings("axis", direction))
        return IDENTITY
    return frame(unit(direction))
