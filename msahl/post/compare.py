"""Compare the tables of two runs: equal within tolerances, different, or not comparable.

    |a - b| <= atol + rtol |b|          a of the run, b of the reference, every number

Values are matched by time: the reference may hold fewer output times than the run, but each of its
times must be one of the run's, within ``SAME_TIME`` of the time span. Wiener-Milenkovic parameters
p and -16 p/(p.p) describe the same orientation; near rotations by 180 degrees rounding errors
decide between them, so the set nearer to the reference's is compared.
"""

from fnmatch import fnmatchcase
from pathlib import Path

import numpy as np
import pandas as pd

from msahl.post.tolerance import Tolerance
from msahl.printable import shown_path
from msahl.records import record
from msahl.results.folder import find
from msahl.results.info import ResultError, read_info
from msahl.results.read import check_rows, read_table, wrong_count
from msahl.results.write import PART

SAME_TIME = 1e-9
TABLES = ("states.csv", "reactions.csv", "work.csv")
OBSERVED = (
    "accelerations.csv",
    "joints.csv",
    "markers.csv",
    "system.csv",
    "signals.csv",
    "beams.csv",
    "amplitudes.csv",
)
"""Tables that are compared if both folders have them; they follow from the states."""


@record
class Difference:
    """A difference: time [s] and column, both values, and the accepted absolute difference."""

    time: float
    column: str
    value: float
    reference: float
    tolerance: float

    def __str__(self) -> str:
        return (
            f"t = {self.time:.9g} s, {self.column}: {self.value!r}, reference {self.reference!r}, "
            f"|difference| {abs(self.value - self.reference):.3g} (accepted {self.tolerance:.3g})"
        )


@record
class Comparison:
    """Result for one table: ``first`` and ``worst`` (by |a - b| over tolerance) difference.

    Both are ``None`` if the tables are equal. ``rows`` and ``columns`` count what was compared,
    ``differing`` counts the numbers that differ, ``largest`` is the largest |a - b|.
    """

    name: str
    rows: int
    columns: int
    differing: int
    first: Difference | None
    worst: Difference | None
    largest: float


def compare(
    run: Path,
    reference: Path,
    tolerance: Tolerance,
    columns: tuple[str, ...] = (),
    until: float | None = None,
) -> list[Comparison]:
    """Compare every table of ``reference`` (a run's folder or one CSV file) with that of ``run``.

    ``columns`` are shell patterns; none means all. Values after ``until`` [s] are not compared.
    Raises ``ResultError`` if the two are not comparable.
    """
    pairs = _pairs(run, reference)
    tables = [(name, _read(a), _read(b)) for name, a, b in pairs]
    if columns:
        tables = [(name, _pick(a, columns), _pick(b, columns)) for name, a, b in tables]
        tables = [table for table in tables if len(table[1].columns) + len(table[2].columns) > 2]
        if not tables:
            raise ResultError(f"{reference}: no column matches {', '.join(columns)}")
    return [_compare_tables(name, a, b, tolerance, until) for name, a, b in tables]


def _pairs(run: Path, reference: Path) -> list[tuple[str, Path, Path]]:
    """Return the name and both paths of every table to compare."""
    for path in (run, reference):
        if not path.exists():
            raise ResultError(f"{path}: no such file or folder")
    if not reference.is_dir():
        path = _table_of(run, _name(reference)) if run.is_dir() else run
        return [(_name(reference), path, reference)]
    if not run.is_dir():
        return [(_name(run), run, _table_of(reference, _name(run)))]
    names = [name for name in TABLES if find(reference, name)]
    if not names:
        raise ResultError(f"{reference}: contains none of the tables {', '.join(TABLES)}")
    extra = [name for name in TABLES if find(run, name) and name not in names]
    if extra:
        raise ResultError(
            f"{reference}: has no {extra[0]}, which {run} has; compare single CSV files instead"
        )
    names += [name for name in OBSERVED if find(run, name) and find(reference, name)]
    return [(name, _table_of(run, name), _table_of(reference, name)) for name in names]


def _name(path: Path) -> str:
    return path.name.removesuffix(PART)


def _table_of(folder: Path, name: str) -> Path:
    path = find(folder, name)
    if path is None:
        raise ResultError(f"{shown_path(folder)}: has no {name} to compare")
    return path


def _read(path: Path) -> pd.DataFrame:
    """Read a table, and check that its times increase and, in a run's folder, that it is complete.

    Other numbers may be anything: a value that is not finite differs from everything.
    """
    table, expected = read_table(path), read_info(path.parent).get("outputTimes")
    if expected is not None and len(table) != expected and _name(path) in (*TABLES, *OBSERVED):
        raise ResultError(wrong_count(path, len(table), f"run.json says {expected}"))
    if "time" in table.columns:
        check_rows(path, table, only_times=True)
    return table


def _pick(table: pd.DataFrame, patterns: tuple[str, ...]) -> pd.DataFrame:
    """Return ``time`` and the columns that match one of the patterns."""
    return table[[c for c in table if c == "time" or any(fnmatchcase(str(c), p) for p in patterns)]]


def _compare_tables(
    name: str, run: pd.DataFrame, reference: pd.DataFrame, tolerance: Tolerance, until: float | None
) -> Comparison:
    _check_columns(name, run, reference)
    if until is not None:
        slack = SAME_TIME * abs(until)
        reference = reference[reference["time"] <= until + slack]
    if reference.empty:
        raise ResultError(f"{name}: the reference has no output times to compare")
    run = run[list(reference.columns)].iloc[_matching_rows(name, run, reference)]
    columns = [str(column) for column in reference.columns if column != "time"]
    a, b = _nearest_parameters(run[columns], reference[columns]), reference[columns].to_numpy()
    return _differences(name, columns, reference["time"].to_numpy(), a, b, tolerance)


def _check_columns(name: str, run: pd.DataFrame, reference: pd.DataFrame) -> None:
    for table in (run, reference):
        if "time" not in table.columns:
            raise ResultError(f"{name}: has no column 'time'")
    for whose, lacks in (
        ("the run lacks", [c for c in reference.columns if c not in run.columns]),
        ("the reference lacks", [c for c in run.columns if c not in reference.columns]),
    ):
        if lacks:
            more = f" and {len(lacks) - 3} more" if len(lacks) > 3 else ""
            raise ResultError(f"{name}: different columns: {whose} {', '.join(lacks[:3])}{more}")


def _matching_rows(name: str, run: pd.DataFrame, reference: pd.DataFrame) -> np.ndarray:
    """Return the index of the run's row at each time of the reference.

    Raises ``ResultError`` if the run lacks one of the times.
    """
    have, want = run["time"].to_numpy(), reference["time"].to_numpy()
    if have.size == 0:
        raise ResultError(f"{name}: the run has no output times")
    right = np.clip(np.searchsorted(have, want), 0, have.size - 1)
    left = np.maximum(right - 1, 0)
    nearest = np.where(want - have[left] < have[right] - want, left, right)
    slack = SAME_TIME * (want[-1] - want[0] or abs(want[-1]))
    missing = np.flatnonzero(np.abs(have[nearest] - want) > slack)
    if missing.size:
        raise ResultError(
            f"{name}: different output times: the run has none at t = {want[missing[0]]:.9g} s "
            f"({missing.size} of the reference's {want.size} are missing; the run ends at "
            f"{have[-1]:.9g} s)"
        )
    return nearest


def _nearest_parameters(run: pd.DataFrame, reference: pd.DataFrame) -> np.ndarray:
    """Return the values of ``run``, with orientation parameters in that one of their two sets which
    is nearer to the reference's."""
    values = run.to_numpy().copy()
    names = list(run.columns)
    for body in (column.removesuffix(".P1") for column in names if column.endswith(".P1")):
        triple = [f"{body}.P{i}" for i in (1, 2, 3)]
        if not set(triple) <= set(names):
            continue
        p, q = run[triple].to_numpy(), reference[triple].to_numpy()
        square = (p * p).sum(axis=1, keepdims=True)
        other = -16.0 * p / np.where(square > 0.0, square, np.inf)
        nearer = np.abs(other - q).sum(axis=1) < np.abs(p - q).sum(axis=1)
        places = [names.index(column) for column in triple]
        values[:, places] = np.where(nearer[:, None] & (square > 0.0), other, p)
    return values


def _differences(
    name: str,
    columns: list[str],
    time: np.ndarray,
    a: np.ndarray,
    b: np.ndarray,
    tolerance: Tolerance,
) -> Comparison:
    accepted = tolerance.of(b)
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.abs(a - b)
        ratio = np.nan_to_num(size / accepted, nan=np.inf, posinf=np.inf)
    # Not "greater": NaN differs from everything.
    different = ~(size <= accepted)
    excess = np.where(different, ratio, 0.0)
    rows = np.flatnonzero(different.any(axis=1))

    def difference(row: int, column: int) -> Difference:
        values = (a[row, column], b[row, column], accepted[row, column])
        return Difference(float(time[row]), columns[column], *map(float, values))

    largest = float(size.max(initial=0.0))
    if rows.size == 0:
        return Comparison(name, len(time), len(columns), 0, None, None, largest)
    first = difference(int(rows[0]), int(excess[rows[0]].argmax()))
    worst = difference(*map(int, np.unravel_index(excess.argmax(), excess.shape)))
    return Comparison(name, len(time), len(columns), int(different.sum()), first, worst, largest)
