"""The folder of a sweep: its plan, its journal of outcomes, and the tables made from both.

    sweep.json      deck, options, measures, plan in words, versions, how far the sweep is
    plan.csv        the points
    journal*.jsonl  one line for each outcome, appended as points end, in any order
    runs.csv        one row for each point, in the order of the plan
    seconds.csv     seconds of each point by phase
    runs.parquet    runs.csv for other programs, if pyarrow is installed
    runs/KEY/       tables of a point (--keep tables, all)

A line of the journal is appended by one write. A line that a killed process or a full disk left
torn, or that is not as it was written (``journal``), is ignored, so the journal is valid at any
moment; outcomes are never changed, later lines of a point replace earlier ones. The journal holds
the only copy of the outcomes. ``runs.csv`` follows from plan and journal, and exists under its name
only while every point has an outcome; until then ``runs.csv.part`` has those that are known.
"""

import csv
import mmap
import os
import shutil
import uuid
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from msahl.printable import printable, shown_path
from msahl.results.folder import relative
from msahl.results.info import TEXT, Fields, shape_faults
from msahl.results.lock import FolderInUseError, locked
from msahl.results.write import PART, write_json
from msahl.run.report import COMPLETED
from msahl.run.verdict import FAIL
from msahl.sweep.axes import ONE_NUMBER, number_text
from msahl.sweep.faults import StoreError
from msahl.sweep.journal import Journal, journal_lines, line_of, row_of
from msahl.sweep.plan import POINT, Plan, write_plan
from msahl.sweep.points import SHOWN, Job, Row, digest_of, numeric_versions, point_id

INFO, PLAN, JOURNAL, RUNS, SECONDS, PARQUET = (
    "sweep.json", "plan.csv", "journal.jsonl", "runs.csv", "seconds.csv", "runs.parquet"
)  # fmt: skip
JOURNALS = "journal*.jsonl"
"""Pattern of the names of all journals: of the sweep and of its shards."""
OUTCOME = ("status", "verdict", "error")
"""Columns of ``runs.csv`` behind those of the plan; the measures, message and key follow."""
TEXTS = ("status", "verdict", "message", "key")
"""Columns of ``runs.csv`` that are no numbers even where they look like some."""
SECONDS_COLUMNS = ("prepare", "loop", "output", "companion", "total")
"""Phases in ``seconds.csv``."""
SHAPE = Fields({"plan": Fields({}), "deck": Fields({"path": TEXT, "relative": TEXT})}, ("plan",))
"""The shape of ``sweep.json``, as far as it is read here."""


@contextmanager
def sweep_lock(folder: Path, shared: bool = False) -> Iterator[None]:
    """Lock the folder of a sweep, which is created; raises ``StoreError`` if it is in use.

    Shards have ``shared`` locks: others may write their journals, but nobody the tables.
    """
    try:
        with locked(folder, shared):
            yield
    except FolderInUseError:
        owner = read_info(folder).get("pid")
        who = f"process {owner}" if owner else "another process"
        raise StoreError(
            f"{shown_path(folder)}: {who} is running a sweep there; wait for its end, stop it, or "
            "choose another folder with -o"
        ) from None


@dataclass
class Counts:
    """Points of a plan: all, those with an outcome, failed ones, those with the verdict FAIL."""

    points: int = 0
    done: int = 0
    failed: int = 0
    bad: int = 0
    statuses: Counter[str] = field(default_factory=Counter)
    first_failure: str = ""

    def add(self, row: Row) -> None:
        """Count one outcome."""
        self.done += 1
        self.statuses[row["status"]] += 1
        if row["status"] != COMPLETED:
            self.failed += 1
            message = f": {row['message']}" if row["message"] else ""
            self.first_failure = (
                self.first_failure or f"point {row['point']}: {row['status']}{message}"
            )
        elif row["verdict"] == FAIL:
            self.bad += 1

    @property
    def good(self) -> bool:
        """Whether every point has completed, none with the verdict FAIL."""
        return self.done == self.points and not self.failed and not self.bad

    def as_json(self) -> dict[str, int]:
        """What ``sweep.json`` has of it."""
        return {"done": self.done, "failed": self.failed, "failVerdicts": self.bad}


class Store:
    """The outcomes in the folder of a sweep, found by the ids and by the keys of points.

    ``context`` is ``points.context_digest`` of the job. Outcomes are known of which ``usable`` says
    so. New ones go to the journal called ``journal``; all journals are read.
    """

    def __init__(
        self,
        folder: Path,
        job: Job,
        context: str,
        usable: Callable[[Row], bool] = lambda row: True,
        journal: str = JOURNAL,
    ) -> None:
        self.folder, self.job, self.context = folder, job, context
        self.usable = usable
        heads = sorted(column.head for column in job.columns)
        self.plan_digest = digest_of([context, heads])[:SHOWN]
        self.software = digest_of(numeric_versions())[:SHOWN]
        self.paths = sorted(folder.glob(JOURNALS))
        self.places: dict[bytes, tuple[int, int]] = {}
        self.keys: dict[bytes, tuple[int, int]] = {}
        self.foreign = False  # whether outcomes of other plans are known
        for number, path in enumerate(self.paths):
            for place, row in journal_lines(path):
                self._note(row, (number, place))
        self.journal = Journal(folder / journal)
        if self.journal.path not in self.paths:
            self.paths.append(self.journal.path)

    def _note(self, row: Row, place: tuple[int, int]) -> None:
        name = _short(row["id"])
        if not self.usable(row):
            # A later outcome that is not good enough does not replace an earlier one that is.
            return
        self.places[name] = place
        if row.get("plan") != self.plan_digest and row.get("software") == self.software:
            self.foreign = True
            self.keys[_short(row["key"])] = place

    def id_of(self, cells: Sequence[str]) -> str:
        """The id of a point."""
        return point_id(self.context, self.job.columns, cells)

    def has(self, name: str) -> bool:
        """Whether the outcome of the point with this id is known."""
        return _short(name) in self.places

    def adopt(self, number: int, name: str, key: str) -> Row | None:
        """Take over the outcome of another plan's point with the same key, if there is one."""
        place = self.keys.get(_short(key))
        if place is None:
            return None
        with self.paths[place[0]].open("rb") as file:
            file.seek(place[1])
            row = row_of(file.readline())
        if row is None:  # it was changed meanwhile
            return None
        row |= {"point": number, "id": name}
        self.add([row])
        return row

    def add(self, rows: Sequence[Row]) -> None:
        """Append outcomes to the journal; they are known from then on."""
        place = os.fstat(self.journal.file).st_size
        tags = {"plan": self.plan_digest, "software": self.software}
        lines = [line_of({**row, **tags}) for row in rows]
        self.journal.append(lines)
        index = self.paths.index(self.journal.path)
        for row, line in zip(rows, lines, strict=True):
            self.places[_short(row["id"])] = (index, place)
            place += len(line)

    def close(self) -> None:
        """Close the journal."""
        self.journal.close()

    def rows(self, plan: Plan) -> Iterator[tuple[int, tuple[str, ...], Row | None]]:
        """Yield number, cells and outcome of all points in the order of the plan; None where there
        is no outcome."""
        maps = [_map(path) for path in self.paths]
        try:
            for number, cells in enumerate(plan, start=1):
                place = self.places.get(_short(self.id_of(cells)))
                content = None if place is None else maps[place[0]]
                if place is None or content is None:
                    yield number, cells, None
                    continue
                end = content.find(b"\n", place[1]) + 1
                yield number, cells, row_of(content[place[1] : end])
        finally:
            for content in maps:
                if content is not None:
                    content.close()

    def counts(self, plan: Plan) -> Counts:
        """What ``write_tables`` counts, without writing."""
        counts = Counts(plan.count)
        for _, _, row in self.rows(plan):
            if row is not None:
                counts.add(row)
        return counts

    def write_tables(self, plan: Plan) -> Counts:
        """Write ``runs.csv`` and ``seconds.csv``; under their final names if every point has an
        outcome. Returns what was counted."""
        counts = Counts(plan.count)
        paths = [self.folder / name for name in (RUNS, SECONDS)]
        parts = [path.with_name(path.name + PART) for path in paths]
        with (
            parts[0].open("w", newline="", encoding="utf-8") as runs,
            parts[1].open("w", newline="", encoding="utf-8") as seconds,
        ):
            write_run = csv.writer(runs, lineterminator="\n").writerow
            write_seconds = csv.writer(seconds, lineterminator="\n").writerow
            write_run(runs_head(plan, self.job.measures))
            write_seconds((POINT, *SECONDS_COLUMNS))
            for number, cells, row in self.rows(plan):
                if row is None:
                    continue
                counts.add(row)
                write_run(runs_row(number, cells, row, self.job.measures))
                spent = row.get("seconds", {})
                write_seconds((number, *(_cell(spent.get(name)) for name in SECONDS_COLUMNS)))
        for path, part in zip(paths, parts, strict=True):
            if counts.done == counts.points:
                part.replace(path)
            else:
                path.unlink(missing_ok=True)
        return counts

    def drop_tables(self) -> None:
        """Remove the tables of all points: they are not those of the plan any more."""
        for name in (RUNS, SECONDS, PARQUET):
            (self.folder / name).unlink(missing_ok=True)


def runs_head(plan: Plan, measures: Sequence[str]) -> list[str]:
    """The head of ``runs.csv``."""
    return [*plan.head, *OUTCOME, *_further(measures), "message", "key"]


def _further(measures: Sequence[str]) -> list[str]:
    """The measures that are no columns of every row anyway."""
    return [text for text in measures if text not in OUTCOME]


def runs_row(number: int, cells: Sequence[str], row: Row, measures: Sequence[str]) -> list[str]:
    """One row of ``runs.csv``."""
    values = [row["measures"].get(text) for text in _further(measures)]
    outcome = (row[name] for name in OUTCOME)
    last = (row["message"], row["key"][:SHOWN])
    return [str(number), *cells, *map(_cell, (*outcome, *values, *last))]


def _cell(value: Any) -> str:
    """A value as it stands in a table."""
    if value is None:
        return ""
    return number_text(value) if isinstance(value, float) else str(value)


def _short(name: str) -> bytes:
    """A SHA-256 in hexadecimal as the bytes by which it is found: half of them are enough."""
    try:
        return bytes.fromhex(name[:32])
    except ValueError:
        return b""


def _map(path: Path) -> mmap.mmap | None:
    if not path.exists():
        return None
    with path.open("rb") as file:
        if not os.fstat(file.fileno()).st_size:
            return None
        return mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)


def read_info(folder: Path) -> dict[str, Any]:
    """The content of ``sweep.json``; empty if there is none, or if it is damaged."""
    try:
        found = orjson.loads((folder / INFO).read_bytes())
    except (OSError, ValueError):
        return {}
    return {} if any(shape_faults(found, SHAPE)) else dict(found)


def claim(folder: Path, deck: str) -> None:
    """Check that a sweep of ``deck`` may be written to ``folder``; raises ``StoreError``."""
    held = read_info(folder)
    if not held:
        if not folder.is_dir() or any(folder.glob(JOURNALS)):
            return
        if any(not path.name.startswith(".") for path in folder.iterdir()):
            raise StoreError(
                f"{shown_path(folder)}: not empty, and not the folder of a sweep; choose another "
                "folder with -o"
            )
        return
    then = held.get("deck", {})
    other = Path(os.path.normpath(folder.resolve() / then.get("relative", "")))
    with suppress(OSError, ValueError):  # such as a name that is too long: no file is there
        if not other.is_file() or other.samefile(deck):
            return
        raise StoreError(
            f"{shown_path(folder)}: holds a sweep of another deck, "
            f"{printable(then.get('path', ''))}; choose another folder with -o, or remove this one"
        )


def begin(folder: Path, plan: Plan, job: Job) -> None:
    """Write ``plan.csv``, which is left alone if it is the same, and ``sweep.json``."""
    # Shards may do so at the same time.
    new = folder / f"{PLAN}.{uuid.uuid4().hex}.new"
    write_plan(plan, new)
    if not _same(new, folder / PLAN):
        new.replace(folder / PLAN)
    else:
        new.unlink()
    write_info(folder, plan, job, {"status": "running", "pid": os.getpid()})


def _same(a: Path, b: Path) -> bool:
    if not b.is_file() or a.stat().st_size != b.stat().st_size:
        return False
    with a.open("rb") as one, b.open("rb") as other:
        return all(x == y for x, y in zip(one, other, strict=False))


def write_info(folder: Path, plan: Plan, job: Job, state: Mapping[str, Any]) -> None:
    """Write ``sweep.json``; ``state`` says how far the sweep is."""
    options = {name: value for name, value in job.options.items() if value not in (None, False)}
    new = folder / f"{INFO}.{uuid.uuid4().hex}.new"
    write_json(
        new,
        {
            **numeric_versions(),
            "deck": {"path": job.deck, "relative": relative(Path(job.deck), folder)},
            "plan": plan.as_json(),
            "options": options,
            "measures": list(job.measures),
            "units": dict(job.units),
            "keep": job.keep,
            **state,
        },
    )
    new.replace(folder / INFO)


def write_parquet(folder: Path) -> bool:
    """Write ``runs.parquet`` from ``runs.csv`` if pyarrow is installed; whether it is."""
    with suppress(ImportError):
        import pyarrow
        from pyarrow import csv as reader
        from pyarrow import parquet

        kinds = {False: pyarrow.string(), True: pyarrow.float64()}
        types = {name: kinds[numeric] for name, numeric in _numeric(folder / RUNS).items()}
        types[POINT] = pyarrow.int64()
        convert = reader.ConvertOptions(column_types=types)
        part = folder / (PARQUET + PART)
        with (
            reader.open_csv(folder / RUNS, convert_options=convert) as batches,
            parquet.ParquetWriter(part, batches.schema) as writer,
        ):
            for batch in batches:
                writer.write_batch(batch)
        part.replace(folder / PARQUET)
        return True
    return False


def _numeric(path: Path) -> dict[str, bool]:
    """Whether all values of each column of a table are numbers, or missing; by its head."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = csv.reader(file)
        found = {name: name not in TEXTS for name in next(rows)}
        for row in rows:
            for name, cell in zip(found, row, strict=True):
                if found[name] and cell and not ONE_NUMBER.fullmatch(cell):
                    found[name] = False
    return found


def remove_left_over(folder: Path) -> None:
    """Remove what calls and workers that were killed did not complete."""
    for path in folder.glob("*.new*"):
        path.unlink(missing_ok=True)
    for path in (folder / "runs").glob("*.part"):
        shutil.rmtree(path, ignore_errors=True)
