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
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import msahl
from msahl.deck import DeckError, check_simulation, effective_deck, read_deck
from msahl.jit.files import version_of
from msahl.model import Model, Options, resolve
from msahl.model.settings import LOCAL, OFF
from msahl.printable import printable
from msahl.results.write import INFO, RunFolder, file_name, write_json
from msahl.run import loop
from msahl.run.options import deck_changes, options_beside_deck, recorded_options, with_options
from msahl.run.report import COMPLETED, NOT_STARTED, NOT_WRITTEN, Report, report_without_steps
from msahl.run.tables import STATES, MemorySink
from msahl.run.verdict import FAIL
from msahl.start.velocities import StartError
from msahl.sweep.axes import Column
from msahl.sweep.measures import evaluate, parse_measures, position_error, tables_needed

SUMMARY, TABLES, ALL = KEEP = ("summary", "tables", "all")
"""What is kept of a point: its row; its tables as well; the complete folder of a run."""
NOT_VALID, NO_MEMORY, CRASHED, TIMED_OUT = "not valid", "out of memory", "crashed", "timed out"
"""How a point may end beside the outcomes of a run (``msahl.run.report``)."""
PACKAGES = ("llvmlite", "numpy", "scipy")
"""Packages on which the digits of results depend."""
SHOWN = 16
"""Digits of a key that name a folder of tables and stand in ``runs.csv``."""
LONGEST_MESSAGE = 1000

Row = dict[str, Any]
"""Outcome of a point: "point" (its number), "id", "key", "status", "verdict", "error" [m],
"measures", "message", and "seconds" by phase."""


class Point(NamedTuple):
    """A point of a plan: its ``number`` (from 1), its ``id`` (``point_id``), and its cells."""

    number: int
    id: str
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Job:
    """What all points of a sweep have in common: the path of the deck, the options of all runs, the
    columns of the plan, the measures, what is kept of a run, and the folder of kept tables.
    """

    deck: str
    columns: tuple[Column, ...]
    options: Mapping[str, Any] = field(default_factory=dict)
    measures: tuple[str, ...] = ()
    keep: str = SUMMARY
    folder: str = ""

    def as_json(self) -> dict[str, Any]:
        """The job as JSON."""
        return {
            "deck": self.deck,
            "columns": [[c.name, c.unit, c.option] for c in self.columns],
            "options": dict(self.options),
            "measures": list(self.measures),
            "keep": self.keep,
            "folder": self.folder,
        }

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> "Job":
        """The job that ``as_json`` wrote."""
        columns = tuple(Column(*column) for column in given["columns"])
        return cls(**{**given, "columns": columns, "measures": tuple(given["measures"])})

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


@lru_cache(maxsize=1)
def versions() -> dict[str, str]:
    """Versions of msahl, Python and the packages on which the digits of results depend."""
    found = {package: version_of(package) or "" for package in PACKAGES}
    return {"msahl": msahl.__version__, "python": platform.python_version(), **found}


def context_digest(job: Job) -> str:
    """SHA-256 of what all points share: the deck with its parts, the options and the versions.

    Raises ``DeckError`` if the deck cannot be read.
    """
    options = {name: value for name, value in job.options.items() if value is not None}
    parts = [_merged_deck(Path(job.deck)).decode(), options, versions()]
    return digest_of(parts)


def digest_of(content: Any) -> str:
    """SHA-256 of JSON in hexadecimal."""
    return _sha256(json.dumps(content, sort_keys=True))


def _merged_deck(path: Path) -> bytes:
    """The canonical XML of a deck with its parts, without comments, before any change."""
    from lxml import etree

    from msahl.deck.faults import Faults
    from msahl.deck.includes import merge_parts
    from msahl.deck.parse import parse, read_bytes

    faults = Faults(str(path))
    root = parse(read_bytes(path, faults), faults)
    merge_parts(root, path, faults)
    return etree.tostring(root, method="c14n", with_comments=False)


def point_id(context: str, columns: Sequence[Column], cells: Sequence[str]) -> str:
    """SHA-256 by which a point is found again without reading its deck: of the ``context`` and the
    point's own values, whatever the order of the columns."""
    named = sorted((c.head, cell) for c, cell in zip(columns, cells, strict=True) if cell)
    return digest_of([context, named])


def point_key(job: Job, cells: Sequence[str]) -> str:
    """SHA-256 of the resolved deck of a point, of the options that change numbers, and of versions:
    points with the same key have the same results. Of a deck with faults, that of their messages.
    """
    try:
        return _key(*_resolved(job, cells))
    except DeckError as error:
        return _faulty_key(job, cells, error)


def _key(model: Model, options: Options) -> str:
    # Records of a model hold all that the deck says, in SI units; repr writes each double exactly.
    return _sha256(f"{model!r} {options!r} {versions()!r}")


def _faulty_key(job: Job, cells: Sequence[str], error: DeckError) -> str:
    return _sha256(f"{job.settings_of(cells)!r} {job.options_of(cells)!r} {error} {versions()!r}")


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def model_at(job: Job, cells: Sequence[str]) -> Model:
    """The model at a point of the plan; raises ``DeckError`` with the deck's faults there."""
    return _resolved(job, cells)[0]


def _resolved(job: Job, cells: Sequence[str]) -> tuple[Model, Options]:
    """The model at a point, with its options; raises ``DeckError``."""
    from msahl.deck import Fault

    given = job.options_of(cells)
    model = with_options(read_deck(job.deck, settings=job.settings_of(cells)), given)
    options = options_beside_deck(given)
    faults = [*check_simulation(model.simulation), *_misfits(model, options)]
    if faults:
        raise DeckError(tuple(Fault(job.deck, 0, "", fault) for fault in faults))
    return model, options


def _misfits(model: Model, options: Options) -> list[str]:
    """What does not fit together among the options of a run."""
    settings = resolve(model.simulation, options)
    if settings.solver == "root" and settings.adaptive:
        return ["--solver root takes steps of a given size; omit it, or the tolerance"]
    if settings.error in (LOCAL, OFF) and settings.tolerance is not None:
        return [f"--error {settings.error}: a tolerance of the global error needs its estimate"]
    return []


def run_points(job: Job, points: Iterable[Point]) -> Iterator[Row]:
    """Run the points and yield their rows in the same order.

    A point that cannot be run has a row that says why. Raises ``NotWrittenError`` if the disk takes
    no more tables, and ``CompileError`` if there is no compiler for this kind of model.
    """
    for point in points:
        yield _run_point(job, point)


def _run_point(job: Job, point: Point) -> Row:
    began = time.perf_counter()
    row: Row = {"point": point.number, "id": point.id, "key": ""}
    try:
        model, options = _resolved(job, point.cells)
        row["key"] = _key(model, options)
        report, measures, reason = _simulate(job, point, model, options, row["key"])
    except DeckError as error:
        row["key"] = _faulty_key(job, point.cells, error)
        report, measures, reason = report_without_steps(NOT_VALID, _fault_text(error)), {}, ""
    except MemoryError:
        message = "the model needs more memory than there is"
        report, measures, reason = report_without_steps(NO_MEMORY, message), {}, ""
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
    """The faults of a point's deck in one line."""
    faults = [str(fault) for fault in error.faults]
    more = f"; and {len(faults) - 3} more faults" if len(faults) > 3 else ""
    return "; ".join(faults[:3]) + more


def _simulate(
    job: Job, point: Point, model: Model, options: Options, key: str
) -> tuple[Report, dict[str, Any], str]:
    """Run one point; its report, its measures, and why a measure has no value."""
    measures = parse_measures(job.measures)
    memory = MemorySink(only=tables_needed(measures, model))
    try:
        if job.keep == SUMMARY:
            report = loop.run(model, options, memory, checked=True)
        else:
            report = _run_and_keep(job, point, model, options, memory, key)
    except StartError as error:
        return report_without_steps(NOT_STARTED, str(error)), {}, ""
    if report.status == NOT_WRITTEN:
        raise NotWrittenError(report.message)
    if report.status != COMPLETED:
        return report, {}, ""
    return report, *evaluate(measures, model, report, memory.table)


class _Both:
    """A sink that writes the tables of a run to disk and keeps some of them in memory."""

    takes_observed = True

    def __init__(self, disk: RunFolder, memory: MemorySink) -> None:
        self.disk, self.memory = disk, memory

    def write(self, tables: Mapping[str, np.ndarray]) -> None:
        """See ``Sink``."""
        self.disk.write(tables)
        self.memory.write(tables)

    def restart(self) -> None:
        """See ``Sink``."""
        self.disk.restart()
        self.memory.restart()


def kept_folder(folder: str | Path, key: str) -> Path:
    """The folder of the tables of a point."""
    return Path(folder) / "runs" / key[:SHOWN]


def is_kept(folder: str | Path, key: str, keep: str) -> bool:
    """Whether what is to be kept of a point is there."""
    name = INFO if keep == ALL else file_name(STATES)
    return keep == SUMMARY or (kept_folder(folder, key) / name).is_file()


def _run_and_keep(
    job: Job, point: Point, model: Model, options: Options, memory: MemorySink, key: str
) -> Report:
    """Run one point and keep its tables; a folder under its final name is complete."""
    final = kept_folder(job.folder, key)
    part = final.with_name(f"{final.name}.{os.getpid()}.part")
    try:
        text = effective_deck(
            job.deck, deck_changes(job.options_of(point.cells)), job.settings_of(point.cells)
        )
        shutil.rmtree(part, ignore_errors=True)
        disk = RunFolder(part, model, text)
        with disk:
            report = loop.run(model, options, _Both(disk, memory), checked=True)
            disk.complete = report.status == COMPLETED
        if report.status == NOT_WRITTEN:
            return report
        if job.keep == ALL:
            write_json(part / INFO, _info(job, point, model, options, text, report))
        else:
            (part / "deck.xml").unlink()
        shutil.rmtree(final, ignore_errors=True)
        part.rename(final)
    except OSError as error:
        raise NotWrittenError(f"{error.filename or part}: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
    return report


def _info(
    job: Job, point: Point, model: Model, options: Options, text: bytes, report: Report
) -> dict[str, Any]:
    """The content of ``run.json`` of a point."""
    from msahl.deck import deck_digest, listed_parameters

    settings, parameters = job.settings_of(point.cells), listed_parameters(text)
    return {
        **versions(),
        "deck": {"path": job.deck, "digest": deck_digest(text)},
        **({"parameters": parameters} if parameters else {}),
        **({"set": list(settings)} if settings else {}),
        "options": recorded_options(resolve(model.simulation, options)),
        **report.as_json(),
    }


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
