"""Candidates for writing a table of numbers as CSV: seconds, and whether every double comes back.

    python -m benchmarks.writers

50 001 rows of 19 columns, full-length numbers (the longest decimals, so the slowest case), beside
the seconds that the time loop takes for as many steps. A candidate that is not installed is
omitted.
"""

import csv
import io
import statistics
import tempfile
import time
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.machine import describe
from benchmarks.ours import loop_seconds
from benchmarks.problems import THESIS
from msahl.deck import read_deck
from msahl.results.write import Table

ROWS, COLUMNS = 50_001, 19
RESULTS = Path(__file__).parent / "results"
Writer = Callable[[Path, np.ndarray, list[str]], None]


class Written(NamedTuple):
    seconds: float
    exact: bool  # every double reads back
    size: float  # [MB]


def by_msahl(path: Path, rows: np.ndarray, names: list[str]) -> None:
    """In chunks, as the time loop hands them over."""
    table = Table(path, names)
    for chunk in np.array_split(rows, max(1, len(rows) // 4096)):
        table.write(chunk)
    table.close()


def by_csv(path: Path, rows: np.ndarray, names: list[str]) -> None:
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(rows.tolist())


def by_savetxt(path: Path, rows: np.ndarray, names: list[str]) -> None:
    np.savetxt(path, rows, fmt="%.17g", delimiter=",", header=",".join(names), comments="")


def by_pandas(path: Path, rows: np.ndarray, names: list[str]) -> None:
    import pandas as pd

    pd.DataFrame(rows, columns=names).to_csv(path, index=False)


def by_polars(path: Path, rows: np.ndarray, names: list[str]) -> None:
    import polars

    polars.DataFrame(rows, schema=names).write_csv(path)


def by_pyarrow(path: Path, rows: np.ndarray, names: list[str]) -> None:
    import pyarrow
    import pyarrow.csv

    table = pyarrow.table([np.ascontiguousarray(c) for c in rows.T], names=names)
    pyarrow.csv.write_csv(table, path)


WRITERS: dict[str, tuple[str, Writer]] = {
    "orjson (msahl)": ("orjson", by_msahl),
    "polars write_csv": ("polars", by_polars),
    "pyarrow write_csv": ("pyarrow", by_pyarrow),
    "csv module": ("csv", by_csv),
    "numpy savetxt %.17g": ("numpy", by_savetxt),
    "pandas to_csv": ("pandas", by_pandas),
}


def measure_writers(repeats: int, rows: int = ROWS) -> tuple[dict[str, Written], float]:
    """Each installed candidate, interleaved; and seconds to compute ``rows`` - 1 steps."""
    numbers = np.random.default_rng(1).standard_normal((rows, COLUMNS))
    names = [f"c{i}" for i in range(COLUMNS)]
    found = {name: w for name, (package, w) in WRITERS.items() if find_spec(package)}
    seconds: dict[str, list[float]] = {name: [] for name in found}
    computing: list[float] = []
    model = read_deck(THESIS / "single_pendulum_45.xml")
    loop_seconds(model, 0.002, 2, "msahl newton")  # compiles
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "table.csv"
        written = {}
        for _ in range(repeats):
            computing.append(loop_seconds(model, 0.002, rows - 1, "msahl newton"))
            for name, writer in found.items():
                began = time.perf_counter()
                writer(path, numbers, names)
                seconds[name].append(time.perf_counter() - began)
                if name not in written:
                    written[name] = (_reads_back(path, numbers), path.stat().st_size / 1e6)
    medians = {name: statistics.median(times) for name, times in seconds.items()}
    return {n: Written(medians[n], *written[n]) for n in found}, statistics.median(computing)


def table_of_writers(written: dict[str, Written], computing: float) -> str:
    """Markdown."""
    out = io.StringIO()
    print("| writer | seconds | times computing | every double back | MB |", file=out)
    print("|---|---|---|---|---|", file=out)
    for name, w in sorted(written.items(), key=lambda item: item[1].seconds):
        ratio = w.seconds / computing
        exact = "yes" if w.exact else "NO"
        print(f"| {name} | {w.seconds:.3f} | {ratio:.1f} | {exact} | {w.size:.1f} |", file=out)
    print(f"\nComputing as many steps of the single pendulum: {computing:.3f} s.", file=out)
    return out.getvalue()


def _reads_back(path: Path, numbers: np.ndarray) -> bool:
    return np.array_equal(np.loadtxt(path, delimiter=",", skiprows=1), numbers)


def main() -> None:
    machine = describe()
    written, computing = measure_writers(repeats=3)
    text = [
        "# Writing a table",
        "",
        f"{ROWS} rows of {COLUMNS} full-length doubles to CSV, medians of 3, interleaved.",
        "",
        table_of_writers(written, computing),
        *(f"- {line}" for line in machine),
        "",
    ]
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "writers.md").write_text("\n".join(text))
    print("\n".join(text))


if __name__ == "__main__":
    main()
