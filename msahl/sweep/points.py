"""Runs points of a sweep: ``run_points(job, points)`` yields one row for each, in their order.

It is the one function that all schedulers call. What it returns depends on the job and the points
only, apart from seconds; job, points and rows can be written as JSON.
"""

import hashlib
import json
import os
import platform
import shutil
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from msahl.api.running import at_start, finer_mesh
from msahl.deck import DeckError, Fault, ParsedDeck, Source
from msahl.jit.files import version_of
from msahl.model.settings import GIVEN
from msahl.post.measures import evaluate, position_error, tables_needed
from msahl.printable import printable
from msahl.records import record
from msahl.results.job import Job as Run
from msahl.results.job import make_job
from msahl.results.session import files_of
from msahl.results.write import DECK, INFO, RunFolder, file_name, write_json
from msahl.run import loop
from msahl.run.options import OptionError
from msahl.run.report import COMPLETED, NOT_STARTED, NOT_WRITTEN, Report, report_without_steps
from msahl.run.tables import STATES, BothSinks, MemorySink
from msahl.run.verdict import FAIL
from msahl.start.velocities import StartError
from msahl.sweep.axes import Column
from msahl.sweep.measures import parse_measures
from msahl.version import VERSION

SUMMARY, TABLES, ALL = KEEP = ("summary", "tables", "all")
"""What is kept of a point: its row; its tables as well; the complete folder of a run."""
NOT_VALID, NO_MEMORY, CRASHED, TIMED_OUT = "not valid", "out of memory", "crashed", "timed out"
"""How a point may end beside the outcomes of a run (``msahl.run.report``)."""
PACKAGES = ("llvmlite", "numpy", "scipy")
"""Packages on which the digits of results depend."""
SHOWN = 16
"""Digits of a key that name a folder of tables and stand in ``runs.csv``."""
LONGEST_MESSAGE = 1000
WARM_STEPS = 5
"""Steps of a run that loads the kernels."""

Row = dict[str, Any]
"""Outcome of a point: "point" (its number), "id", "key", "status", "verdict", "error" [m],
"measures", "message", and "seconds" by phase."""


class Point(NamedTuple):
    """A point of a plan: its ``number`` (from 1), its ``id`` (``point_id``), and its cells."""

    number: int
    id: str
    cells: tuple[str, ...]


@record(slots=False)
class Job:
    """What all points of a sweep have in common: the path of the deck, the options of all runs, the
    columns of the plan, the measures, what is kept of a run, and the folder of kept tables.

    ``digest`` is that of the deck (``Resolver.digest``); no other deck is run if it is given.
    ``source`` are the files of the deck, for machines that do not have them. ``units`` are those of
    columns and measures by their names, where they have one.
    """

    deck: str
    columns: tuple[Column, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    measures: tuple[str, ...] = ()
    keep: str = SUMMARY
    folder: str = ""
    digest: str = ""
    source: Source | None = None
    units: Mapping[str, str] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The job as JSON."""
        return {
            "deck": self.deck,
            "columns": [[c.name, c.unit, c.option] for c in self.columns],
            "options": dict(self.options),
            "measures": list(self.measures),
            "keep": self.keep,
            "folder": self.folder,
            "digest": self.digest,
            "source": self.source and self.source.as_json(),
            "units": dict(self.units),
        }

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> "Job":
        """The job that ``as_json`` wrote."""
        columns = tuple(Column(*column) for column in given["columns"])
        source = given["source"] and Source.from_json(given["source"])
        changed = {"columns": columns, "measures": tuple(given["measures"]), "source": source}
        return cls(**{**given, **changed})

    def settings_of(self, cells: Sequence[str]) -> tuple[str, ...]:
        """Changes of the deck's numbers at a point, as ``msahl run --set`` takes them."""
        pairs = zip(self.columns, cells, strict=True)
        return tuple(c.setting(cell) for c, cell in pairs if cell and not c.option)

    def options_of(self, cells: Sequence[str]) -> dict[str, Any]:
        """Options of the run at a point, by name."""
        pairs = zip(self.columns, cells, strict=True)
        return {
            **self.options,
            **{c.name: c.option_value(cell) for c, cell in pairs if cell and c.option},
        }


class NotWrittenError(Exception):
    """The tables of a point could not be written; that is no outcome of the point."""


class ChangedError(Exception):
    """The deck is not the one with which the sweep began, or this is other software."""


@lru_cache(maxsize=1)
def numeric_versions() -> dict[str, str]:
    """Versions of msahl, Python and the packages on which the digits of results depend."""
    found = {package: version_of(package) or "" for package in PACKAGES}
    return {"msahl": VERSION, "python": platform.python_version(), **found}


def digest_of(content: Any) -> str:
    """SHA-256 of JSON in hexadecimal."""
    return _sha256(json.dumps(content, sort_keys=True))


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def context_digest(job: Job) -> str:
    """SHA-256 of what all points share: the deck with its parts, the options and the versions."""
    options = {name: value for name, value in job.options.items() if value is not None}
    return digest_of([job.digest, options, numeric_versions()])


def point_id(context: str, columns: Sequence[Column], cells: Sequence[str]) -> str:
    """SHA-256 by which a point is found again without reading its deck: of the ``context`` and the
    point's own values, whatever the order of the columns."""
    named = sorted((c.head, cell) for c, cell in zip(columns, cells, strict=True) if cell)
    return digest_of([context, named])


class Resolver:
    """Resolves points of a job: its deck is parsed once.

    Raises ``DeckError`` if the deck cannot be read, ``ChangedError`` if it is another than that
    with the digest of the job.
    """

    def __init__(self, job: Job) -> None:
        self.job = job
        self.deck = ParsedDeck(job.source or Source.of_file(job.deck))
        self.digest = self.deck.digest()
        if job.digest and job.digest != self.digest:
            raise ChangedError(
                f"{job.deck} was changed while the sweep was running; start the sweep again"
            )

    def run_at(self, cells: Sequence[str]) -> Run:
        """The run at a point of the plan; raises ``DeckError`` with the faults of deck and options
        there."""
        settings, given = self.job.settings_of(cells), self.job.options_of(cells)
        try:
            return make_job(self.deck.source, self.deck.model(settings, "--set "), given, settings)
        except OptionError as error:
            raise DeckError(tuple(Fault(self.job.deck, 0, "", f) for f in error.faults)) from error

    def key(self, cells: Sequence[str]) -> str:
        """SHA-256 of the resolved deck of a point, of the options that change numbers, and of
        versions: points with the same key have the same results."""
        try:
            return _key(self.run_at(cells))
        except DeckError as error:
            return self.faulty_key(cells, error)

    def faulty_key(self, cells: Sequence[str], error: DeckError) -> str:
        """The key of a point whose deck has faults: SHA-256 of what was changed and of these."""
        job = self.job
        return digest_of([job.settings_of(cells), job.options_of(cells), _fault_text(error)])


def _key(run: Run) -> str:
    # Records of a model hold all that the deck says, in SI units; repr writes each double exactly.
    model = replace(run.model, shapes=())  # which only views show
    return _sha256(f"{model!r} {run.options!r} {numeric_versions()!r}")


def run_points(job: Job, points: Iterable[Point]) -> Iterator[Row]:
    """Run the points and yield their rows in the same order.

    A point that cannot be run has a row that says why. Raises ``NotWrittenError`` if the disk takes
    no more tables, ``CompileError`` if there is no compiler for this kind of model, and what
    ``Resolver`` raises.
    """
    resolver = Resolver(job)
    for point in points:
        yield _run_point(resolver, point)


def warm_up(job: Job, point: Point) -> None:
    """Take a few steps at a point, so that no later run loads or compiles kernels; faults are left
    to the run itself."""
    with suppress(DeckError, StartError, MemoryError):
        run = Resolver(job).run_at(point.cells)
        simulation = run.model.simulation
        few = min(WARM_STEPS * simulation.dt, simulation.t_final)
        few_steps = replace(simulation, t_final=few, start=GIVEN)
        model = replace(run.model, simulation=few_steps)
        loop.run(model, run.options, MemorySink(only=()), checked=True)


def _run_point(resolver: Resolver, point: Point) -> Row:
    began = time.perf_counter()
    row: Row = {"point": point.number, "id": point.id, "key": ""}
    report, measures, reason = report_without_steps(NOT_STARTED, ""), dict[str, Any](), ""
    try:
        run = resolver.run_at(point.cells)
        row["key"] = _key(run)
        report, measures, reason = _simulate(resolver.job, at_start(run), row["key"])
    except DeckError as error:
        row["key"] = resolver.faulty_key(point.cells, error)
        report = report_without_steps(NOT_VALID, _fault_text(error))
    except StartError as error:
        report = report_without_steps(NOT_STARTED, str(error))
    except MemoryError:
        report = report_without_steps(NO_MEMORY, "the model needs more memory than there is")
    message = "; ".join(filter(None, (report.message, reason)))
    return row | {
        "status": report.status,
        "verdict": report.verdict["word"],
        "error": position_error(report),
        "measures": measures,
        "message": printable(message)[:LONGEST_MESSAGE],
        "seconds": {**report.seconds, "total": time.perf_counter() - began},
    }


def _fault_text(error: DeckError) -> str:
    """The faults of a point's deck in one line, which does not depend on where the deck is."""
    faults = [str(replace(fault, file=Path(fault.file).name)) for fault in error.faults]
    more = f"; and {len(faults) - 3} more faults" if len(faults) > 3 else ""
    return "; ".join(faults[:3]) + more


def _simulate(job: Job, run: Run, key: str) -> tuple[Report, dict[str, Any], str]:
    """Make one run; its report, its measures, and why a measure has no value."""
    measures = parse_measures(job.measures)
    memory = MemorySink(only=tables_needed(measures, run.model))
    if job.keep == SUMMARY:
        report = loop.run(run.model, run.options, memory, checked=True, finer=finer_mesh(run))
    else:
        report = _run_and_keep(job, run, memory, key)
    if report.status == NOT_WRITTEN:
        raise NotWrittenError(report.message.partition(";")[0])
    if report.status != COMPLETED:
        return report, {}, ""
    return report, *evaluate(measures, run.model, report, memory.table)


def kept_folder(folder: str | Path, key: str) -> Path:
    """The folder of the tables of a point."""
    return Path(folder) / "runs" / key[:SHOWN]


def is_kept(folder: str | Path, key: str, keep: str) -> bool:
    """Whether what is to be kept of a point is there."""
    name = INFO if keep == ALL else file_name(STATES)
    return keep == SUMMARY or (kept_folder(folder, key) / name).is_file()


def _run_and_keep(job: Job, run: Run, memory: MemorySink, key: str) -> Report:
    """Make one run and keep its tables; a folder under its final name is complete."""
    final = kept_folder(job.folder, key)
    part = final.with_name(f"{final.name}.{os.getpid()}.part")
    try:
        shutil.rmtree(part, ignore_errors=True)
        disk = RunFolder(part, run.model, run.text)
        with disk:
            sink, finer = BothSinks(disk, memory), finer_mesh(run)
            report = loop.run(run.model, run.options, sink, checked=True, finer=finer)
            disk.complete = report.status == COMPLETED
        if report.status == NOT_WRITTEN:
            return report
        if job.keep == ALL:
            write_json(part / INFO, {**run.about(part), **files_of(part), **report.as_json()})
        else:
            (part / DECK).unlink()
        put_in_place(job, part, key)
    except OSError as error:
        raise NotWrittenError(f"{error.filename or part}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return report


def put_in_place(job: Job, part: Path, key: str) -> None:
    """Give a folder its final name, unless another process has brought the same results."""
    if is_kept(job.folder, key, job.keep):
        return
    final = kept_folder(job.folder, key)
    shutil.rmtree(final, ignore_errors=True)
    try:
        part.rename(final)
    except OSError:
        if not is_kept(job.folder, key, job.keep):
            raise


def crashed_row(point: Point, message: str, status: str = CRASHED) -> Row:
    """The row of a point that ended without a result."""
    return {
        "point": point.number,
        "id": point.id,
        "key": "",
        "status": status,
        "verdict": FAIL,
        "error": None,
        "measures": {},
        "message": printable(message)[:LONGEST_MESSAGE],
        "seconds": {},
    }
