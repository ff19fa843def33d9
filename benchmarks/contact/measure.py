"""Error against seconds of scenes with contact.

    python -m benchmarks.contact.measure [NAME...] [--page] [-o DIR]

Writes contact_errors.csv, contact_seconds.csv, contact_creep.csv, contact.md and contact.png. Other
scenes keep what was measured before, so that they may be measured one at a time.
"""

import argparse
import time
from contextlib import suppress
from pathlib import Path

from benchmarks import ours
from benchmarks.contact import creep
from benchmarks.contact.codes import KEPT, codes
from benchmarks.contact.page import write_page
from benchmarks.contact.scenes import SCENES, scene
from benchmarks.contact.truth import true_motion
from benchmarks.curves import Code, take_samples_in_turn, trace
from benchmarks.machine import describe
from benchmarks.mechanisms.clock import processor_time
from benchmarks.mechanisms.measure import worth
from benchmarks.mechanisms.store import Refused, load, save
from benchmarks.precision_asked import Found
from benchmarks.problems import Problem
from benchmarks.speed import RESULTS, tell

LIMITS = (0.4, 1.2)
"""Loop seconds of one run and of all runs of a code."""
LARGE, LARGE_LIMITS = 10, (2.5, 4.0)
"""The same from so many bodies on."""
ENOUGH = 0.2
"""Seconds, problems built and all, after which a code gets no more samples."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SCENES))
    parser.add_argument("--code", default="", help="only codes with this in their names")
    parser.add_argument("--page", action="store_true", help="write the page from what is stored")
    parser.add_argument("-o", "--output", type=Path, default=RESULTS, metavar="DIR")
    options = parser.parse_args()
    options.output.mkdir(parents=True, exist_ok=True)
    machine = [] if options.page else describe()
    for name in [] if options.page else options.names or list(SCENES):
        with processor_time():
            measure(scene(name), options.code, options.output)
    write_page(load(map(scene, SCENES), options.output, KEPT), machine, options.output)


def measure(problem: Problem, wanted: str, folder: Path) -> None:
    """Measure every code with ``wanted`` in its name and save what was found."""
    tell(f"{problem.name}: reference")
    found = Found(problem, true_motion(problem))
    limits = LARGE_LIMITS if problem.bodies >= LARGE else LIMITS
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
    save(found, refused, folder, KEPT)
    if problem.name == creep.SCENE:
        creeps = map(creep.creep_of, found.curves)
        creep.save([one for one in creeps if one is not None], folder)


def _warm(problem: Problem, code: Code) -> None:
    """Load the kernels of all modes of the contacts, which a short run does not reach."""
    if code.module is ours and not code.controlled:
        with suppress(RuntimeError, ValueError, ArithmeticError):
            ours.motion(problem.model, problem.grid, problem.rows, code.name)


if __name__ == "__main__":
    main()
