"""Loop seconds to an error of nine mechanisms.

    python -m benchmarks.mechanisms.measure [NAME...] [--page] [-o DIR]

Writes mechanisms_errors.csv, mechanisms_seconds.csv, mechanisms.md and mechanisms.png. Other
mechanisms keep what was measured before, so that they may be measured one at a time.
"""

import argparse
import time
from contextlib import suppress
from pathlib import Path

from benchmarks import ours
from benchmarks.curves import Code, Curve, take_samples_in_turn, trace
from benchmarks.machine import describe
from benchmarks.mechanisms.clock import processor_time
from benchmarks.mechanisms.page import write_page
from benchmarks.mechanisms.problems import MODELS, described, mechanism
from benchmarks.mechanisms.store import LARGE, Refused, codes, load, save
from benchmarks.mechanisms.truth import true_motion
from benchmarks.precision_asked import Found
from benchmarks.problems import Problem
from benchmarks.speed import RESULTS, tell

LIMITS = {1: (1.0, 2.5), 50: (4.0, 8.0)}
"""Loop seconds of one run and of all runs of a code, by least number of bodies."""


ENOUGH = 1.0
"""Seconds, problems built and all, after which a code gets no more samples."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(MODELS))
    parser.add_argument("--code", default="", help="only codes with this in their names")
    parser.add_argument("--page", action="store_true", help="write the page from what is stored")
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, metavar="DIR")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    machine = [] if options.page else describe()
    for name in [] if options.page else options.names or list(MODELS):
        with processor_time():
            measure(mechanism(name), options.code, options.output)
    write_page(load(map(described, MODELS), options.output), machine, options.output)


def measure(problem: Problem, wanted: str, folder: Path) -> None:
    """Measure every code with ``wanted`` in its name and save what was found."""
    tell(f"{problem.name}: reference")
    found = Found(problem, true_motion(problem))
    limits = LIMITS[max(n for n in LIMITS if n <= problem.bodies)]
    refused: list[Refused] = []
    for code in codes(problem):
        if isinstance(code, Refused):
            refused.append(code)
        elif wanted in code.name:
            _warm(problem, code)
            began = time.perf_counter()
            found.curves.append(trace(problem, code, found.known.x, *limits))
            tell(f"{problem.name}: {code.name}, {time.perf_counter() - began:.1f} s")
    take_samples_in_turn([curve for curve in found.curves if worth(curve)], ENOUGH)
    save(found, refused, folder)


def _warm(problem: Problem, code: Code) -> None:
    """Compile what the largest steps need, which fail to converge and are subdivided."""
    if code.module is ours and not code.controlled and problem.bodies < LARGE:
        with suppress(RuntimeError, ValueError, ArithmeticError):
            ours.motion(problem.model, problem.grid, 2, code.name)


def worth(curve: Curve) -> bool:
    """Whether a code came so far that its seconds matter."""
    return any(point.error < 1e-3 for point in curve.points.values())


if __name__ == "__main__":
    main()
