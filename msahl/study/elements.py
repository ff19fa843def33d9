"""The error in space of the beams of a deck: runs with more and more elements, at one step size.

    u_n - u = c n^-q        q from the last three runs, c from the last two

Of an equilibrium q = 2 p of elements of degree p, so twice the elements suffice.

The same step size is in all runs, so that its error, which is nearly the same, is not counted. The
motion is compared where all runs have nodes: at the ends of the beams and at the places that the
deck names; and at all other bodies.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from lxml import etree

from msahl.analysis.equilibria.begin import deck_at
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.tables import state_row
from msahl.analysis.linearised.point import Point
from msahl.deck.source import Source
from msahl.model import Model, Options
from msahl.model.settings import EQUILIBRIUM, OFF
from msahl.results.read import ResultError
from msahl.run import loop
from msahl.run.report import COMPLETED, INTERRUPTED
from msahl.run.tables import STATES, MemorySink
from msahl.start.velocities import StartError
from msahl.system.names import STATE_COLUMNS

FACTORS = (1, 2, 4)
"""Numbers of elements, relative to the deck's."""
SAME = 1e-9
"""Distance of two places, relative to the length of a beam, that counts as zero."""


@dataclass(frozen=True)
class SpaceError:
    """Numbers of ``elements`` of all beams together in each run, the largest ``changes`` of a
    position from each run to the next [m], their ``order``, and the ``error`` [m] of the run with
    the deck's own elements; NaN where the changes do not fall."""

    elements: tuple[int, ...]
    changes: tuple[float, ...]
    order: float
    error: float

    def lines(self) -> list[str]:
        """Return the result in words."""
        steps = zip(self.elements, self.elements[1:], self.changes, strict=False)
        found = [f"{a} -> {b} elements: positions change by at most {d:.2e} m" for a, b, d in steps]
        if math.isnan(self.error):
            return [*found, "the changes do not fall: the error in space is not known"]
        order = f"order {self.order:.1f}"
        return [
            *found,
            f"error in space of {self.elements[0]} elements: {self.error:.1e} m, {order}",
        ]


def space_error(
    source: Source,
    settings: Sequence[str],
    prepared: Callable[[Model], Model],
    progress: Callable[[str], Any],
) -> SpaceError:
    """Return the error in space of a deck; ``prepared`` changes each model before its run.

    Raises ``ResultError`` if the deck has no beams or a run does not end.
    """
    text = source.text({}, settings)
    found, counts = [], []
    for factor in FACTORS:
        model = prepared(_model(source, _refined(text, source, factor)))
        if not model.beams:
            raise ResultError(f"{source.path}: the deck has no beams, whose elements --over varies")
        counts.append(sum(len(beam.lengths) for beam in model.beams))
        progress(f"{counts[-1]} elements")
        found.append(_positions(model))
    common = [key for key in found[0] if all(key in other for other in found)]
    changes = [
        max(float(np.abs(a[key] - b[key]).max()) for key in common)
        for a, b in itertools.pairwise(found)
    ]
    first, second = changes
    if not 0.0 < second < first:
        exact = first == 0.0
        return SpaceError(tuple(counts), (first, second), math.nan, 0.0 if exact else math.nan)
    ratio = first / second
    return SpaceError(
        tuple(counts), (first, second), math.log2(ratio), first * ratio / (ratio - 1.0)
    )


def _model(source: Source, text: bytes) -> Model:
    """Return the model of the deck ``text``, at its equilibrium if it begins there."""
    model = Source(source.path, text).model(())
    if model.simulation.start != EQUILIBRIUM:
        return model
    start = search_start(model)
    found = find(start, np.zeros(3))
    if found is None:
        raise ResultError("no equilibrium was found at which the run begins")
    return Source(source.path, deck_at(text, source.path, start, found)).model(())


def equilibrium_error(source: Source, text: bytes, found: Point, rotation: np.ndarray) -> float:
    """Return the error in space [m] of an equilibrium ``found`` of the deck ``text`` in plain
    numbers, in a steady ``rotation`` (3,) [rad/s]: the largest of a position at the ends of beams,
    at places that the deck names, and of other bodies.

    Raises ``ResultError`` if there is none with twice the elements, or the deck names nodes by
    numbers.
    """
    model = Source(source.path, _refined(text, source, 2, begin=False)).model(())
    try:
        finer = find(search_start(model), rotation)
    except StartError as error:
        raise ResultError(str(error)) from error
    if finer is None:
        raise ResultError("no equilibrium was found with twice the elements")
    places = [_by_name(point.model, state_row(point)[None]) for point in (found, finer.place.point)]
    common = [key for key in places[0] if key in places[1]]
    change = max(float(np.abs(places[0][key] - places[1][key]).max()) for key in common)
    ratio = 2.0 ** (2 * min(beam.degree for beam in found.model.beams))
    return change * ratio / (ratio - 1.0)


def _refined(text: bytes, source: Source, factor: int, begin: bool = True) -> bytes:
    """Return a deck in plain numbers with ``factor`` times the elements of each beam, which keeps
    where its nodes ``begin``, or not.

    Raises ``ResultError`` where the deck names a node by its number, which would be another place.
    """
    if factor == 1:
        return text
    beams = Source(source.path, text).model(()).beams
    root = etree.fromstring(text)
    _check_nodes(root, [beam.name for beam in beams])
    numbers = {beam.name: len(beam.lengths) for beam in beams}
    for element in root.iterfind("system/bodies/beam"):
        name = " ".join((element.findtext("name") or "").split())
        place = element.find("elements")
        if place is None:
            place = etree.SubElement(element, "elements")
        place.text = str(factor * numbers[name])
        for nodes in [] if begin else element.findall("nodes"):
            element.remove(nodes)
    return etree.tostring(root)


def _check_nodes(root: Any, beams: Sequence[str]) -> None:
    """Raise ``ResultError`` where a deck names a node of ``beams`` by a number but the first."""
    for element in root.iter(etree.Element):
        beam, _, node = (element.text or "").strip().rpartition(".")
        node = element.get("node", node if beam in beams else "")
        if node.isdigit() and node != "1":
            raise ResultError(
                f"line {element.sourceline} names node {node} of a beam, which is another place "
                'with more elements; name it by its station, such as station="0.25"'
            )


def _positions(model: Model) -> dict[tuple[str, float], np.ndarray]:
    """Run a model; return the positions (times, 3) of bodies by name and, of nodes where elements
    end, by the name of the beam and the share of its arc length."""
    sink = MemorySink(only=(STATES,))
    report = loop.run(model, Options(error=OFF), sink, checked=True)
    if report.status == INTERRUPTED:
        raise KeyboardInterrupt(report.message)
    if report.status != COMPLETED:
        raise ResultError(f"a run of the study failed: {report.message}")
    return _by_name(model, sink.table(STATES)[:, 1:])


def _by_name(model: Model, rows: np.ndarray) -> dict[tuple[str, float], np.ndarray]:
    """Positions (times, 3) in ``rows`` of states (times, ...), by name and share."""
    states = rows.reshape(-1, len(model.bodies), len(STATE_COLUMNS))
    number = {body.name: index for index, body in enumerate(model.bodies)}
    found = {}
    for beam in model.beams:
        for k in range(0, len(beam.nodes), beam.degree):
            share = round(beam.stations[k] / beam.stations[-1] / SAME) * SAME
            found[beam.name, share] = states[:, number[beam.nodes[k]], :3]
        for name in beam.nodes:
            del number[name]
    return found | {(name, -1.0): states[:, index, :3] for name, index in number.items()}
