"""Folders of sweeps as ``msahl sweep`` writes them, with values given here."""

import csv
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np


def write_sweep(
    folder: Path,
    parameters: Mapping[str, Sequence[Any]],
    measures: Mapping[str, Sequence[Any]],
    status: Sequence[str] | None = None,
    verdict: Sequence[str] | None = None,
    sample: dict[str, Any] | None = None,
    **more: Any,
) -> Path:
    """Write the folder of a sweep of n points.

    ``parameters`` are the columns of its plan, drawn from distributions if there is a ``sample``
    (but those in ``more["listed"]``); None is a measure without value. ``more`` may have ``error``
    and ``seconds`` (n,), ``planned`` and ``messages``.
    """
    n = len(next(iter(parameters.values())))
    status = status or ["completed"] * n
    verdict = verdict or ["PASS" if word == "completed" else "" for word in status]
    error, seconds = more.get("error", [None] * n), more.get("seconds")
    messages = more.get("messages", [""] * n)
    head = ["point", *parameters, "status", "verdict", "error", *measures, "message", "key"]
    columns = [
        range(1, n + 1), *parameters.values(), status, verdict, error, *measures.values(),
        messages, ["0" * 16] * n,
    ]  # fmt: skip
    folder.mkdir(parents=True)
    planned = more.get("planned", n)
    _write(folder / ("runs.csv" if planned == n else "runs.csv.part"), head, columns)
    if seconds is not None:
        names = ("point", "prepare", "loop", "output", "companion", "total")
        zeros = [0.0] * n
        _write(folder / "seconds.csv", names, [range(1, n + 1), zeros, seconds, *[zeros] * 3])
    listed = more.get("listed", ()) if sample else parameters
    axes = [f"{k} = ..." if k in listed else f"{k} ~ uniform(0, 1)" for k in parameters]
    info = {
        "deck": {"path": more.get("deck", "decks/a/model.xml")},
        "plan": {"points": planned, "columns": list(parameters), "axes": axes, "sample": sample},
        "measures": list(measures),
    }
    (folder / "sweep.json").write_text(json.dumps(info))
    return folder


def _write(path: Path, head: Sequence[str], columns: Sequence[Sequence[Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        write = csv.writer(file, lineterminator="\n").writerow
        write(head)
        for row in zip(*columns, strict=True):
            write([_cell(value) for value in row])


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return repr(float(value)) if isinstance(value, float | np.floating) else str(value)


def ishigami(x: np.ndarray) -> np.ndarray:
    """Ishigami's function with a = 7 and b = 0.1 of points (..., 3) in (-pi, pi)."""
    return np.asarray(
        np.sin(x[..., 0]) + 7.0 * np.sin(x[..., 1]) ** 2 + 0.1 * x[..., 2] ** 4 * np.sin(x[..., 0])
    )


def ishigami_indices() -> tuple[np.ndarray, np.ndarray]:
    """First and total Sobol indices of this function, exact (Ishigami and Homma, 1990)."""
    a, b, p = 7.0, 0.1, np.pi
    first = np.array([0.5 * (1.0 + b * p**4 / 5.0) ** 2, a * a / 8.0, 0.0])
    both = np.array([b * b * p**8 * (1.0 / 18.0 - 1.0 / 50.0)])  # of x1 and x3 together
    variance = first.sum() + both[0]
    return first / variance, np.array([first[0] + both[0], first[1], both[0]]) / variance
