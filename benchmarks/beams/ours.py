"""Beams by msahl: elements of degree 2 to 4; equilibria, and motions by schemes of order 2 to 6."""

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

import msahl
from benchmarks.beams.problems import Problem, deck
from benchmarks.beams.setting import FailedRunError, Outcome, Setting
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.model import Model, Options
from msahl.model.scheme import split
from msahl.model.settings import OFF
from msahl.run.loop import Hooks, run
from msahl.run.report import COMPLETED
from msahl.run.tables import STATES, MemorySink
from msahl.start.velocities import StartError

NAME = "msahl"
VERSION = msahl.__version__
DEGREES = (2, 3, 4)
LONGEST = 3.0
"""Seconds after which a run is stopped."""
PARTS = {"preserving": (5, 10, 20, 40), "gauss2": (1, 2, 5, 10, 20), "gauss3": (1, 2, 5, 10)}
"""Steps in an interval of output times."""


def settings(problem: Problem) -> Iterator[Setting]:
    """Yield all runs that are tried, coarse ones first."""
    for degree in DEGREES:
        if not problem.end:
            yield from (Setting(f"degree {degree}", n) for n in (2, 4, 8, 16) if n * degree <= 32)
            continue
        for scheme, n in itertools.product(PARTS, (2, 4, 8)):
            for part in PARTS[scheme]:
                yield Setting(f"degree {degree}, {scheme}", n, problem.interval / part)


def solve(problem: Problem, setting: Setting) -> Outcome:
    """Make one run."""
    words = setting.family.split(", ")
    degree = int(words[0].removeprefix("degree "))
    model = msahl.load(deck(problem, setting.elements, degree)).records
    if setting.step is None:
        return _rest(problem, model)
    return _motion(problem, model, words[1], setting.step)


def _rest(problem: Problem, model: Model) -> Outcome:
    began = time.process_time()
    try:
        point = search_start(model)
        started = time.process_time()
        found = find(point, np.zeros(3))
    except (StartError, np.linalg.LinAlgError) as failure:
        raise FailedRunError(str(failure)) from failure
    ended = time.process_time()
    if found is None:
        raise FailedRunError("no equilibrium was found")
    x = found.place.point.state.x[_nodes(problem, model)]
    return Outcome(x[None], ended - started, started - began, found.iterations)


def _motion(problem: Problem, model: Model, scheme: str, step: float) -> Outcome:
    """The loop without the preparation of a run. Its seconds are the processor's."""
    name, degree = split(scheme)
    simulation = replace(
        model.simulation,
        scheme=name,
        degree=degree or model.simulation.degree,
        dt=step,
        t_final=problem.end,
    )
    every = round(problem.interval / step)
    rows, options = MemorySink(only=(STATES,)), Options(solver="newton", error=OFF, every=every)
    began = time.process_time()
    limit = Hooks(stopped=lambda: time.process_time() - began > LONGEST)
    report = run(replace(model, simulation=simulation), options, rows, limit, checked=True)
    total = time.process_time() - began
    if report.status != COMPLETED:
        raise FailedRunError(report.message)
    table = rows.table(STATES)[:, 1:].reshape(-1, len(model.bodies), 4, 3)
    loop = report.seconds["loop"]
    x = table[:, _nodes(problem, model), 0]
    return Outcome(x, loop, total - loop, report.iterations)


def _nodes(problem: Problem, model: Model) -> list[int]:
    """Return the nodes at the points that are compared; the bodies of the model are its nodes."""
    return [round(share * (len(model.bodies) - 1)) for share in problem.points]
