"""Results of a run: tables in memory or read from a folder, what the run found out, pictures."""

from collections.abc import Callable, Mapping
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.api.arguments import Names, require
from msahl.api.html import html_table
from msahl.contact.events import COLUMNS as EVENT_COLUMNS
from msahl.model import Model as Records
from msahl.printable import shown_path
from msahl.results.folder import find
from msahl.results.info import NoColumnError, ResultError
from msahl.results.job import Job
from msahl.results.session import write_run
from msahl.results.write import DECK
from msahl.run.hidden_bodies import shown_tables, without_hidden
from msahl.run.options import path_of, recorded_options
from msahl.run.report import COMPLETED, Report
from msahl.run.tables import (
    ACCELERATIONS,
    AMPLITUDES,
    ERROR,
    EVENTS,
    JOINTS,
    MARKERS,
    REACTIONS,
    SIGNALS,
    STATES,
    SYSTEM,
    WORK,
    MemorySink,
    error_columns,
)
from msahl.run.verdict import describe_verdict

if TYPE_CHECKING:
    import pandas as pd

    from msahl.api.derivatives import Gradients
    from msahl.api.pictures import Pictures
    from msahl.results.read import Run

NOWHERE = Path("result")
"""What messages call results that are in memory."""


class Result:
    """The results of a run: its tables, and the report of ``run.json``.

    ``result["Bob.z"]`` is a column of any table as an array. ``states``, ``reactions`` and the
    other tables are pandas frames with the columns and units of the files of ``msahl run``; they
    share the memory of ``array(name)``. ``records`` are the model that ran, in SI units.
    """

    def __init__(
        self,
        records: Records | None,
        report: dict[str, Any],
        arrays: Mapping[str, np.ndarray],
        origin: Job | Path | Callable[[], Job],
        columns: Mapping[str, list[str]] | None = None,
    ) -> None:
        """``arrays`` are the tables (rows, columns) by name; ``origin`` is the job that was run, a
        function that makes it, or the folder that was read. Without ``records`` those of the job
        are taken when they are needed, and without ``columns`` the names of the records.
        """
        self.report, self._records, self._columns = report, records, columns
        self._arrays, self._made_by = dict(arrays), origin
        self._frames: dict[str, pd.DataFrame] = {}
        self.omitted: tuple[str, ...] = ()
        """Tables of the run that a batch did not keep."""
        self.gradient: Gradients | None = None
        """Derivatives of measures, if the run was asked for them."""

    @cached_property
    def _origin(self) -> Job | Path:
        return self._made_by() if callable(self._made_by) else self._made_by

    @cached_property
    def records(self) -> Records:
        """The model that ran, in SI units."""
        if self._records is not None:
            return self._records
        assert isinstance(self._origin, Job)
        return self._origin.model

    @property
    def status(self) -> str:
        """How the run ended: "completed", or for example "not converged"."""
        return str(self.report.get("status", "killed"))

    @property
    def completed(self) -> bool:
        """Whether the run reached its end."""
        return self.status == COMPLETED

    @property
    def message(self) -> str:
        """Why the run ended early; empty if it completed."""
        return str(self.report.get("message", ""))

    @property
    def verdict(self) -> str:
        """PASS, DONE (the error was not estimated), WARN or FAIL; empty for a killed run."""
        return str(self.report.get("verdict", {}).get("word", ""))

    @property
    def reasons(self) -> list[str]:
        """Why the verdict is not PASS, as sentences."""
        return list(self.report.get("verdict", {}).get("reasons", ()))

    @property
    def error(self) -> float | None:
        """The estimated global error of the positions [m], largest over bodies and output times;
        None if it was not estimated."""
        estimate = self.report.get("error")
        return None if estimate is None else float(estimate["position"])

    @property
    def seconds(self) -> dict[str, float]:
        """The time that each phase of the run took [s], such as "prepare", "loop" and "total"."""
        return dict(self.report.get("seconds", {}))

    @property
    def tables(self) -> tuple[str, ...]:
        """The names of the tables that the run has."""
        return tuple(self._arrays)

    def array(self, table: str) -> np.ndarray:
        """Return a table (rows, columns); its first column is the time [s]."""
        if not isinstance(table, str) or table not in self._arrays:
            raise ResultError(f"the run has no table '{table}'; it has {', '.join(self.tables)}")
        return self._arrays[table]

    def columns(self, table: str) -> list[str]:
        """Return the names of the columns of a table."""
        self.array(table)
        if table == ERROR:
            return error_columns(self.records)
        if table == EVENTS:
            return EVENT_COLUMNS
        return (self._columns or shown_tables(self.records))[table]

    def frame(self, table: str) -> "pd.DataFrame":
        """Return a table as a pandas frame, which shares the memory of ``array(table)``."""
        columns = self.columns(table)
        if table not in self._frames:
            import pandas as pd

            self._frames[table] = pd.DataFrame(self.array(table), columns=columns, copy=False)
        return self._frames[table]

    def __getitem__(self, column: str) -> np.ndarray:
        """Return a column (rows,) of any table by its name, such as "Bob.z"."""
        for table in self.tables:
            names = self.columns(table)
            if column in names:
                return self.array(table)[:, names.index(column)]
        raise NoColumnError(f"no column '{column}'; columns(table) lists those of a table")

    @property
    def time(self) -> np.ndarray:
        """The output times [s]."""
        return self.array(STATES)[:, 0]

    @property
    def states(self) -> "pd.DataFrame":
        """Positions, orientations and velocities of the bodies."""
        return self.frame(STATES)

    @property
    def reactions(self) -> "pd.DataFrame":
        """Reactions of joints, couplings and motions."""
        return self.frame(REACTIONS)

    @property
    def joints(self) -> "pd.DataFrame":
        """Coordinates of joints and their rates."""
        return self.frame(JOINTS)

    @property
    def work(self) -> "pd.DataFrame":
        """Power and work of loads and motions."""
        return self.frame(WORK)

    @property
    def accelerations(self) -> "pd.DataFrame":
        """Accelerations of the bodies, if the run was asked for them."""
        return self.frame(ACCELERATIONS)

    @property
    def markers(self) -> "pd.DataFrame":
        """Motion of markers, and values of distances and angles."""
        return self.frame(MARKERS)

    @property
    def system(self) -> "pd.DataFrame":
        """Mass centres, momenta and energies of groups."""
        return self.frame(SYSTEM)

    @property
    def signals(self) -> "pd.DataFrame":
        """Values of signals."""
        return self.frame(SIGNALS)

    @property
    def events(self) -> "pd.DataFrame":
        """What happened to contacts, and by events of the deck; without rows if nothing did."""
        if EVENTS in self._arrays:
            return self.frame(EVENTS)
        import pandas as pd

        return pd.DataFrame(columns=EVENT_COLUMNS)

    @property
    def errors(self) -> "pd.DataFrame":
        """Estimated global errors of positions and orientations [m] at the output times."""
        return self.frame(ERROR)

    def write(self, folder: str | PathLike[str]) -> Path:
        """Write the files of ``msahl run``: tables, ``run.json`` and ``deck.xml``; return the
        folder.

        Raises ``FolderError`` if it holds anything but a run of the same deck, ``ResultError`` if
        a batch kept some of the tables only.
        """
        if self.omitted:
            raise ResultError(
                f"the batch did not keep {', '.join(self.omitted)}, so the files would not be "
                "those of a run; omit tables=, or write frame(name)"
            )
        folder, origin = path_of(folder), self._origin
        if isinstance(origin, Job):
            path, text, about = origin.source.path, origin.text, origin.about(folder)
        else:
            found = find(origin, DECK)
            if found is None or "deck" not in self.report:
                raise ResultError(f"{origin}: no complete run.json and deck.xml; run it again")
            path, text, about = found, found.read_bytes(), self.report
        write_run(folder, path, self.records, text, about, self.report, self._arrays)
        return folder

    def plot(
        self,
        *kinds: str,
        plane: str = "",
        bodies: tuple[str, ...] = (),
        joints: tuple[str, ...] = (),
    ) -> "Pictures":
        """Draw what ``msahl-post plot`` draws: path, error, energy, work, joints, constraints and
        reactions, or those of ``kinds``.

        ``plane`` is that of the path, such as "xz"; ``bodies`` and ``joints`` restrict what is
        drawn. A notebook shows the pictures; ``save`` writes them.
        """
        from msahl.api.pictures import draw

        require(bodies=(bodies, Names()), joints=(joints, Names()))
        return draw(self.as_run(), kinds, plane, tuple(bodies), tuple(joints))

    def as_run(self) -> "Run":
        """Return the results as the functions of ``msahl.post`` take them."""
        from msahl.results.read import Run, all_states

        amplitudes = self.frame(AMPLITUDES) if self.records.hidden else None
        own = (STATES, REACTIONS, WORK, ERROR, EVENTS)
        return Run(
            folder=self._origin if isinstance(self._origin, Path) else NOWHERE,
            model=self.records,
            info=self.report,
            states=all_states(self.records, self.states, amplitudes),
            reactions=self.frame(REACTIONS) if REACTIONS in self._arrays else None,
            work=self.frame(WORK) if WORK in self._arrays else None,
            partial=not self.completed,
            errors=self.frame(ERROR) if ERROR in self._arrays else None,
            others={name: self.frame(name) for name in self.tables if name not in own},
        )

    def __repr__(self) -> str:
        title = self.records.simulation.title
        of = f" of {title!r}" if title else ""
        return f"<Result{of}: {self.verdict or self.status}, {len(self.time)} output times>"

    def _repr_html_(self) -> str:
        """Return a short table for a notebook."""
        error = "not estimated" if self.error is None else f"{self.error:.2g} m"
        sizes = {name: " x ".join(map(str, of.shape)) for name, of in self._arrays.items()}
        rows = {
            "status": self.status if self.completed else f"{self.status}: {self.message}",
            "verdict": describe_verdict(self.report["verdict"]) if self.verdict else "",
            "estimated position error": error,
            "steps": str(self.report.get("steps", "")),
            "output times": f"{len(self.time)}, to t = {self.time[-1]:g} s",
            "time loop": f"{self.seconds.get('loop', 0.0):.3g} s",
            "tables": ", ".join(f"{name} ({size})" for name, size in sizes.items()),
        }
        return html_table(self.records.simulation.title or "result", rows)


def read(folder: str | PathLike[str]) -> Result:
    """Read the results that a run wrote into ``folder``; a run that ended early is read up to its
    last row. Raises ``ResultError`` if there is no run, ``DeckError`` if its deck is not valid.
    """
    from msahl.results.read import read_run

    try:
        run = read_run(path_of(folder))
    except OSError as error:
        raise ResultError(f"{shown_path(folder)}: {error.strerror or error}") from error
    columns = shown_tables(run.model)[STATES]
    found = {STATES: run.states[columns], REACTIONS: run.reactions, WORK: run.work, **run.others}
    found |= {ERROR: run.errors, EVENTS: run.events}
    frames = {name: frame for name, frame in found.items() if frame is not None}
    arrays = {name: frame.to_numpy() for name, frame in frames.items()}
    result = Result(run.model, run.info, arrays, run.folder)
    result._frames.update(frames)
    return result


def result_of(job: Job, report: Report, sink: MemorySink) -> Result:
    """Return the results of a ``job`` whose rows are in the ``sink``."""
    names = (*shown_tables(job.model), ERROR, EVENTS)
    arrays = without_hidden(job.model, {name: sink.table(name) for name in names})
    kept = {name: array for name, array in arrays.items() if len(array)}
    start = {"start": dict(job.start)} if job.start else {}
    figures = {**start, "options": recorded_options(job.settings), **report.as_json()}
    return Result(job.model, figures, kept, job)
