"""What was asked of the loop seconds to an error, beside what was measured."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import NamedTuple

from benchmarks.curves import Curve, Reached
from benchmarks.problems import Problem
from benchmarks.reference import Known
from benchmarks.verdict import Verdict

OURS = "msahl"
JUDGED = (1e-6, 1e-9)
"""Errors [m] at which ratios are asked for."""
AHEAD_OF_EXUDYN, AHEAD_ON_CHAINS, GAUSS3_STEP = 100.0, 3.0, 25.0
AHEAD_ON_SMALL = {1e-6: 0.5, 1e-9: 1.0}
"""Of MuJoCo's RK4, by error."""


class StepCost(NamedTuple):
    """Loop seconds a step, at one step for both."""

    h: float
    gauss3: float
    lowest: float


@dataclass(slots=True)
class Found:
    """All that was found on one problem."""

    problem: Problem
    known: Known
    curves: list[Curve] = field(default_factory=list)
    step: StepCost | None = None

    @property
    def is_chain(self) -> bool:
        return self.problem.name.startswith("chain")

    def best(self, family: str, target: float) -> tuple[str, Reached] | None:
        """The fastest code of a family at an error. A peer's lower bound counts as its seconds:
        it can only be slower. Of ours, what was not reached does not count.
        """
        counted = ("", "<=") if family == OURS else ("", "<=", ">=")
        curves = [c for c in self.curves if c.code.name.startswith(family)]
        reached = [(c.code.name, c.reach(target)) for c in curves]
        reached = [pair for pair in reached if pair[1].how in counted]
        return min(reached, key=lambda pair: pair[1].seconds) if reached else None

    def best_cell(self, family: str, target: float, in_words: Callable[[Reached], str]) -> str:
        """``best`` for a table: its seconds ``in_words``, and the code."""
        best = self.best(family, target)
        if best is None:
            return "-"
        code, reached = best
        return f"{in_words(reached)} ({code.removeprefix(family).strip()})"


def verdicts(found: list[Found]) -> list[Verdict]:
    parts: tuple[Callable[[Found], Iterable[Verdict]], ...] = (_exudyn, _others, _step)
    return [verdict for part in parts for one in found for verdict in part(one)]


def _exudyn(found: Found) -> Iterable[Verdict]:
    for target in JUDGED:
        yield _ratio(found, "exudyn", target, AHEAD_OF_EXUDYN)


def _others(found: Found) -> Iterable[Verdict]:
    for target in JUDGED:
        if found.is_chain:
            yield _ratio(found, "mujoco", target, AHEAD_ON_CHAINS)
            yield _ratio(found, "drake", target, AHEAD_ON_CHAINS)
        else:
            yield _ratio(found, "mujoco", target, AHEAD_ON_SMALL[target])


def _ratio(found: Found, family: str, target: float, asked: float) -> Verdict:
    peer, ours = found.best(family, target), found.best(OURS, target)
    codes = f"{peer[0] if peer else family} / {ours[0] if ours else OURS}"
    what, wanted = f"{found.problem.name}, {target:.0e} m: {codes}", f">= {asked:g}"
    if peer is None or ours is None:
        return Verdict(what, wanted, "not measured", False)
    ratio = peer[1].seconds / ours[1].seconds
    if peer[1].how == "<=":
        return Verdict(what, wanted, f"at most {ratio:.3g}", False)
    bound = "at least " if peer[1].how == ">=" or ours[1].how == "<=" else ""
    return Verdict(what, wanted, f"{bound}{ratio:.3g}", ratio >= asked)


def _step(found: Found) -> Iterable[Verdict]:
    step = found.step
    if step is None:
        return
    ratio = step.gauss3 / step.lowest
    what = f"{found.problem.name}, h = {step.h:g} s: step of gauss3 / of the lowest order"
    yield Verdict(what, f"<= {GAUSS3_STEP:g}", f"{ratio:.3g}", ratio <= GAUSS3_STEP)
