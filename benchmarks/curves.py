"""Error against loop seconds: how each code is refined until it is exact enough, and what it takes.

A code is refined along a ladder: steps in an interval of the common grid (1, 2, 3, 4, 6, 8, ...) or
an accuracy asked for (half a decade a rung). ``trace`` seeks, for each error asked, the two
neighbouring rungs between which it is reached; ``Curve.reach`` interpolates between them.
"""

import math
import statistics
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from types import ModuleType
from typing import NamedTuple

import numpy as np

from benchmarks import equivalent, ours
from benchmarks.motion import Motion
from benchmarks.peers import PEERS
from benchmarks.problems import Problem
from msahl.model.scheme import order_of

LARGEST_ORDER = 10
"""Of our schemes."""
TARGETS = (1e-3, 1e-6, 1e-9)
"""Largest position errors [m] asked for."""
NEAR = 2.0
"""Factor by which the best run may miss an error that its order is then used to extrapolate to."""
COARSEST_ACCURACY = 0.1
MOST_RUNGS = 8
"""Up which a code is taken at once: a step 16 times finer."""
MOST_FAILED = 4
"""Runs that may fail before one has succeeded: each is finer, and takes longer to fail."""
SHORT, UP_A_DECADE = 10, 4
"""Bodies beyond which the ladder is entered further up, by so many rungs for ten times as many:
steps four times smaller, as the fastest motions of a chain are faster by about this factor.
"""
LOST = 0.1
"""Error [m] of a step so large that its iterations say nothing about the cost of finer ones."""
FLOOR, FLAT = 1e-5, 0.8
"""Below the first error [m], one that falls by less than the second factor is round-off's."""
WARMED = 0.001
"""Step [s] at which our kernels are loaded, or compiled, before anything counts."""
MOST_SAMPLES, ENOUGH = 7, 2.5
"""Samples of each run, and the seconds, problems built and all, after which a code gets no more."""


class Code(NamedTuple):
    name: str
    module: ModuleType
    order: int
    controlled: bool = False  # by an accuracy instead of a step
    estimated: bool = False  # see ``benchmarks.equivalent``


@dataclass(slots=True)
class Point:
    """A code at one rung; the error is inf where it gave up."""

    rung: int
    error: float
    samples: list[float] = field(default_factory=list)  # loop seconds of the complete motion
    steps: int = 0
    iterations: int = 0
    note: str = ""

    @property
    def seconds(self) -> float:
        return statistics.median(self.samples) if self.samples else float("nan")


class Reached(NamedTuple):
    """What an error costs: ``how`` is "", "<=" (its coarsest run is better), ">=" (not reached; by
    its order from the best run) or "-" (not at all).
    """

    seconds: float
    how: str
    reason: str = ""


@dataclass(slots=True)
class Curve:
    """One code on one problem."""

    problem: Problem
    code: Code
    points: dict[int, Point] = field(default_factory=dict)
    stopped: str = ""  # why it was refined no more

    def at(self, target: float) -> Point | None:
        """The coarsest run that is as good as ``target``."""
        good = [p for p in self.sorted() if p.error <= target]
        return good[0] if good else None

    def sorted(self) -> list[Point]:
        """Coarsest first."""
        return [self.points[rung] for rung in sorted(self.points)]

    def bracket(self, target: float) -> tuple[Point | None, Point | None]:
        """The finest run before the coarsest that is good enough, and that one."""
        good = self.at(target)
        before = [p for p in self.sorted() if good is None or p.rung < good.rung]
        return (before[-1] if before else None), good

    def reach(self, target: float) -> Reached:
        """Loop seconds for ``target``, on a straight line between two runs in logarithms; a finer
        run that took less, as where large steps converge badly, counts instead.
        """
        worse, good = self.bracket(target)
        if good is None:
            return self._lower_bound(target)
        fastest = min(p.seconds for p in self.sorted() if p.error <= target)
        if worse is None or not math.isfinite(worse.error):
            how = "<=" if fastest == good.seconds else ""
            return Reached(fastest, how, "its coarsest run that succeeds is better")
        share = math.log(worse.error / target) / math.log(worse.error / good.error)
        between = worse.seconds * (good.seconds / worse.seconds) ** share
        return Reached(min(between, fastest), "")

    def _lower_bound(self, target: float) -> Reached:
        finite = [p for p in self.sorted() if math.isfinite(p.error)]
        reason = self.stopped
        if not finite:
            return Reached(float("nan"), "-", reason)
        best = min(finite, key=lambda p: p.error)
        seconds = best.seconds * (best.error / target) ** (1.0 / self.code.order)
        how = "" if best.error <= NEAR * target else ">="
        reason += f"; {best.error:.1e} m in {best.seconds:.3g} s, by its order {self.code.order}"
        return Reached(seconds, how, reason)


def all_codes(problem: Problem) -> list[Code]:
    """Every scheme of ours and the solvers of the peers that are installed."""
    codes = [Code(name, ours, order_of(name.removeprefix("msahl "))) for name in ours.SCHEMES]
    codes += [Code(name, ours, LARGEST_ORDER, controlled=True) for name in ours.BY_TOLERANCE]
    for module in PEERS.values():
        for name in module.VARIANTS:
            controlled = name in getattr(module, "CONTROLLED", ())
            codes.append(Code(name, module, module.ORDERS[name], controlled))
    return [_that_can(code, problem) for code in codes]


def _that_can(code: Code, problem: Problem) -> Code:
    """The code, or what stands for it where it would take hours."""
    if problem.bodies < equivalent.FROM or code.name not in equivalent.TABLEAUS:
        return code
    return code._replace(module=equivalent, estimated=True)


def per_interval(rung: int) -> int:
    """Steps in an interval of the grid: 1, 2, 3, 4, 6, 8, 12, ..."""
    if rung == 0:
        return 1
    return 2 ** ((rung + 1) // 2) if rung % 2 else 3 * 2 ** (rung // 2 - 1)


def fineness(code: Code, rung: int) -> float:
    """A number to whose -1 (accuracies) or -order (steps) power the error goes."""
    return 10.0 ** (rung / 2) if code.controlled else float(per_interval(rung))


def knob(problem: Problem, code: Code, rung: int) -> float:
    """The step [s] or the accuracy asked for."""
    fine = fineness(code, rung)
    return COARSEST_ACCURACY / fine if code.controlled else problem.grid / fine


def run(problem: Problem, code: Code, rung: int) -> Motion:
    if code.controlled:
        motion: Motion = code.module.motion(
            problem.model, problem.grid, problem.rows, code.name, accuracy=knob(problem, code, rung)
        )
        return motion
    k = per_interval(rung)
    h, steps = problem.grid / k, problem.rows * k
    motion = code.module.motion(problem.model, h, steps, code.name, every=k)
    return motion


def trace(problem: Problem, code: Code, exact: np.ndarray, longest: float, budget: float) -> Curve:
    """Runs around every target; none is begun that would take more than ``longest`` seconds in the
    loop, nor any once all took ``budget``.
    """
    curve = Curve(problem, code)
    if code.module is ours:
        accuracy = COARSEST_ACCURACY if code.controlled else None
        warmed = min(WARMED, problem.grid / 8.0)
        ours.motion(problem.model, warmed, 2, code.name, accuracy=accuracy)
    for target in TARGETS:
        for wanted in _wanted(curve, target):
            rung = _affordable(curve, wanted, longest)
            expected = _expected(curve, rung)
            if expected > longest:
                curve.stopped = f"the next run would take {expected:.2g} s"
                return curve
            if _spent(curve) > budget:
                curve.stopped = f"{_spent(curve):.2g} s were spent on its runs"
                return curve
            curve.points[rung] = _measured(curve, rung, exact)
            if len(curve.points) >= MOST_FAILED and not _finite(curve):
                curve.stopped = f"none of {MOST_FAILED} runs succeeds"
                return curve
    return curve


def _spent(curve: Curve) -> float:
    if curve.code.estimated:
        return 0.0
    return sum(sum(p.samples) for p in curve.points.values())


def _measured(curve: Curve, rung: int, exact: np.ndarray) -> Point:
    try:
        motion = run(curve.problem, curve.code, rung)
    except (RuntimeError, ValueError, ArithmeticError) as failure:
        return Point(rung, math.inf, note=" ".join(str(failure).split())[:80])
    error = float(np.linalg.norm(motion.x - exact, axis=-1).max())
    if not math.isfinite(error):
        return Point(rung, math.inf, note="not finite")
    return Point(rung, error, [motion.seconds], motion.steps, motion.iterations)


def _wanted(curve: Curve, target: float) -> Iterator[int]:
    """Rungs to be tried until two neighbours have ``target`` between them."""
    while True:
        worse, good = curve.bracket(target)
        if good is None:
            if worse is None:
                rung = _first(curve)
            elif _at_floor(curve):
                curve.stopped = f"round-off or tolerances: {_best(curve):.1e} m"
                return
            else:
                rung = _finer(curve, target)
        elif worse is None:
            if good.rung <= _foot(curve) or _coarser_is_slower(curve):
                return
            rung = max(_foot(curve), good.rung - 2)
        elif good.rung == worse.rung + 1 or worse.seconds > good.seconds:
            return  # between neighbours; or no coarser run is worth having
        else:
            rung = _between(curve, worse, good, target)
        if rung > 60:
            curve.stopped = "no finer rung"
            return
        yield rung


def _first(curve: Curve) -> int:
    """Where the ladder is entered: at its foot a code of low order has little to say, and a long
    chain, whose quick motions a large step cannot follow, takes long to say it.
    """
    if curve.code.controlled:
        return 4
    return max(0, 8 - curve.code.order) + _up(curve)


def _up(curve: Curve) -> int:
    """Return by how many rungs the fast motions are faster than those of a short chain."""
    series = curve.problem.series or curve.problem.bodies
    return round(UP_A_DECADE * math.log10(max(1.0, series / SHORT)))


def _foot(curve: Curve) -> int:
    """The lowest rung tried: below it no step of a long chain converges but in many halves."""
    return 0 if curve.code.controlled else max(0, _up(curve) - 2)


def _coarser_is_slower(curve: Curve) -> bool:
    """Whether the coarsest step converges so badly that none coarser is worth trying."""
    points = _finite(curve)
    return len(points) > 1 and points[0].seconds > points[1].seconds


def _best(curve: Curve) -> float:
    return min(p.error for p in curve.points.values())


def _finite(curve: Curve) -> list[Point]:
    return [p for p in curve.sorted() if math.isfinite(p.error)]


def _at_floor(curve: Curve) -> bool:
    points = _finite(curve)
    if len(points) < 2 or points[-1].error > FLOOR:
        return False
    return points[-1].error > FLAT * points[-2].error


def _finer(curve: Curve, target: float) -> int:
    """The first rung that should be good enough, by the slope of the two finest runs."""
    code, points = curve.code, _finite(curve)
    last = curve.sorted()[-1].rung
    if not points:
        return last + 2
    order = 1.0 if code.controlled else float(code.order)
    slope = order
    if len(points) > 1:
        a, b = points[-2:]
        ratio = fineness(code, b.rung) / fineness(code, a.rung)
        slope = math.log(a.error / b.error) / math.log(ratio)
    slope = min(max(slope, 0.5 * order), 1.5 * order)
    wanted = fineness(code, points[-1].rung) * (points[-1].error / target) ** (1.0 / slope)
    rung = last + 1
    while fineness(code, rung) < wanted and rung < last + MOST_RUNGS:
        rung += 1
    return rung


def _between(curve: Curve, worse: Point, good: Point, target: float) -> int:
    """The rung where a straight line in logarithms has ``target``."""
    rung = (worse.rung + good.rung) // 2
    if math.isfinite(worse.error) and good.error > 0.0:
        share = math.log(worse.error / target) / math.log(worse.error / good.error)
        rung = round(worse.rung + share * (good.rung - worse.rung))
    return min(max(rung, worse.rung + 1), good.rung - 1)


def _affordable(curve: Curve, rung: int, longest: float) -> int:
    """Return the rung, or, if it is finer than all so far and would take more than ``longest``
    seconds, the finest that does not, at least the next one.
    """
    last = max(curve.points, default=rung)
    while rung > last + 1 and _expected(curve, rung) > longest:
        rung -= 1
    return rung


def _expected(curve: Curve, rung: int) -> float:
    """Loop seconds of a run, by the nearest one there is."""
    points = _finite(curve)
    if not points:
        return 0.0
    code, followed = curve.code, [p for p in points if p.error <= LOST]
    near = min(followed or points, key=lambda p: abs(p.rung - rung))
    if code.estimated:
        return curve.problem.rows * per_interval(rung) * equivalent.SECONDS
    if near.error > LOST:
        return near.seconds
    power = 1.0 / code.order if code.controlled else 1.0
    return near.seconds * (fineness(code, rung) / fineness(code, near.rung)) ** power


def take_samples_in_turn(curves: list[Curve], enough: float = ENOUGH) -> None:
    """Further samples of the runs next to the targets, code after code, none of a code that has
    used ``enough`` seconds.
    """
    measured = [curve for curve in curves if not curve.code.estimated]
    wanted = [(curve, point) for curve in measured for point in _next_to_targets(curve)]
    spent = dict.fromkeys((curve.code.name for curve in measured), 0.0)
    for _ in range(1, MOST_SAMPLES):
        for curve, point in wanted:
            name = curve.code.name
            if spent[name] + point.seconds < enough:
                began = time.perf_counter()
                point.samples.append(run(curve.problem, curve.code, point.rung).seconds)
                spent[name] += time.perf_counter() - began


def _next_to_targets(curve: Curve) -> list[Point]:
    near = {p.rung: p for t in TARGETS for p in curve.bracket(t) if p and p.samples}
    return [near[rung] for rung in sorted(near)]
