"""Takes the steps of a run once more, from a model with any numbers; keeps rows and events."""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.analysis.gradients.start import NotDifferentiable, not_unique
from msahl.analysis.gradients.step_sequence import Step
from msahl.model import Model, RunSettings
from msahl.run.companion import advance, with_given_steps
from msahl.run.contacts import events_of
from msahl.run.observed import ObservedTables
from msahl.run.output import TableAssembly
from msahl.run.setup import build_integrators
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import REACTIONS
from msahl.schemes.output_schedule import OutputSchedule
from msahl.system.diagnostics import STOP

MOST_TOGETHER = 500
"""Most steps that are taken at once; an even number, as halves of a step stay together."""
PIECES = 16
"""Number of pieces of a run at whose ends positions are kept, if it has as many pairs of steps."""
UNSOLVED = "the step from t = {:g} s cannot be solved for values near it: {}"

Happened = tuple[tuple[str, str, str], ...]
"""Kinds, elements and events of what happened in one subsystem, in order."""


class Along(NamedTuple):
    """Steps to take, the output times [s] of all rows by their numbers, and the tables to keep."""

    steps: Sequence[Step]
    times: Mapping[int, float]
    tables: Sequence[str]
    halved: bool = False  # whether two steps each are the halves of one of the run


class Trace(NamedTuple):
    """What a model did in given steps."""

    rows: dict[str, np.ndarray]  # (m, columns) by table
    places: np.ndarray  # (pieces, 2, f, 3) positions [m] and orientations of all frames
    happened: tuple[Happened, ...]  # by subsystem
    at: tuple[np.ndarray, ...]  # their times [s]
    margin: float  # of the conditions that stop a run, at the end
    length: float  # largest of a frame [m]
    not_unique: frozenset[str]  # columns of reactions


def trace(model: Model, settings: RunSettings, along: Along) -> Trace:
    """Take the steps ``along`` from t = 0 of a ``model``.

    Raises ``NotDifferentiable`` if one cannot be solved, and ``StartError`` if there is no start.
    """
    pieces = [*_pieces(along.steps)]
    capacity = max(max(len(piece), sum(len(step.rows) for step in piece)) for piece in pieces)
    parts = _build(model, settings, capacity)
    rows, places = _Rows(model, parts, along, settings), []
    for piece in pieces:
        for part in parts:
            _take(part, piece, rows.schedule(piece))
        rows.add(piece)
        states = [part.workspace.state for part in parts]
        places.append(np.hstack([np.stack([state.x, state.p]) for state in states]))
    events = [events_of([part]) for part in parts]
    last, systems = len(pieces[-1]) - 1, [part.workspace.system for part in parts]
    found = Trace(
        {name: np.concatenate(tables) for name, tables in rows.tables.items()},
        np.array(places),
        tuple(tuple((e.kind, e.element, e.event) for e in found) for found in events),
        tuple(np.array([e.time for e in found]) for found in events),
        max(float(part.workspace.monitor.rows[last, STOP]) for part in parts),
        max(float(system.frames.length[:-1].max(initial=1e-300)) for system in systems),
        frozenset(name for part in parts for name in not_unique(part)),
    )
    for part in parts:
        part.release(0.0)
    return found


def _build(model: Model, settings: RunSettings, capacity: int) -> list[SubsystemIntegrator]:
    """Return the subsystems of a model at t = 0 with arrays for so many rows; none ends the run."""
    parts = build_integrators(with_given_steps(model, settings), settings, capacity)
    for part in parts:
        part.stepper.arm(math.inf)
        part.show_start()
    return parts


def _pieces(steps: Sequence[Step]) -> Iterator[list[Step]]:
    """Yield successive steps of one size and degree, an even number but for the last ones."""
    most = min(MOST_TOGETHER, max(2, 2 * (len(steps) // (2 * PIECES))))
    piece: list[Step] = []
    for step in steps:
        alike = piece and (step.size, step.degree) == (piece[0].size, piece[0].degree)
        if piece and (not alike or len(piece) == most):
            yield piece
            piece = []
        piece.append(step)
    yield piece


def _take(part: SubsystemIntegrator, piece: Sequence[Step], schedule: OutputSchedule) -> None:
    """Take the steps of a ``piece``; raise ``NotDifferentiable`` if that is not possible."""
    stepper: Any = part.stepper
    if piece[0].degree and stepper.method.degree != piece[0].degree:
        stepper.method.set_degree(piece[0].degree)
    if not advance(part, np.array([step.size for step in piece]), schedule):
        t = float(part.workspace.state.time[0])
        raise NotDifferentiable(UNSOLVED.format(t, stepper.trouble or "it does not converge"))


class _Rows:
    """Collects the rows of ``tables`` from all subsystems, in the order of time."""

    def __init__(
        self, model: Model, parts: list[SubsystemIntegrator], along: Along, settings: RunSettings
    ) -> None:
        self.assembly, self.observed = TableAssembly(model, parts), ObservedTables(model)
        self.along = along
        # Reactions that are means over a step are those over its halves, of which each has a row.
        self.means = along.halved and settings.degree == 0 and not settings.instantaneous
        self.tables: dict[str, list[np.ndarray]] = {}
        at_start = self.assembly.rows(np.zeros(1))
        at_start |= self.observed.rows(at_start)
        if 0 in along.times:
            self._keep(at_start)

    def schedule(self, piece: Sequence[Step]) -> OutputSchedule:
        """Return which rows the steps of a ``piece`` fill."""
        if self.means:
            return OutputSchedule.at_ends(np.ones(len(piece), dtype=bool))
        due = np.cumsum([0, *(len(step.rows) for step in piece)])
        return OutputSchedule(due, np.array([s for step in piece for s in step.shares]))

    def add(self, piece: Sequence[Step]) -> None:
        """Add the rows that a ``piece`` has filled."""
        times = np.array([self.along.times[row] for step in piece for row in step.rows])
        if not times.size:
            return
        tables = self._of_halves(piece, times) if self.means else self.assembly.rows(times)
        tables |= self.observed.rows(tables)
        self._keep(tables)

    def _of_halves(self, piece: Sequence[Step], times: np.ndarray) -> dict[str, np.ndarray]:
        tables = self.assembly.rows(np.zeros(len(piece)))
        shown = np.array([k for k, step in enumerate(piece) if step.rows])
        kept = {name: table[shown] for name, table in tables.items()}
        if REACTIONS in kept:
            kept[REACTIONS] = 0.5 * (tables[REACTIONS][shown - 1] + kept[REACTIONS])
        for table in kept.values():
            table[:, 0] = times
        return kept

    def _keep(self, tables: dict[str, np.ndarray]) -> None:
        for name in self.along.tables:
            self.tables.setdefault(name, []).append(tables[name])
