"""Inverse dynamics: the drive loads of a given motion as an object, with the tables of a run."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.analysis.inverse.columns import in_si
from msahl.analysis.inverse.drives import InverseError
from msahl.analysis.inverse.load_lines import lines
from msahl.analysis.inverse.run_error import run_error
from msahl.analysis.inverse.run_tables import about, drive_columns, drive_rows, report, tables
from msahl.analysis.inverse.solution import Solution, compared, inverse, with_run_error
from msahl.analysis.inverse.table import GivenMotion, motion_of_table, read_motion
from msahl.analysis.inverse.verdict import verdict
from msahl.api.result import Result
from msahl.model import Model
from msahl.records import record
from msahl.results.job import Job, make_job
from msahl.results.write import DRIVES, file_name, write_table
from msahl.run.hidden_bodies import without_hidden
from msahl.run.options import OptionError, recorded_options
from msahl.run.tables import ACCELERATIONS, STATES

if TYPE_CHECKING:
    import pandas as pd

EVEN = 1e-9
"""Difference of steps between rows, relative to them, of rows at equal distances."""


class InverseResult(Result):
    """The loads of a given motion, with states, reactions and the other tables of a run.

    ``drives`` is the table of loads; ``solution`` has all that was found, ``lines`` what
    ``msahl inverse`` prints.
    """

    def __init__(self, job: Job, solution: Solution, seconds: float) -> None:
        found = verdict(solution)
        figures = {
            "options": recorded_options(job.settings),
            **report(solution, found, seconds).as_json(),
            "inverse": about(solution),
        }
        shown = without_hidden(job.model, tables(solution, job.model))
        super().__init__(job.model, figures, shown, job)
        self.solution, self._verdict = solution, found

    @property
    def drives(self) -> "pd.DataFrame":
        """Loads of the drives with error bars, power and work: NAME.load, NAME.error, ..."""
        import pandas as pd

        return pd.DataFrame(drive_rows(self.solution), columns=drive_columns(self.solution))

    @property
    def unique(self) -> dict[str, bool]:
        """Whether the load of each drive is unique."""
        drives = self.solution.drives
        return {d.name: bool(own) for d, own in zip(drives, self.solution.unique, strict=True)}

    @property
    def lines(self) -> list[str]:
        """The report in words."""
        return lines(self.solution, self._verdict)

    def write(self, folder: str | PathLike[str]) -> Path:
        """Write the files of a run, and ``drives.csv``; return the folder."""
        written = super().write(folder)
        write_table(
            written / file_name(DRIVES), drive_columns(self.solution), drive_rows(self.solution)
        )
        return written


@record
class Wanted:
    """What is asked of an inverse problem: motions are paths, results, pandas frames or columns by
    name.
    """

    motion: Any
    loads: Sequence[str] = ()
    weights: Mapping[str, float] = field(default_factory=dict)
    smooth: float = 0.0
    companion: Any = None
    columns: Mapping[str, str] = field(default_factory=dict)  # {"q1": "Shaft.angle:deg"}


def loads_of(
    job: Job, wanted: Wanted, progress: Callable[[float, str], Any] = lambda part, words: None
) -> InverseResult:
    """Return the loads of the motion of the model that a ``job`` would run; ``progress`` receives
    the part of the table that is done, and words. Raises ``InverseError``, ``StartError`` or
    ``ResultError``.
    """
    began, model = time.perf_counter(), job.model
    names = ("motion",) if wanted.companion is None else ("motion", "companion")
    given = [read(getattr(wanted, name), model, name, wanted.columns) for name in names]
    sizes = [each.time.size for each in given]

    def solved(motion: GivenMotion, before: int) -> Solution:
        def show(row: int) -> None:
            done, number = before + row, sum(sizes)
            progress(done / number, f"{done} of {number} rows")

        return inverse(model, motion, wanted.loads, wanted.weights, wanted.smooth, show)

    solution = solved(given[0], 0)
    if wanted.companion is None:
        solution = with_run_error(solution)
    else:
        solution = compared(solution, solved(given[1], sizes[0]))
    return InverseResult(_job(job, given[0]), solution, time.perf_counter() - began)


def read(motion: Any, model: Model, name: str, mapping: Mapping[str, str]) -> GivenMotion:
    """Return the motion in a file, folder, result or table, with the ``mapping`` of columns."""
    if isinstance(motion, str | PathLike):
        return read_motion(Path(fspath(motion)), model, mapping)
    if isinstance(motion, Result):
        columns, parts = motion.columns(STATES), [motion.array(STATES)]
        if ACCELERATIONS in motion.tables:
            columns = [*columns, *motion.columns(ACCELERATIONS)[1:]]
            parts.append(motion.array(ACCELERATIONS)[:, 1:])
        given = motion_of_table(columns, np.concatenate(parts, axis=1), model, name)
        return replace(given, error=run_error(motion.report))
    try:
        columns = [str(column) for column in motion]
        numbers = np.array([motion[column] for column in motion], dtype=float).T
    except (TypeError, ValueError, IndexError, KeyError, OverflowError):
        numbers = np.zeros(0)
    if numbers.ndim != 2:
        raise InverseError(
            f"{name}: give the path of a table, a result, a pandas frame, or columns of as many "
            "numbers by name"
        )
    return motion_of_table(*in_si(columns, numbers, mapping, name), model, name)


def _job(job: Job, motion: GivenMotion) -> Job:
    """Return the job that has the times of the table, as far as a deck can have them."""
    times = motion.time
    steps = np.diff(times)
    h = float(times[-1]) / steps.size
    changes: dict[str, Any] = {
        "t_final": float(times[-1]),
        "reactions": "instantaneous",
        "accelerations": "yes",
    }
    try:
        given = {**job.given, **changes}
        if np.all(np.abs(steps - h) <= EVEN * times[-1]):
            given |= {"dt": h, "output_interval": h}
        return make_job(job.source, job.model, given, job.changed)
    except OptionError:
        return make_job(job.source, job.model, {**job.given, **changes}, job.changed)
