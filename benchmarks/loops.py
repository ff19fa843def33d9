"""Time of the loop, and its errors, of every code on every problem."""

import multiprocessing
import statistics
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from types import ModuleType

import numpy as np

from benchmarks import ours
from benchmarks.motion import Errors, errors_of
from benchmarks.peers import PEERS
from benchmarks.problems import Problem
from benchmarks.reference import converged_positions

_MODULES = [ours, *(PEERS[package] for package in ("exudyn", "mujoco") if package in PEERS)]
CODES: dict[str, ModuleType] = {name: m for m in _MODULES for name in m.VARIANTS}
SETTINGS = {name: text for m in _MODULES for name, text in m.SETTINGS.items()}
MOST_BODIES = {"msahl root": 10}
"""A dense solver: its cost grows like the cube of the bodies."""
PATIENCE = 10.0
"""Seconds for the samples of one code on one problem, and for the run whose errors are taken; more
are not begun. One sample there is always."""
LONGEST_FIRST = 60.0
"""Seconds after which a code's first step of a very long chain is called too long."""


@dataclass(slots=True)
class Measured:
    """One code on one problem at one step size."""

    problem: Problem
    h: float
    code: str
    steps: int = 0  # of one timing sample
    samples: list[float] = field(default_factory=list)  # seconds a step
    errors: Errors | None = None
    note: str = ""

    @property
    def per_step(self) -> float:
        """Median seconds a step, nan if it was not measured."""
        return statistics.median(self.samples) if self.samples else float("nan")

    @property
    def per_step_and_body(self) -> float:
        return self.per_step / self.problem.bodies


def measure(problem: Problem, h: float, repeats: int, sample: float) -> list[Measured]:
    """Every code on ``problem`` at ``h``: samples of about ``sample`` seconds, interleaved."""
    rows = [Measured(problem, h, code) for code in CODES if _can(code, problem)]
    for row in rows:
        _attempt(row, partial(_choose_steps, row, sample))
    _give_auto_the_steps_of_newton(rows)
    for _ in range(repeats):
        for row in rows:
            if not row.note and sum(row.samples) * row.steps < PATIENCE:
                _attempt(row, partial(_take_sample, row))
    converged = converged_positions(problem.model, h * np.arange(round(problem.span / h) + 1))
    for row in rows:
        _attempt(row, partial(_take_errors, row, converged))
    return rows


def _can(code: str, problem: Problem) -> bool:
    return problem.bodies <= MOST_BODIES.get(code, problem.bodies)


def _attempt(row: Measured, part: Callable[[], None]) -> None:
    """A code that gives up leaves a note, not a hole in the table."""
    try:
        part()
    except (RuntimeError, ValueError, ArithmeticError) as error:
        row.note = " ".join(str(error).split())[:80] or type(error).__name__


def _loop(row: Measured, steps: int) -> float:
    seconds: float = CODES[row.code].loop_seconds(row.problem.model, row.h, steps, row.code)
    return seconds


def _choose_steps(row: Measured, sample: float) -> None:
    """How many steps a sample has; the trial also compiles and warms up."""
    if row.problem.bodies >= 1000 and CODES[row.code] is ours:
        _finish_first_step(row)
    trial = max(1, 200 // row.problem.bodies)
    _loop(row, trial)
    per_step = _loop(row, trial) / trial
    most = round(row.problem.timed / row.h)
    row.steps = min(most, max(1, round(sample / per_step)))


def _give_auto_the_steps_of_newton(rows: list[Measured]) -> None:
    """Its first step may cost as much as many later ones, and would make its samples short."""
    steps = {row.code: row.steps for row in rows}
    for row in rows:
        if row.code == "msahl auto" and not row.note:
            row.steps = steps["msahl newton"]


def _finish_first_step(row: Measured) -> None:
    """Raise if one step takes too long; tried in a process that can be ended."""
    process = multiprocessing.get_context("fork").Process(target=_loop, args=(row, 1))
    process.start()
    process.join(LONGEST_FIRST)
    if process.is_alive():
        process.terminate()
        process.join()
        raise RuntimeError(f"its first step had not ended after {LONGEST_FIRST:g} s")


def _take_sample(row: Measured) -> None:
    row.samples.append(_loop(row, row.steps) / row.steps)


def _take_errors(row: Measured, converged: np.ndarray) -> None:
    steps = len(converged) - 1
    if row.note or row.per_step * steps > PATIENCE:
        row.note = row.note or "too slow for the errors"
        return
    motion = CODES[row.code].motion(row.problem.model, row.h, steps, row.code)
    row.errors = errors_of(row.problem.model, motion, converged)
