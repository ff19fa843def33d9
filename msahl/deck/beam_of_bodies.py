"""Reader of beams given by their nodes and the numbers of their elements: elements -> records.

Programs write such beams.
"""

from collections.abc import Iterator

from msahl.beams.sections import circle
from msahl.check.beams import beam_findings
from msahl.check.faults import Finding, number_findings
from msahl.check.names import unresolved
from msahl.deck.faults import Element, attribute, text
from msahl.deck.values import Reader
from msahl.model.beams import Beam
from msahl.model.shapes import BeamShape, Points

THIN = 0.01
"""Radius of a beam without an outline in views, by its length."""


def read_beam_of_bodies(element: Element, reader: Reader) -> tuple[Beam, BeamShape] | None:
    """Return the records of a ``<beamOfBodies>``, whose nodes have been read; None with a fault."""
    degree = reader.number(element.find("degree"))
    lengths, stations = (next(_numbers(element, tag)) for tag in ("lengths", "stations"))
    points = len(lengths) * int(degree)
    strain, compliance = (_at_points(element, tag, points) for tag in ("strain", "compliance"))
    damping = [*_numbers(element, "dampingTimes"), (0.0,) * 6][0]
    found = list(_size_findings(degree, strain, compliance, damping))
    if found or not reader.faults.sound(element):
        reader.add(element, found)
        return None
    beam = Beam(
        text(element.find("name")),
        int(degree),
        tuple(map(text, element.iterfind("node"))),
        lengths,
        stations,
        tuple(tuple(row[i : i + 6] for i in range(0, 36, 6)) for row in compliance),  # type: ignore[misc]
        strain,  # type: ignore[arg-type]
        damping,  # type: ignore[arg-type]
    )
    reader.add(element, _findings(beam, reader))
    return (beam, _shape(element, beam)) if reader.faults.sound(element) else None


def _numbers(element: Element, tag: str) -> Iterator[tuple[float, ...]]:
    """Yield the numbers of each child with a ``tag``."""
    for child in element.iterfind(tag):
        yield tuple(map(float, text(child).split()))


def _at_points(element: Element, tag: str, points: int) -> tuple[tuple[float, ...], ...]:
    """Return the numbers at each Gauss point, which may be given once for all."""
    rows = tuple(_numbers(element, tag))
    return rows * points if len(rows) == 1 else rows


def _size_findings(
    degree: float,
    strain: tuple[tuple[float, ...], ...],
    compliance: tuple[tuple[float, ...], ...],
    damping: tuple[float, ...],
) -> Iterator[Finding]:
    """Find lists that have not as many numbers as they need."""
    if not degree.is_integer():
        yield Finding("degree", f"it is {degree:g}; give an integer")
    lists = (("strain", strain, 6), ("compliance", compliance, 36), ("dampingTimes", (damping,), 6))
    for tag, rows, count in lists:
        if any(len(row) != count for row in rows):
            yield Finding(tag, f"it does not have {count} numbers; correct it")


def _findings(beam: Beam, reader: Reader) -> Iterator[Finding]:
    """Find numbers that do not fit together, and nodes that do not exist."""
    for name in beam.nodes:
        if name not in reader.bodies:
            known = unresolved("node", name, "body", reader.bodies)
            yield Finding("node", known)
            return
    yield from number_findings(beam)
    yield from beam_findings(beam, ())


def _shape(element: Element, beam: Beam) -> BeamShape:
    """Return what the beam looks like: its outlines, or else a thin rod."""
    outlines: list[Points] = [
        tuple(zip(row[::2], row[1::2], strict=False)) for row in _numbers(element, "outline")
    ] or [circle(THIN * sum(beam.lengths))]
    return BeamShape(beam.name, outlines[0], outlines[-1], attribute(element, "colour").lower())
