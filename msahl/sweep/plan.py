"""The plan of a sweep: a stream of points, each a row of cells, and the file ``plan.csv``.

The rows of a plan are made one by one whenever they are asked for, so a plan takes the memory of
its axes or of its samples, not that of its points. In ``plan.csv`` they are numbered from 1 in the
column ``point``; a file written by hand needs no such column.
"""

import csv
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import product
from math import prod
from pathlib import Path
from typing import Any, TextIO

from msahl.printable import printable, shown_path
from msahl.records import record
from msahl.results.write import PART
from msahl.sweep.axes import Axis, Column, number_text
from msahl.sweep.faults import PlanError
from msahl.sweep.samples import SALTELLI, Sample, draw

POINT = "point"
"""Head of the column that numbers the points."""
MOST_FAULTS = 20
"""Faults of a plan that are reported."""
LONGEST_CELL = 200
"""Most characters of a cell that a message shows."""
MOST_POINTS = 100_000_000

Cells = tuple[str, ...]


@record(slots=False)
class Plan:
    """A plan: its columns, the number of its points, and a function that yields their cells.

    ``axes`` describe it in words; ``sample`` says how points were drawn.
    """

    columns: tuple[Column, ...]
    count: int
    rows: Callable[[], Iterator[Cells]]
    axes: tuple[str, ...] = ()
    sample: Sample | None = None

    def __iter__(self) -> Iterator[Cells]:
        return self.rows()

    @property
    def head(self) -> list[str]:
        """The head of ``plan.csv``."""
        return [POINT, *(column.head for column in self.columns)]

    def as_json(self) -> dict[str, Any]:
        """What ``sweep.json`` has of the plan."""
        sample = self.sample
        drawn = {"kind": sample.kind, "n": sample.n, "seed": sample.seed} if sample else None
        return {"points": self.count, "columns": self.head[1:], "axes": self.axes, "sample": drawn}


def make_plan(axes: Sequence[Axis], zipped: bool = False, sample: Sample | None = None) -> Plan:
    """Return the plan of all combinations of the axes' values, the last axis varying first.

    With ``zipped`` the lists are gone through side by side. Axes with distributions are sampled; if
    others have several values, each of their combinations gets all samples. Raises ``PlanError``.
    """
    _check_axes(axes, sample)
    lists = [axis for axis in axes if axis.distribution is None]
    drawn = [axis for axis in axes if axis.distribution is not None]
    faults = [
        f"{axis.column.head}: {fault}"
        for axis in lists
        for cell in axis.cells
        if (fault := axis.column.fault(cell))
    ]
    if faults:
        raise PlanError(*faults[:MOST_FAULTS])
    combinations = _zipped(lists) if zipped else (lambda: product(*(a.cells for a in lists)))
    count = _length(lists) if zipped else prod(len(axis.cells) for axis in lists)
    columns = tuple(axis.column for axis in (*lists, *drawn))
    words = tuple(map(str, (*lists, *drawn)))
    if sample is None:
        return Plan(columns, _bounded(count), combinations, words)
    if sample.kind == SALTELLI and count > 1:
        raise PlanError(
            "--sample saltelli: every --set and --over without distribution has one value then"
        )
    _bounded(count * sample.count(len(drawn)))
    points = draw(sample, [axis.distribution for axis in drawn if axis.distribution])

    def rows() -> Iterator[Cells]:
        for combination in combinations():
            for point in points:
                yield (*combination, *map(number_text, point))

    return Plan(columns, count * len(points), rows, words, sample)


def with_constants(plan: Plan, axes: Sequence[Axis]) -> Plan:
    """Return a plan with further columns, of one value each; raises ``PlanError``."""
    if not axes:
        return plan
    for axis in axes:
        if axis.distribution is not None or len(axis.cells) != 1:
            raise PlanError(f"{axis.column.head}: with --plan, --set and --over take one value")
        if (axis.column.name, axis.column.option) in {(c.name, c.option) for c in plan.columns}:
            raise PlanError(f"{axis.column.head} is a column of the plan; omit it")
    columns = (*plan.columns, *(axis.column for axis in axes))
    more = tuple(axis.cells[0] for axis in axes)
    words = (*plan.axes, *map(str, axes))
    return replace(plan, columns=columns, axes=words, rows=lambda: (c + more for c in plan.rows()))


def _check_axes(axes: Sequence[Axis], sample: Sample | None) -> None:
    """Raise ``PlanError`` unless the axes and the sample fit together."""
    if not axes:
        raise PlanError("nothing to vary: give --set, --over or --plan (see msahl sweep --help)")
    names = [(axis.column.name, axis.column.option) for axis in axes]
    twice = [axis.column.head for k, axis in enumerate(axes) if names[k] in names[:k]]
    if twice:
        raise PlanError(f"{twice[0]} is varied twice; give all its values in one option")
    drawn = any(axis.distribution for axis in axes)
    if drawn and sample is None:
        raise PlanError("distributions are sampled: say how, such as --sample lhs:100")
    if sample is not None and not drawn:
        raise PlanError("--sample: there is no distribution, such as --set 'L~uniform(4,6)'")


def _length(lists: Sequence[Axis]) -> int:
    """Return the number of values that all axes of more than one have; raises ``PlanError``."""
    counts = {axis.column.head: len(axis.cells) for axis in lists if len(axis.cells) > 1}
    if len(set(counts.values())) > 1:
        listed = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise PlanError(f"--zip: all have the same number of values, but {listed}")
    return max(counts.values(), default=1)


def _zipped(lists: Sequence[Axis]) -> Callable[[], Iterator[Cells]]:
    """Return a function that goes through the lists side by side; one value stands for all."""
    n = _length(lists)
    columns = [axis.cells if len(axis.cells) > 1 else axis.cells * n for axis in lists]
    return lambda: zip(*columns, strict=True) if columns else iter([()])


def _bounded(count: int) -> int:
    if count > MOST_POINTS:
        raise PlanError(f"the plan has {count} points; at most {MOST_POINTS} are possible")
    return count


def read_plan(path: Path) -> Plan:
    """Return the plan in a CSV file, whose rows are read one by one; raises ``PlanError`` with the
    faults of all rows."""
    if path.exists() and not path.is_file():
        raise PlanError(
            f"{shown_path(path)}: {_kind(path)}; a plan is read again whenever the sweep goes on, "
            "so save it in a file"
        )
    try:
        with _open(path) as file:
            lines = csv.reader(file, strict=True)
            head = [cell.strip() for cell in next(lines, [])]
            columns = _columns(path, head)
            count, faults = _check_rows(path, lines, head, columns)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise PlanError(f"{shown_path(path)}: cannot be read as CSV: {reason}") from None
    if faults:
        raise PlanError(*faults)
    if not count:
        raise PlanError(f"{shown_path(path)}: there is no point below the head of the table")
    names = [cell for cell in head if cell != POINT]

    def rows() -> Iterator[Cells]:
        with _open(path) as file:
            lines = csv.reader(file, strict=True)
            # The file may be plan.csv of this sweep, which has been written anew since: its columns
            # are numbered ("point") then, and there may be more.
            now = [cell.strip() for cell in next(lines, [])]
            if not set(names) <= set(now):
                raise PlanError(f"{shown_path(path)}: was changed meanwhile; start the sweep again")
            kept = [now.index(name) for name in names]
            for cells in lines:
                if cells:
                    yield tuple(cells[k].strip() for k in kept)

    return Plan(columns, _bounded(count), rows, (f"points of {shown_path(path)}",))


def _kind(path: Path) -> str:
    if path.is_dir():
        return "a folder"
    return "a pipe" if path.is_fifo() else "a device"


def _open(path: Path) -> TextIO:
    return path.open(newline="", encoding="utf-8-sig")


def _columns(path: Path, head: list[str]) -> tuple[Column, ...]:
    names = [name for name in head if name != POINT]
    where = f"{shown_path(path)}:1"
    if not names or not all(names):
        raise PlanError(f"{where}: the first line names a number or an option (--dt) per column")
    try:
        columns = tuple(map(Column.of_head, names))
    except PlanError as error:
        raise PlanError(f"{where}: {error}") from None
    keys = [(column.name, column.option) for column in columns]
    if len(set(keys)) < len(keys) or head.count(POINT) > 1:
        twice = next((names[k] for k, key in enumerate(keys) if key in keys[:k]), POINT)
        raise PlanError(f"{where}: '{printable(twice)}' appears twice")
    return columns


def _check_rows(
    path: Path, lines: Any, head: list[str], columns: tuple[Column, ...]
) -> tuple[int, list[str]]:
    """Return the number of points and the first faults of their cells."""
    kept = [k for k, cell in enumerate(head) if cell != POINT]
    count, faults = 0, []
    for cells in lines:
        if not cells:
            continue
        count += 1
        where = f"{shown_path(path)}:{lines.line_num}"
        if len(cells) != len(head):
            faults.append(f"{where}: {len(cells)} cells under {len(head)} columns")
        else:
            for k, column in zip(kept, columns, strict=True):
                fault = column.fault(cells[k].strip())
                if fault:
                    faults.append(f"{where}: {printable(fault[:LONGEST_CELL])}")
        if len(faults) >= MOST_FAULTS:
            faults.append(f"{shown_path(path)}: further faults are not listed")
            break
    return count, faults


def write_plan(plan: Plan, path: Path) -> None:
    """Write ``plan.csv``; the file is never seen half-written."""
    part = path.with_name(path.name + PART)
    with part.open("w", newline="", encoding="utf-8") as file:
        write = csv.writer(file, lineterminator="\n").writerow
        write(plan.head)
        for number, cells in enumerate(plan, start=1):
            write((number, *cells))
    part.replace(path)
