"""Runs kept in memory, and what they took.

Compiling belongs to nobody's run: each scheme is run for a few steps first. The repeats are
interleaved, so that a busy moment of the machine falls on all steps and schemes alike.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
import pandas as pd

from msahl.model import Model, scheme_of
from msahl.results.read import Run
from msahl.run import Grid, Options, Report, run
from msahl.schemes import split
from msahl.system.names import reaction_columns, state_columns, work_columns

WARM_STEPS = 5
COLUMNS = (state_columns, reaction_columns, work_columns)


class Memory:
    """A sink that keeps the rows."""

    def __init__(self) -> None:
        self.parts: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def write(
        self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray, errors: np.ndarray
    ) -> None:
        """Append rows."""
        self.parts.append((states, reactions, work))

    def restart(self) -> None:
        """Drop all rows."""
        self.parts.clear()

    def tables(self) -> list[np.ndarray]:
        """States, reactions and work, the time in the first column of each."""
        return [np.concatenate(part) for part in zip(*self.parts, strict=True)]


class Nowhere:
    """A sink for runs of which only the time counts."""

    def write(
        self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray, errors: np.ndarray
    ) -> None:
        """Drop rows."""

    def restart(self) -> None:
        """There are none."""


@dataclass(frozen=True)
class Trial:
    """A run and what it took: ``seconds`` of the loop, the median of its repeats."""

    scheme: str
    dt: float
    seconds: float
    report: Report
    run: Run

    @property
    def completed(self) -> bool:
        """Whether it came to the end."""
        return self.report.status == "completed"


def with_step(
    model: Model, dt: float, t_final: float | None = None, scheme: str | None = None
) -> Model:
    """``model`` with another step, end and scheme (one of ``schemes.choices``), all steps of this
    size.
    """
    given = model.simulation
    end = given.t_final if t_final is None else t_final
    name, degree = split(scheme) if scheme else (scheme_of(model), None)
    other = replace(given, dt=dt, t_final=end, scheme=name, degree=degree or given.degree)
    return replace(
        model, simulation=replace(other, tolerance=None, local_tolerance=None, interval=None)
    )


def run_in_memory(
    model: Model, options: Options, stopped: Callable[[], bool] = lambda: False
) -> tuple[Report, Run]:
    """Run ``model``; what happened, and its rows as they would be read back."""
    memory = Memory()
    report = run(model, options, memory, stopped=stopped)
    frames = [
        pd.DataFrame(table, columns=columns(model))
        for table, columns in zip(memory.tables(), COLUMNS, strict=True)
    ]
    states, reactions, work = frames
    kept = Run(
        folder=Path(),
        model=model,
        info={"options": {"every": options.every}, "status": report.status},
        states=states,
        reactions=reactions if len(reactions.columns) > 1 else None,
        work=work if len(work.columns) > 1 else None,
        partial=report.status != "completed",
    )
    return report, kept


def try_all(
    model: Model,
    cases: Sequence[tuple[str, float]],
    repeats: int,
    progress: Callable[[int], Any] = lambda steps: None,
    stopped: Callable[[], bool] = lambda: False,
) -> list[Trial]:
    """A trial of every case (scheme, dt); ``progress`` is told of steps done since last time.

    Once ``stopped``, those that had run, however often, are the trials.
    """
    for scheme in sorted({scheme for scheme, _ in cases}):
        dt = next(dt for name, dt in cases if name == scheme)
        end = min(WARM_STEPS * dt, model.simulation.t_final)
        run(with_step(model, dt, end, scheme), Options(), Nowhere(), stopped=stopped)
    seconds: dict[tuple[str, float], list[float]] = {case: [] for case in cases}
    kept: dict[tuple[str, float], tuple[Report, Run]] = {}
    for repeat, case in product(range(repeats), cases):
        if stopped():  # a short run does not ask
            break
        scheme, dt = case
        variant = with_step(model, dt, scheme=scheme)
        if repeat == 0:
            report, rows = run_in_memory(variant, Options(), stopped)
        else:
            report = run(variant, Options(), Nowhere(), stopped=stopped)
        if report.status == "interrupted":
            break
        if repeat == 0:
            kept[case] = report, rows
        seconds[case].append(report.seconds["loop"])
        progress(Grid.of(variant.simulation).n)
    return [Trial(*case, median(seconds[case]), *kept[case]) for case in cases if case in kept]
