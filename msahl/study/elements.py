"""The error in space of the beams of a deck: runs with more and more elements, at one step size.

    u_n - u = c n^-q        q from the last three runs, c from the last two

The same step size is in all runs, so that its error, which is nearly the same, is not counted. The
motion is compared where all runs have nodes: at the ends of the beams and at the places that the
deck names; and at all other bodies.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from msahl.analysis.equilibria.begin import beginning
from msahl.deck.finer_beams import RefinementError, more_elements
from msahl.deck.source import Source
from msahl.model import Model, Options
from msahl.model.settings import OFF
from msahl.records import record
from msahl.results.job import make_job
from msahl.results.read import ResultError
from msahl.run import loop
from msahl.run.report import COMPLETED, INTERRUPTED
from msahl.run.tables import STATES, MemorySink
from msahl.study.more_elements import by_name

FACTORS = (1, 2, 4)
"""Numbers of elements, relative to the deck's."""


@record(slots=False)
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

    Raises ``ResultError`` if the deck has no beams or a run does not end, ``StartError`` if there
    is no equilibrium at which it begins.
    """
    text = source.text({}, settings)
    found, counts = [], []
    for factor in FACTORS:
        try:
            deck = Source(source.path, more_elements(text, source, factor))
            model = prepared(beginning(make_job(deck, deck.model(()), {})).model)
        except RefinementError as error:
            raise ResultError(f"{source.path}: {error}") from error
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


def _positions(model: Model) -> dict[tuple[str, float], np.ndarray]:
    """Run a model; return the positions (times, 3) of bodies by name and, of nodes where elements
    end, by the name of the beam and the share of its arc length."""
    sink = MemorySink(only=(STATES,))
    report = loop.run(model, Options(error=OFF), sink, checked=True)
    if report.status == INTERRUPTED:
        raise KeyboardInterrupt(report.message)
    if report.status != COMPLETED:
        raise ResultError(f"a run of the study failed: {report.message}")
    return by_name(model, sink.table(STATES)[:, 1:])
