"""Derivatives of a run's tables by parameters, at output times.

The tables that the steppers fill come from the tangents of the steps (``run``). Those that
follow from the motion of bodies are differenced: along the derivatives of the former, and by models
with other values of the parameter.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from msahl.analysis.gradients.run import TangentRun
from msahl.analysis.gradients.start import (
    NotDifferentiable,
    Shape,
    Start,
    Variation,
    build_parts,
    not_unique,
    relative_change,
    start_of,
    starts_of,
    variations,
)
from msahl.analysis.gradients.step_sequence import Step
from msahl.joints.coordinates import is_angle
from msahl.model import Model, RunSettings
from msahl.records import record
from msahl.run.observed import ObservedTables
from msahl.run.output import TableAssembly
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import JOINTS, OBSERVED, STATES, tables_of_model
from msahl.schemes.common.tangents import SHARE
from msahl.start.velocities import StartError

CENTRAL = ((-2.0, 1.0 / 12.0), (-1.0, -8.0 / 12.0), (1.0, 8.0 / 12.0), (2.0, -1.0 / 12.0))
"""Shifts and weights of the central difference of order 4, along the derivatives of rows."""
TOO_NEAR, FAR_ENOUGH, MOST_WIDENED = 1e-7, 1e-5, 1e5
"""Change of numbers and states, relative to the largest of them, below which rounding errors count;
the change wanted then; and the most that neighbours are moved away for it."""
STATE_SIZE = 12
REVOLUTION = 2.0 * np.pi


@record(slots=False)
class Neighbours:
    """Models with other values of a parameter, each with its weight in the derivative, and the
    ``size`` of its value (0 if that is 0). ``wider`` returns those that are so many times farther
    away, if there are any."""

    models: Sequence[tuple[Model, float]]
    size: float
    wider: Callable[[float], "Neighbours"] | None = None


@dataclass
class TableGradients:
    """Rows of tables (m, columns) by name, and their derivatives (n, m, columns) by parameters.

    ``end`` (n,) are the derivatives of the end of the run [s]; ``sizes`` (steps, n) the largest
    change of a position, over the longest length of a frame, or of an orientation [rad]; ``left``
    (n,) the largest relative correction that was left in a step; ``not_unique`` the columns of
    reactions that redundant joints leave undetermined; ``jumped`` the time [s] until which the
    derivatives follow the jumps of expressions, ``jumping`` what has the one that jumps then;
    ``at_events`` (k,) output times [s] that an event does not leave on one side of it, whose
    derivatives are nan.
    """

    rows: dict[str, np.ndarray] = field(default_factory=dict)
    slopes: dict[str, np.ndarray] = field(default_factory=dict)
    end: np.ndarray = field(default_factory=lambda: np.zeros(0))
    sizes: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    left: np.ndarray = field(default_factory=lambda: np.zeros(0))
    not_unique: frozenset[str] = frozenset()
    jumped: float = np.inf
    jumping: str = ""
    at_events: np.ndarray = field(default_factory=lambda: np.zeros(0))


@record(slots=False)
class TangentModel:
    """A model with its parameters' neighbours, ready to be differentiated along any steps."""

    model: Model
    settings: RunSettings
    neighbours: Sequence[Neighbours]
    _variations: dict[Any, list[list[Variation]]] = field(default_factory=dict)
    # Of each parameter and subsystem, by the degrees of the steps; they are the same for all steps.

    def along(
        self, steps: Sequence[Step], times: Mapping[int, float], tables: Sequence[str], free: bool
    ) -> TableGradients:
        """Take the ``steps``; return the ``tables`` at the output times ``times`` [s], by the
        numbers that these have in the tables. Where the end of the run is ``free``, it moves with
        the condition that stops the run.

        Raises ``NotDifferentiable``.
        """
        with np.errstate(all="ignore"):
            shape = self._shape(steps)
            try:
                try:
                    return self._along(shape, steps, times, tables, free)
                except NotDifferentiable:
                    if shape.full:
                        raise
                    # A parameter may take bodies out of their plane, or join subsystems.
                    shape = shape._replace(full=True)
                    return self._along(shape, steps, times, tables, free)
            except (StartError, np.linalg.LinAlgError) as error:
                raise NotDifferentiable(f"near the values of the parameters, {error}") from error

    def _shape(self, steps: Sequence[Step]) -> Shape:
        rows = max((len(step.rows) for step in steps), default=1)
        degrees = tuple(sorted({step.degree for step in steps} - {0}))
        return Shape(self.settings, rows, degrees, self.settings.full)

    def _along(
        self,
        shape: Shape,
        steps: Sequence[Step],
        times: Mapping[int, float],
        tables: Sequence[str],
        free: bool,
    ) -> TableGradients:
        parts = build_parts(self.model, shape)
        key = shape.degrees, shape.full
        if key not in self._variations:
            starts = [start_of(part) for part in parts]
            self._variations[key] = [
                _variations(parts, starts, neighbours, shape) for neighbours in self.neighbours
            ]
        of_parts = self._variations[key]
        runs = [
            TangentRun(part, [part_of_run[k] for part_of_run in of_parts], shape, free)
            for k, part in enumerate(parts)
        ]
        found = _Assembly(TableAssembly(self.model, parts), len(runs[0].slope), times, tables)
        if 0 in found.place:
            for k, run in enumerate(runs):
                found.enter_start(k, run, [part_of_run[k].rows for part_of_run in of_parts])
        for k, run in enumerate(runs):
            for step, _, _ in run.steps(steps):
                found.enter(k, run, step)
        for part in parts:
            part.release(0.0)
        gradients = found.gradients(runs, free)
        first = min(runs, key=lambda run: run.jumped)
        gradients.jumped, gradients.jumping = first.jumped, first.jumping
        gradients.not_unique = frozenset(name for part in parts for name in not_unique(part))
        self._add_observed(gradients, tables, max(run.length for run in runs))
        return gradients

    def _add_observed(self, found: TableGradients, tables: Sequence[str], length: float) -> None:
        """Add those of the ``tables`` that follow from the motion of bodies."""
        if not set(tables) & set(OBSERVED):
            return
        base = ObservedTables(self.model).rows(found.rows)
        angles = angle_columns(self.model)
        slopes = {name: np.zeros((len(found.end), *rows.shape)) for name, rows in base.items()}

        def add(name: str, rows: np.ndarray, weight: np.ndarray, j: int) -> None:
            slopes[name][j] += weight * change_of(name, rows, base[name], angles)

        for j, neighbours in enumerate(self.neighbours):
            e = _shift_of_rows(found.slopes[STATES][j], length)
            for node, weight in CENTRAL:
                moved = {
                    name: rows + node * e * found.slopes[name][j]
                    for name, rows in found.rows.items()
                }
                for name, rows in ObservedTables(self.model).rows(moved).items():
                    add(name, rows, weight / e, j)
            for model, share in neighbours.models:
                for name, rows in ObservedTables(model).rows(found.rows).items():
                    add(name, rows, np.full((1, 1), share), j)
        found.rows |= base
        found.slopes |= slopes


def _variations(
    parts: Sequence[SubsystemIntegrator],
    starts: Sequence[Start],
    neighbours: Neighbours,
    shape: Shape,
) -> list[Variation]:
    """Return the derivatives of all ``parts`` at t = 0 by one parameter; where the neighbours are
    so near that rounding errors count, by others.
    """
    others = [(starts_of(model, shape), weight) for model, weight in neighbours.models]
    pairs = [(a, b) for of_model, _ in others for a, b in zip(starts, of_model, strict=False)]
    change = max((relative_change(a, b) for a, b in pairs if a.kind == b.kind), default=0.0)
    if neighbours.wider and 0.0 < change < TOO_NEAR:
        wider = neighbours.wider(min(FAR_ENOUGH / change, MOST_WIDENED))
        others = [(starts_of(model, shape), weight) for model, weight in wider.models]
    return variations(parts, starts, others, neighbours.size)


class _Assembly:
    """Rows and derivatives of all subsystems, in the tables of the complete model."""

    def __init__(
        self, assembly: TableAssembly, n: int, times: Mapping[int, float], tables: Sequence[str]
    ) -> None:
        """``n`` is the number of derivatives; only the ``tables``, and what they follow from, are
        kept.
        """
        kept = {*tables, *(assembly.widths if set(tables) & set(OBSERVED) else ())}
        self.places, self.place = assembly.places, {row: i for i, row in enumerate(times)}
        m, widths = len(times), {k: w for k, w in assembly.widths.items() if w and k in kept}
        self.rows = {name: np.zeros((m, width)) for name, width in widths.items()}
        self.slopes = {name: np.zeros((n, m, width)) for name, width in widths.items()}
        for table in self.rows.values():
            table[:, 0] = list(times.values())

    def enter(self, part: int, run: TangentRun, step: Step) -> None:
        """Enter the rows of a step of a subsystem."""
        slopes = run.table_slopes(len(step.rows))
        for name, table in run.workspace.tables._asdict().items():
            if name not in self.rows:
                continue
            place = self.places[part][name]
            for k, row in enumerate(step.rows):
                i = self.place[row]
                self.rows[name][i, place] += table[k]
                self.slopes[name][:, i][:, place] += slopes[name][:, k]

    def enter_start(self, part: int, run: TangentRun, slopes: Sequence[np.ndarray]) -> None:
        """Enter the row at t = 0, with its derivatives by each parameter."""
        i, first = self.place[0], 0
        for name, table in run.workspace.tables._asdict().items():
            width = table.shape[1]
            if name in self.rows:
                place = self.places[part][name]
                self.rows[name][i, place] += table[0]
                for j, of_row in enumerate(slopes):
                    self.slopes[name][j, i][place] += of_row[first : first + width]
            first += width

    def gradients(self, runs: Sequence[TangentRun], free: bool) -> TableGradients:
        """Return all of it; where the end of the run is ``free``, by the parameters alone."""
        sizes = np.max([run.sizes for run in runs], axis=0)
        left = np.max([run.worst for run in runs], axis=0)
        n = len(left) - free
        found = TableGradients(self.rows, self.slopes, np.zeros(n), sizes[:, :n], left[:n])
        if free:
            last = list(self.place.values())[-1]
            _, by_all = max((run.margin() for run in runs), key=lambda margin: margin[0])
            found.end, found.slopes = with_moved_end(self.slopes, by_all, last)
        return found


def change_of(name: str, rows: np.ndarray, base: np.ndarray, angles: np.ndarray) -> np.ndarray:
    """Return the change (m, columns) of a table, of angles of joints by less than a revolution."""
    change: np.ndarray = rows - base
    if name == JOINTS:
        change[:, angles] -= REVOLUTION * np.round(change[:, angles] / REVOLUTION)
    return change


def with_moved_end(
    slopes: Mapping[str, np.ndarray], margin: np.ndarray, last: int
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Return the derivatives (n,) of the end of a run by n parameters, and those of its tables with
    them, from ``slopes`` (n + 1, m, columns) and those of the ``margin`` (n + 1,) that ends it, of
    which the last are by the end itself. Raises ``NotDifferentiable``.
    """
    if not np.isfinite(margin).all() or margin[-1] == 0.0:
        raise NotDifferentiable("the condition that ends the run does not change with time")
    end, found = -margin[:-1] / margin[-1], {}
    for name, table in slopes.items():
        moved = table[:-1]
        moved[:, last] += end[:, None] * table[-1, last]
        moved[:, last, 0] = end
        found[name] = moved
    return end, found


def angle_columns(model: Model) -> np.ndarray:
    """Return which columns of the table of joints are angles."""
    columns = tables_of_model(model).get(JOINTS, [])
    return np.array([is_angle(name.rpartition(".")[2]) for name in columns], dtype=bool)


def _shift_of_rows(slopes: np.ndarray, length: float) -> np.ndarray:
    """(m, 1) shift of a parameter by which no position changes by more than ``SHARE`` of the
    ``length`` [m], and no orientation by more than that of a radian.
    """
    of_bodies = np.abs(slopes[:, 1:]).reshape(len(slopes), -1, STATE_SIZE)
    x, p = (of_bodies[..., k : k + 3].reshape(len(slopes), -1) for k in (0, 3))
    largest = np.maximum(x.max(axis=1, initial=0.0) / length, p.max(axis=1, initial=0.0))
    return SHARE / np.maximum(largest, 1e-6)[:, None]
