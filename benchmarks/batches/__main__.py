"""Many runs of one model: ``python -m benchmarks.batches [--quick] [-o FILE]`` writes batch.md.

``--quick`` is a smoke test with few runs; its figures mean nothing.
"""

import argparse
import os
import statistics
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import least_squares

import msahl
from benchmarks.batches import ours
from benchmarks.batches.plan import CORES, DECK, GRID, SPAN, Sample, error, samples
from benchmarks.machine import describe
from benchmarks.peers import import_peers

PEERS, MISSING = import_peers(
    {
        "mujoco": "benchmarks.batches.mujoco_rollout",
        "exudyn": "benchmarks.batches.exudyn_variation",
    }
)
RESULT = Path(__file__).parents[1] / "results" / "batch.md"
TARGETS = (1e-3, 1e-6, 1e-9)
PARTS = (2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14, 16, 20, 24, 32, 40, 50, 64, 80, 100, 128, 160, 200,
         256, 320, 400, 512, 800, 1024, 1600)  # fmt: skip
"""Numbers of steps in an interval of the grid that are tried, for a step just small enough."""
CHECKED = 12
"""Samples whose errors decide on the step."""
LONGEST = 3.0
"""Seconds that a timing of a peer may take: its plan is shortened to that."""
THOUSAND = {"dt": 0.01, "t_final": SPAN}
"""The options of the plan of 1000 steps, each with a row."""


LEAST_OF_ORDER_2 = 1e-3
"""Error [m] below which a scheme of order 2 is not tried: it would take minutes."""


class Size(NamedTuple):
    """Numbers of runs: of the plan, of the fit, of a comparison; and repetitions of these."""

    plan: int
    fit: int
    compared: int
    repeats: int


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="smoke test")
    parser.add_argument("-o", "--output", type=Path, default=RESULT, metavar="FILE")
    given = parser.parse_args()
    size = Size(100, 20, 50, 1) if given.quick else Size(10_000, 200, 2000, 3)
    began = time.perf_counter()
    title = "# Batches" + (" (smoke test: the figures mean nothing)" if given.quick else "")
    parts = [title, "\n".join(f"- {line}" for line in describe()), INTRODUCTION]
    for heading, measured in (
        ("## The plan of 1000 steps", plan_of_thousand),
        ("## Runs per second at equal error", at_equal_error),
        ("## A fit", fit),
        ("## Processes and threads", processes_and_threads),
    ):
        parts += [heading, measured(size)]
        # After every part: what was measured is there to be read should a later one be stopped.
        given.output.write_text("\n\n".join(parts) + "\n")
    parts.append(f"Complete benchmark: {time.perf_counter() - began:.0f} s.")
    given.output.write_text("\n\n".join(parts) + "\n")
    print(given.output.read_text())


INTRODUCTION = f"""
The plan: the double pendulum of the thesis for {SPAN:g} s, with a mass of the second bob from 1 to
3 kg and an angle of both from 30 to 90 degrees, drawn at random for each run. All codes use
{CORES} cores, begin with the numbers of the samples, and end with the positions at the output
times. `python -m benchmarks.batches` repeats it.

*Computed* is the processor's time of all processes and threads of a batch, from start to end, which
the load on the machine changes little; *on the clock* is what one waited beside that load. The loop
is the `loop` of `run.json`, with the first step, which scipy solves, and without the companion of
the error estimate.
""".strip()


def plan_of_thousand(size: Size) -> str:
    """The plan in 1000 steps of the default scheme, each with a row in all tables."""
    lines = ["| error estimate | tables | runs | computed [ms per run] | loop [ms per run] | "
             "computed over loop | clock [s] | loops by the clock / 2 [s] | ratio of these |",
             "|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for estimate, tables, count in (
        ("off", None, size.plan),
        ("estimate", None, size.plan // 20),
    ):
        options = {**THOUSAND, "error": estimate}
        ours.take(samples(20), options, jobs=1)  # compiles, if that was not done
        of_loops = ours.computed_by_loops(samples(size.compared), options) / size.compared
        taken = ours.take(samples(count), options, tables)
        cells = [estimate, "all" if tables is None else ", ".join(tables), str(count)]
        cells += [f"{taken.computed / count * 1e3:.2f}", f"{of_loops * 1e3:.2f}"]
        cells += [f"{taken.computed / count / of_loops:.2f}", f"{taken.seconds:.1f}"]
        cells += [f"{taken.loops / CORES:.1f}", f"{taken.seconds / (taken.loops / CORES):.2f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def processes_and_threads(size: Size) -> str:
    """The same runs in one process, in two threads of it, and in two processes."""
    plan, options = samples(size.compared), {**THOUSAND, "error": "off"}
    model = msahl.load(DECK)

    def run(sample: Sample) -> None:
        model.with_(**sample._asdict()).run(**options)  # type: ignore[arg-type]

    def threads() -> None:
        with ThreadPoolExecutor(CORES) as pool:
            list(pool.map(run, plan))

    timed = {
        "one process": _median(lambda: ours.take(plan, options, jobs=1), size),
        f"{CORES} threads": _median(threads, size),
        f"{CORES} processes": _median(lambda: ours.take(plan, options), size),
    }
    rows = [f"| {name} | {seconds / size.compared * 1e3:.2f} |" for name, seconds in timed.items()]
    return "\n".join(["| | on the clock [ms per run] |", "|---|---|", *rows])


def fit(size: Size) -> str:
    """A mass and an angle found from a motion, one run after the other."""
    model, spent = msahl.load(DECK), [0.0, 0.0, 0.0]
    options = {**THOUSAND, "output_interval": 0.1}
    wanted = model.with_(m=1.7, phi=62.0).run(**options)["2ndBall.x"]  # type: ignore[arg-type]

    def residual(p: np.ndarray, estimate: str | None) -> np.ndarray:
        sample = Sample(*map(float, p))._asdict()
        result = model.with_(**sample).run(**options, error=estimate)  # type: ignore[arg-type]
        spent[0] += result.seconds["loop"]
        spent[1] += result.seconds.get("companion", 0.0)
        spent[2] += 1.0
        found: np.ndarray = result["2ndBall.x"] - wanted
        return found

    lines = ["| error estimate | runs | seconds | loops [s] | companions [s] | beyond both [s] |",
             "|---|---|---|---|---|---|"]  # fmt: skip
    for estimate in ("off", None):
        spent[:] = [0.0, 0.0, 0.0]
        began = time.perf_counter()
        found = least_squares(residual, (2.4, 50.0), args=(estimate,), max_nfev=30)
        while spent[2] < size.fit:  # a fit of more parameters
            residual(found.x, estimate)
        seconds = time.perf_counter() - began
        beyond = seconds - spent[0] - spent[1]
        cells = ["off" if estimate else "default", f"{spent[2]:.0f}", f"{seconds:.2f}"]
        cells += [f"{spent[0]:.2f}", f"{spent[1]:.2f}", f"{beyond:.2f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


@dataclass(frozen=True)
class Entry:
    """A code with the step whose error is small enough, and what carries out its plan."""

    name: str
    h: float
    error: float
    count: int
    seconds: Callable[[], tuple[float, float]]  # on the clock, and computed


def at_equal_error(size: Size) -> str:
    """Every code with the largest step whose error is small enough."""
    checked = samples(CHECKED, seed=1)
    true = ours.positions(checked, "gauss5", GRID / 48)
    lines = ["| largest error [m] | code | step [s] | its error [m] | runs | "
             "computed [ms per run] | runs per second of two cores | on the clock |",
             "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for target in TARGETS:
        entries = [best_of_ours(checked, true, target, size)]
        for package, peer in PEERS.items():
            entry = peer_entry(package, peer, checked, true, target, size)
            if entry is None:
                lines.append(f"| {target:g} | {package} | | not reached | | | | |")
            else:
                entries.append(entry)
        taken = [[entry.seconds() for entry in entries] for _ in range(size.repeats)]
        for entry, seconds in zip(entries, zip(*taken, strict=True), strict=True):
            clock, computed = (statistics.median(of) for of in zip(*seconds, strict=True))
            cells = [f"{target:g}", entry.name, f"{entry.h:.4g}", f"{entry.error:.1e}"]
            cells += [str(entry.count), f"{computed / entry.count * 1e3:.2f}"]
            cells += [f"{CORES * entry.count / computed:.0f}", f"{entry.count / clock:.0f}"]
            lines.append(f"| {' | '.join(cells)} |")
    missing = [f"{package} is missing ({why})" for package, why in MISSING.items()]
    return "\n".join([*lines, "", NOTES, *missing])


def best_of_ours(checked: Sequence[Sample], true: np.ndarray, target: float, size: Size) -> Entry:
    """Return the scheme of msahl that makes most runs per second with errors below ``target``."""

    few, plan = samples(max(20, size.compared // 5)), samples(size.compared)
    entries, seconds = [], []
    for scheme in ours.SCHEMES if target >= LEAST_OF_ORDER_2 else ours.SCHEMES[1:]:
        found = largest_step(partial(_error_of_ours, checked, true, scheme), target)
        if found is not None:
            options = ours.options(scheme, found[0])
            seconds.append(ours.take(few, options, ["states"], jobs=1).computed)
            run = partial(_take, plan, options)
            entries.append(Entry(f"msahl {scheme}", *found, len(plan), run))
    return entries[seconds.index(min(seconds))]


def _error_of_ours(checked: Sequence[Sample], true: np.ndarray, scheme: str, h: float) -> float:
    return error(ours.positions(checked, scheme, h), true)


def _take(plan: Sequence[Sample], options: dict[str, Any]) -> tuple[float, float]:
    taken = ours.take(plan, options, ["states"])
    return taken.seconds, taken.computed


def peer_entry(
    name: str, peer: Any, checked: Sequence[Sample], true: np.ndarray, target: float, size: Size
) -> Entry | None:
    """Return another code with the largest step good enough; None if there is none."""
    found = largest_step(lambda h: error(peer.positions(checked, h), true), target)
    if found is None:
        return None
    of_one = peer.seconds(samples(2 * CORES), found[0])[0] / (2 * CORES)
    plan = samples(max(2 * CORES, min(size.compared, int(LONGEST / of_one))))
    return Entry(name, *found, len(plan), lambda: peer.seconds(plan, found[0]))


NOTES = """
The error is the largest distance of a mass centre from the truth (gauss5 with 960 steps; MuJoCo
with 10,000 steps agrees to 1e-10 m), of 12 samples and every 0.5 s. Each code takes the largest of
a list of steps whose error is small enough, msahl the best of its schemes; rows are at these times.
msahl: `--solver newton`, the table of states alone, the start of its two processes counted. MuJoCo:
RK4, one compiled model, copies with other masses, `rollout` with two threads, which stores every
state. Exudyn: the fast build, TrapezoidalIndex2 with Euler parameters, a new model for each run.
Medians of batches taken in turn.
""".strip()


def largest_step(error_of: Callable[[float], float], target: float) -> tuple[float, float] | None:
    """Return the largest step with an error of at most ``target`` [m], and its error."""
    for parts in PARTS:
        found = error_of(GRID / parts)
        if found <= target:
            return GRID / parts, found
        # By its order, which is 2, the smallest step will not get there either.
        if found > target * (PARTS[-1] / parts) ** 2 and parts > 50:
            return None
    return None


def _median(run: Callable[[], Any], size: Size) -> float:
    """Return the median time of some repetitions."""
    taken = []
    for _ in range(size.repeats):
        began = time.perf_counter()
        run()
        taken.append(time.perf_counter() - began)
    return statistics.median(taken)


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    main()
