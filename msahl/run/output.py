"""Output of a run: which rows a chunk of steps has to fill, and the tables that go to the sink."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from msahl.model import Model
from msahl.records import record
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import COLUMNS, column_counts
from msahl.run.time_grid import TimeGrid
from msahl.schemes.output_schedule import OutputSchedule

MAX_CHUNK = 4096
"""Most rows of a chunk, unless a single step has more."""
Columns = slice | list[int]
ALL = slice(1, None)
"""The columns of all subsystems together, without the time."""
CHUNK_NUMBERS = 2_000_000
"""Most numbers published at once: bounds the memory whatever the model and the run."""


@record(slots=False)
class OutputTimes:
    """The output times of a run: every ``every``-th of the grid ``shown``, and the last one.

    A ``chunk`` is the largest number of rows that a chunk of steps of ``grid`` may fill.
    """

    grid: TimeGrid
    shown: TimeGrid
    every: int
    chunk: int

    @classmethod
    def of(cls, model: Model, every: int, widths: Mapping[str, int]) -> "OutputTimes":
        """The output times of the ``model``'s run, with the ``widths`` of its tables."""
        grid, shown = TimeGrid.of_steps(model.simulation), TimeGrid.of_output(model.simulation)
        numbers = sum(widths.values())
        of_step = math.ceil(grid.h / shown.h) + 1
        rows = max(grid.n, shown.n) + 1
        chunk = max(of_step, min(MAX_CHUNK, rows, CHUNK_NUMBERS // numbers))
        return cls(grid, shown, every, chunk)

    def until(self, t: float, least: int = 1) -> "OutputTimes":
        """Return those of a run that ends at ``t`` [s], after ``least`` steps or more."""
        return replace(self, grid=self.grid.until(t, least), shown=self.shown.until(t))

    @property
    def total(self) -> int:
        """Number of output times of the complete run."""
        return 1 + math.ceil(self.shown.n / self.every)

    def of_steps(self, first: int, steps: int) -> tuple[OutputSchedule, np.ndarray]:
        """Rows of the ``steps`` equal steps after step ``first``, as many as a chunk may have, and
        their times.
        """
        grid, shown, every = self.grid, self.shown, self.every
        ends = np.arange(first + 1, first + steps + 1)
        if shown == grid:
            schedule = OutputSchedule.at_ends((ends % every == 0) | (ends == grid.n))
            rows = ends[np.diff(schedule.due) > 0]
        else:
            last = shown.count(grid.time(first + steps))
            rows = np.arange(shown.count(grid.time(first)) + 1, last + 1)
            rows = rows[(rows % every == 0) | (rows == shown.n)]
            # By the steps' own times, as the clock decides where chunks begin.
            schedule = OutputSchedule.passed(shown.times(rows), grid.time(first), grid.times(ends))
            fitting = int(np.searchsorted(schedule.due, self.chunk, "right")) - 1
            schedule = schedule.until(max(1, fitting))
        return schedule, shown.times(rows[: schedule.due[-1]])

    def after(self, written: int) -> np.ndarray:
        """Output times that follow the first ``written`` ones, up to the end of a chunk.

        Chunks are counted from the first row, so that the last time, which no adaptive step
        exceeds, does not depend on the clock.
        """
        last = -(-written // self.chunk) * self.chunk
        rows = np.minimum(np.arange(written, last + 1) * self.every, self.shown.n)
        return self.shown.times(rows[: 1 + int(np.searchsorted(rows, self.shown.n))])


class TableAssembly:
    """Combines the rows of all subsystems into the tables of the complete ``model``."""

    def __init__(
        self,
        model: Model,
        integrators: Sequence[SubsystemIntegrator],
        widths: Mapping[str, int] | None = None,
    ) -> None:
        self.integrators = integrators
        self.widths = column_counts(model) if widths is None else widths
        self.places: list[dict[str, Columns]] = [dict.fromkeys(COLUMNS, ALL)]
        if len(integrators) > 1:
            columns = {name: columns_of(model) for name, columns_of in COLUMNS.items()}
            place = {name: {c: i for i, c in enumerate(heads)} for name, heads in columns.items()}
            self.places = [_places(part.model, place) for part in integrators]

    @property
    def width(self) -> int:
        """Numbers of one row of all tables."""
        return sum(self.widths.values())

    def rows(self, times: np.ndarray) -> dict[str, np.ndarray]:
        """The first rows of the present chunk, at these ``times``, by table."""
        tables = {n: np.zeros((times.size, width)) for n, width in self.widths.items() if width}
        for table in tables.values():
            table[:, 0] = times
        for integrator, places in zip(self.integrators, self.places, strict=True):
            of_subsystem = tables_of(integrator)
            for name, table in tables.items():
                part = of_subsystem[name]
                # The energy taken by a dissipative scheme is one column for all subsystems.
                table[:, places[name]] += part[: times.size]
        return tables


def _places(part: Model, place: dict[str, dict[str, int]]) -> dict[str, Columns]:
    """By table, where the columns of a subsystem stand, from the ``place`` of each by its name."""
    return {name: [place[name][c] for c in COLUMNS[name](part)[1:]] for name in COLUMNS}


def tables_of(integrator: SubsystemIntegrator) -> dict[str, np.ndarray]:
    """The arrays that the steps of a subsystem fill, by table, without the time."""
    return integrator.workspace.tables._asdict()
