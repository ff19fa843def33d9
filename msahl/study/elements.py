"""The error in space of the beams of a deck: runs with more and more elements, at one step size.

    u_n - u = c n^-q        q from the last three runs, c from the last two

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

from msahl.deck.source import Source
from msahl.model import Model, Options
from msahl.model.settings import OFF
from msahl.results.read import ResultError
from msahl.run import loop
from msahl.run.report import COMPLETED, INTERRUPTED
from msahl.run.tables import STATES, MemorySink
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
        model = prepared(Source(source.path, _refined(text, source, factor)).model(()))
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


def _refined(text: bytes, source: Source, factor: int) -> bytes:
    """Return a deck in plain numbers with ``factor`` times the elements of each beam."""
    if factor == 1:
        return text
    beams = Source(source.path, text).model(()).beams
    root = etree.fromstring(text)
    numbers = {beam.name: len(beam.lengths) for beam in beams}
    for element in root.iterfind("system/bodies/beam"):
        name = " ".join((element.findtext("name") or "").split())
        place = element.find("elements")
        if place is None:
            place = etree.SubElement(element, "elements")
        place.text = str(factor * numbers[name])
    return etree.tostring(root)


def _positions(model: Model) -> dict[tuple[str, float], np.ndarray]:
    """Run a model; return the positions (times, 3) of bodies by name and, of nodes where elements
    end, by the name of the beam and the share of its arc length."""
    sink = MemorySink(only=(STATES,))
    report = loop.run(model, Options(error=OFF), sink, checked=True)
    if report.status == INTERRUPTED:
        raise KeyboardInterrupt(report.message)
    if report.status != COMPLETED:
        raise ResultError(f"a run of the study failed: {report.message}")
    states = sink.table(STATES)[:, 1:].reshape(-1, len(model.bodies), len(STATE_COLUMNS))
    number = {body.name: index for index, body in enumerate(model.bodies)}
    found = {}
    for beam in model.beams:
        for k in range(0, len(beam.nodes), beam.degree):
            share = round(beam.stations[k] / beam.stations[-1] / SAME) * SAME
            found[beam.name, share] = states[:, number[beam.nodes[k]], :3]
        for name in beam.nodes:
            del number[name]
    return found | {(name, -1.0): states[:, index, :3] for name, index in number.items()}
