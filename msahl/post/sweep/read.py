"""Read the folder of a sweep: parameters, measures and outcomes of all points."""

import csv
import json
import math
import re
from collections import Counter
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from msahl.post.measures import MeasureError, parse_measure, unit_of
from msahl.printable import printable, shown_path
from msahl.records import record
from msahl.results.info import COUNT, TEXT, Fields, Many, ResultError, shape_faults

INFO, RUNS, SECONDS, PART = "sweep.json", "runs.csv", "seconds.csv", ".part"
POINT, STATUS, VERDICT, ERROR, MESSAGE, KEY = (
    "point", "status", "verdict", "error", "message", "key"
)  # fmt: skip
COMPLETED, FAIL = "completed", "FAIL"
LOOP = "loop"
"""Column of ``seconds.csv``: time of the time loop [s]."""
AGAIN = "go on with it: msahl sweep, with the same plan"
NUMBER = re.compile(r"([-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(.*)")
DRAWN = " ~ "
"""Text between name and distribution in the words of a plan's axis."""
SHAPE = Fields({
    "plan": Fields({
        "points": COUNT,
        **dict.fromkeys(("columns", "axes"), Many(list, TEXT)),
    }, ("points", "columns", "axes")),
    "deck": Fields({"path": TEXT}),
    "measures": Many(list, TEXT),
}, ("plan",))  # fmt: skip
"""The shape of ``sweep.json``, as far as it is read here; ``sample`` may be null."""
DIGITS = 6
"""Digits of the numbers of a plan on pages, if they distinguish them."""


@record(slots=False)
class Parameter:
    """A column of the plan: its ``name`` with unit, its ``values`` (n,) where all are numbers, the
    texts of its cells, and whether it was drawn from a distribution."""

    name: str
    cells: tuple[str, ...]
    values: np.ndarray | None
    drawn: bool

    @property
    def varies(self) -> bool:
        """Whether it has more than one value."""
        return len(set(self.cells)) > 1

    @property
    def levels(self) -> list[str]:
        """Its different cells, sorted by number, or in their order."""
        if self.values is None:
            return list(dict.fromkeys(self.cells))
        order = sorted(dict(zip(self.cells, self.values, strict=True)).items(), key=lambda p: p[1])
        return [cell for cell, _ in order]

    @cached_property
    def short(self) -> dict[str, str]:
        """Its different cells with numbers of few digits, but as many as distinguish them."""
        cells = self.levels
        matches = [NUMBER.fullmatch(cell.strip()) for cell in cells]
        for digits in range(DIGITS, 17):
            pairs = zip(cells, matches, strict=True)
            found = [_shortened(match, digits) if match else cell for cell, match in pairs]
            if len(set(found)) == len(cells):
                return dict(zip(cells, found, strict=True))
        return dict(zip(cells, cells, strict=True))

    def said(self, cell: str) -> str:
        """Return its value in a cell in words, such as "L = 0.6 m"."""
        name, _, unit = self.name.removesuffix("]").partition(" [")
        value = self.short[cell]
        is_number = self.values is not None and not value.endswith(unit)
        return f"{name} = {value} {unit}" if is_number else f"{name} = {value}"


@record(slots=False)
class Measured:
    """A measure: its ``name``, its ``unit`` ("" if not known), and its ``values`` (n,); nan where a
    point has none."""

    name: str
    unit: str
    values: np.ndarray

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


@record(slots=False)
class SweepRuns:
    """A sweep as it was read: ``parameters`` and ``measures`` of n points, their ``status`` and
    ``verdict`` (texts), ``seconds`` of their time loops (nan if not known), the points' numbers,
    and how many points were ``planned``."""

    folder: Path
    info: dict[str, Any]
    parameters: tuple[Parameter, ...]
    measures: tuple[Measured, ...]
    status: tuple[str, ...]
    verdict: tuple[str, ...]
    messages: tuple[str, ...]
    seconds: np.ndarray
    numbers: np.ndarray
    planned: int

    @property
    def count(self) -> int:
        """Number of points with an outcome."""
        return len(self.status)

    @cached_property
    def completed(self) -> np.ndarray:
        """Which points completed (n,), whatever their verdict."""
        return np.array([status == COMPLETED for status in self.status], dtype=bool)

    @cached_property
    def bad(self) -> np.ndarray:
        """Which points completed with the verdict FAIL (n,)."""
        return self.completed & np.array([word == FAIL for word in self.verdict], dtype=bool)

    @property
    def failures(self) -> dict[str, int]:
        """Number of points by the status of those that did not complete."""
        return dict(Counter(status for status in self.status if status != COMPLETED))

    @property
    def varied(self) -> list[Parameter]:
        """Parameters and options with more than one value."""
        return [parameter for parameter in self.parameters if parameter.varies]

    @property
    def sample(self) -> dict[str, Any] | None:
        """How points were drawn: kind, n and seed; None for a plan without distributions."""
        found = self.info.get("plan", {}).get("sample")
        return found if isinstance(found, dict) else None

    @property
    def title(self) -> str:
        """The deck's name and that of the folder."""
        deck = str(self.info.get("deck", {}).get("path", ""))
        return f"Sweep of {Path(deck).name}" if deck else f"Sweep {self.folder.resolve().name}"

    @property
    def asked(self) -> list[Measured]:
        """Measures that the sweep was asked for; the estimated error if it was asked for none."""
        wanted = self.info.get("measures", [])
        return [m for m in self.measures if m.name in wanted] or list(self.measures)

    def measure(self, name: str) -> Measured:
        """Return a measure by its name; raises ``ResultError`` if there is none."""
        words = " ".join(name.split())
        for measured in self.measures:
            if measured.name == words:
                return measured
        listed = ", ".join(f"'{each.name}'" for each in self.measures) or "none"
        raise ResultError(
            f"{shown_path(self.folder)}: no measure '{printable(name)}' of numbers (it has: "
            f"{listed}); add it: msahl sweep ... --measure"
        )


def read_sweep(folder: Path) -> SweepRuns:
    """Read the sweep in ``folder``; one that is not complete is read as far as it is.

    Raises ``ResultError`` if there is no sweep, or its tables are damaged.
    """
    info = _read_info(folder)
    path = folder / RUNS
    if not path.is_file():
        path = folder / (RUNS + PART)
    if not path.is_file():
        raise ResultError(f"{shown_path(folder)}: the sweep has no outcomes yet; {AGAIN}")
    head, rows = _read_csv(path)
    columns, measures = info["plan"]["columns"], info.get("measures", [])
    lacks = [name for name in (POINT, *columns, STATUS, *measures) if name not in head]
    if lacks:
        raise ResultError(f"{shown_path(path)}:1: no column '{printable(lacks[0])}'; {AGAIN}")
    if not rows:
        raise ResultError(f"{shown_path(path)}: no point has an outcome yet; {AGAIN}")
    cells = dict(zip(head, zip(*rows, strict=True), strict=True))
    numbers = _numbers(cells[POINT])
    for word, number in zip(cells[POINT], numbers, strict=True):
        if not math.isfinite(number):
            what = f"a point is called '{printable(word)}', not by a number"
            raise ResultError(f"{shown_path(path)}: {what}; {AGAIN}")
    return SweepRuns(
        folder=folder,
        info=info,
        parameters=tuple(_parameters(info, columns, cells)),
        measures=tuple(_measures(measures, cells, _units(info))),
        status=cells[STATUS],
        verdict=cells.get(VERDICT, ("",) * len(rows)),
        messages=cells.get(MESSAGE, ("",) * len(rows)),
        seconds=_seconds(folder, numbers),
        numbers=numbers,
        planned=info["plan"]["points"],
    )


def _read_info(folder: Path) -> dict[str, Any]:
    path = folder / INFO
    try:
        info = json.loads(path.read_bytes())
    except FileNotFoundError:
        message = f"not the folder of a sweep (no {INFO}); make one: msahl sweep"
        raise ResultError(f"{shown_path(folder)}: {message}") from None
    except ValueError as error:
        raise ResultError(f"{shown_path(path)}: not JSON: {error}") from error
    faults = list(shape_faults(info, SHAPE))
    if faults:
        raise ResultError(f"{shown_path(path)}: {printable(faults[0])}; {AGAIN}")
    return dict(info)


def _read_csv(path: Path) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of a table; of one that is not complete, without a torn last row."""
    try:
        text = path.read_text(encoding="utf-8")
    except (ValueError, OSError) as error:
        raise ResultError(f"{shown_path(path)}: cannot be read: {error}") from error
    if path.suffix == PART:
        text = text[: text.rfind("\n") + 1]
    lines = csv.reader(text.splitlines(keepends=True))
    head = next(lines, [])
    rows = []
    for row in lines:
        if len(row) != len(head):
            where = f"{shown_path(path)}:{lines.line_num}"
            raise ResultError(f"{where}: {len(row)} cells under {len(head)} columns")
        rows.append(row)
    return head, rows


def _parameters(
    info: dict[str, Any], columns: Sequence[str], cells: dict[str, tuple[str, ...]]
) -> list[Parameter]:
    axes = info["plan"].get("axes", [])
    known = len(axes) == len(columns)
    drawn = [known and DRAWN in str(axis) for axis in axes] if known else [False] * len(columns)
    units = _units(info)
    return [
        _parameter(name, cells[name], is_drawn, units.get(name, ""))
        for name, is_drawn in zip(columns, drawn, strict=True)
    ]


def _units(info: dict[str, Any]) -> dict[str, str]:
    """Return the units of columns and measures that the sweep has stated, by name."""
    found = info.get("units")
    if not isinstance(found, dict):
        return {}
    return {str(name): unit for name, unit in found.items() if isinstance(unit, str)}


def _shortened(match: re.Match[str], digits: int) -> str:
    """Return the number and the unit of a cell, the number with so many digits at most."""
    number = f"{float(match[1]):.{digits}g}"
    return f"{min(number, match[1], key=len)} {match[2]}".strip()


def _parameter(name: str, cells: tuple[str, ...], drawn: bool, known: str) -> Parameter:
    """Return a column of the plan; cells with one common unit are numbers in this unit, without any
    in that which is ``known``."""
    found = [NUMBER.fullmatch(cell.strip()) for cell in cells]
    units = {match[2] for match in found if match}
    if not all(found) or len(units) != 1:
        return Parameter(name, cells, None, drawn)
    unit = units.pop() or known
    values = np.array([float(match[1]) for match in found if match])
    return Parameter(f"{name} [{unit}]" if unit else name, cells, values, drawn)


def _measures(
    names: Sequence[str], cells: dict[str, tuple[str, ...]], units: dict[str, str]
) -> list[Measured]:
    """Return the measures that are numbers, and the estimated error where it is known."""
    wanted = [*names, *([ERROR] if ERROR in cells and ERROR not in names else [])]
    found = []
    for name in wanted:
        values = _numbers(cells[name])
        if np.isfinite(values).any():
            found.append(Measured(name, units.get(name) or _unit(name), values))
    return found


def _unit(name: str) -> str:
    """Return the unit of a measure whose deck is not known."""
    try:
        return unit_of(parse_measure(name))
    except MeasureError:
        return ""


def _numbers(cells: Sequence[str]) -> np.ndarray:
    """Return cells as numbers, nan where one is empty or a word."""
    return np.array([float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells])


def _seconds(folder: Path, numbers: np.ndarray) -> np.ndarray:
    """Return the seconds of the time loop of each point, by its number."""
    for path in (folder / SECONDS, folder / (SECONDS + PART)):
        if path.is_file():
            head, rows = _read_csv(path)
            if {POINT, LOOP} <= set(head):
                columns = dict(zip(head, zip(*rows, strict=True), strict=True)) if rows else {}
                points, loop = (_numbers(columns.get(name, ())) for name in (POINT, LOOP))
                known = dict(zip(points, loop, strict=True))
                return np.array([known.get(number, np.nan) for number in numbers])
    return np.full(len(numbers), np.nan)
