"""The verdict on a run: PASS, WARN or FAIL, check by check, with the reasons in words.

A figure within its limit passes, beyond it warns, and far beyond it fails. Ours are tight, as what
is kept is kept to round-off; a figure that fails spoils the motion. No limit is taken below the
round-off of what a figure is the difference of.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from sys import float_info
from typing import NamedTuple

from msahl.model import Limits

PASS, WARN, FAIL = WORDS = ("PASS", "WARN", "FAIL")

BETWEEN = 10.0
"""Times a limit of the deck up to which a figure is only warned of."""
ENERGY, ENERGY_SPOILT = 1e-8, 1e-3
"""Of the largest kinetic energy. A million steps of the preserving scheme drift by 1e-12 or so."""
GAP, GAP_SPOILT = 1e-9, 1e-5
"""Of the longest body; steps close their joints to 1e-14 of it."""
MOMENTUM, MOMENTUM_SPOILT = 1e-9, 1e-4
"""Of the momenta's own sizes."""
GAP_RATE = 0.05
"""Of the highest speed: more says that the step is large, never that the run is bad."""
LOCAL_ERROR = 0.01
"""Of the scene's length, the longest body or way: what the steps' local errors may add up to where
no accuracy is asked for."""
UNSEEN = 0.05
"""Of the way at the highest speed: a step's local error beyond which something moves to and fro in
hardly more than a step or two. Resolved motions have a twelfth of their turn a step, squared."""
TAKEN = 0.01
"""Of the largest kinetic energy: what a scheme of higher order may take from what it resolves. From
a vibration it takes twice what it takes from the amplitude, which is then its largest error."""
FARTHER = 2.0
"""Of the longest way that a body has got from where it began: a step's way at the highest speed
beyond which it goes to and fro within a step. A vibration then makes a third of a turn a step."""
GAP_WORK = 1e-8
"""Of the largest kinetic energy, over one step."""
CONDITION = 1e13
"""Spread of the pivots beyond which a step's solution keeps fewer than three digits."""
MOST_TOLD = 8
"""Joints that a finding names; all are in ``run.json`` under ``sharedReactions``."""
CHANGED = 1e-6
"""Of the highest speed: change of the velocities at the start that a reader must know."""
ROUND_OFF = 1e3 * float_info.epsilon
"""Of a sum's largest term: what its digits may have lost over a run."""


class Finding(NamedTuple):
    """What one check found."""

    check: str
    word: str
    text: str


@dataclass(frozen=True, slots=True)
class Verdict:
    """All findings; the worst of them is the word."""

    findings: tuple[Finding, ...]

    @property
    def word(self) -> str:
        """PASS, WARN or FAIL."""
        return max((f.word for f in self.findings), key=WORDS.index)

    @property
    def reasons(self) -> list[str]:
        """Why it is not PASS, the worst first."""
        bad = [f for f in self.findings if f.word != PASS]
        return [f.text for f in sorted(bad, key=lambda f: -WORDS.index(f.word))]

    def as_json(self) -> dict[str, object]:
        """As ``run.json`` has it."""
        checks = {f.check: {"word": f.word, "text": f.text} for f in self.findings}
        return {"word": self.word, "reasons": self.reasons, "checks": checks}


@dataclass(frozen=True, slots=True)
class Figures:
    """All that is judged of a run. Lengths in m, speeds in m/s, energies in J, times in s.

    ``momentum`` are the parts of linear and angular momentum lost by what nothing outside pulls at,
    None if there is no such island or the scheme does not keep it; ``condition`` is None if no
    Jacobian was factored or redundant joints make it large by themselves.
    """

    status: str
    time: float
    steps: int
    iterations: int
    halvings: int
    root_steps: int
    joints: int
    dt: float
    tolerance: float | None  # by which the steps were chosen [m]
    length: float  # of the longest body
    energy_size: float  # largest of the energies the balance is a difference of
    extremes: dict[str, float | None]
    momentum: tuple[float | None, float | None]
    condition: float | None
    velocity_change: float
    shared: dict[str, list[str]]  # columns of reactions that are not unique, by element
    shadow: dict[str, float | bool] | None

    def extreme(self, name: str) -> float:
        """A figure of the run that is known."""
        value = self.extremes[name]
        return float("nan") if value is None else value


def never_begun(status: str) -> Verdict:
    """The verdict on a run that took no step."""
    return Verdict((Finding("end", FAIL, status),))


def judge(figures: Figures, limits: Limits) -> Verdict:
    """The verdict on a run by the deck's ``limits``."""
    return Verdict(tuple(f for check in CHECKS for f in check(figures, limits)))


def grade(value: float, limit: float, spoilt: float) -> str:
    """Word for a figure; a nan fails."""
    if value <= limit:
        return PASS
    return WARN if value <= max(limit, spoilt) else FAIL


def _asked(limit: float | None, own: float, spoilt: float) -> tuple[float, float]:
    """Where a figure begins to warn and to fail: by the deck, or else by our own limits."""
    return (own, spoilt) if limit is None else (limit, BETWEEN * limit)


def _end(of: Figures, limits: Limits) -> Iterator[Finding]:
    words = {"completed": PASS, "interrupted": WARN}
    ended = "" if of.status == "completed" else f"{of.status} after "
    text = f"{ended}{of.steps} steps to t = {of.time:g} s"
    yield Finding("end", words.get(of.status, FAIL), text)


def _energy(of: Figures, limits: Limits) -> Iterator[Finding]:
    error, kinetic = of.extreme("energyErrorMax"), of.extreme("largestKineticEnergy")
    floor = ROUND_OFF * of.energy_size
    if of.extremes["energyErrorMaxRelative"] is None:
        word = grade(error, floor, floor)
        yield Finding("energy", word, f"nothing moves, and the energy is off by {error:.1e} J")
        return
    # Places that may be wrong by so much make energies wrong by as much.
    own = max(ENERGY, BETWEEN * (of.tolerance or 0.0) / of.length)
    limit, spoilt = _asked(limits.energy, own, max(ENERGY_SPOILT, own))
    word = grade(error, max(limit * kinetic, floor), spoilt * kinetic)
    kept = "kept" if word == PASS else "kept only"
    units = error / (float_info.epsilon * of.energy_size)
    text = f"energy {kept} to {error / kinetic:.1e} of the largest kinetic energy"
    taken = of.extremes.get("energyTaken")
    more = f"; the scheme took {taken / kinetic:.1e} of it" if taken else ""
    yield Finding("energy", word, f"{text} ({units:.0f} units of round-off){more}")


def _momentum(of: Figures, limits: Limits) -> Iterator[Finding]:
    for kind, lost in zip(("linear", "angular"), of.momentum, strict=True):
        if lost is not None:
            word = grade(lost, MOMENTUM, MOMENTUM_SPOILT)
            yield Finding(f"{kind} momentum", word, f"{kind} momentum kept to {lost:.1e} of itself")


def _gap(of: Figures, limits: Limits) -> Iterator[Finding]:
    if not of.joints:
        return
    gap = of.extreme("gapMax")
    floor = ROUND_OFF * of.extreme("distanceMax")
    limit, spoilt = _asked(limits.gap, GAP * of.length, GAP_SPOILT * of.length)
    word = grade(gap, max(limit, floor), spoilt)
    how = "closed" if word == PASS else "closed only"
    yield Finding("gap", word, f"joints {how} to {gap:.1e} m")


def _gap_rate(of: Figures, limits: Limits) -> Iterator[Finding]:
    if not of.joints:
        return
    rate, speed = of.extreme("gapRateMax"), of.extreme("speedMax")
    floor = ROUND_OFF * of.extreme("distanceMax") / of.dt
    word = PASS if rate <= max(GAP_RATE * speed, floor) else WARN
    part = f", {rate / speed:.1e} of the highest speed" if speed else ""
    advice = "" if word == PASS else ": the step is large for this motion; shorten it"
    text = f"joints part at up to {rate:.1e} m/s at the rows{part}{advice}"
    yield Finding("gap rate", word, text)


def _work(of: Figures, limits: Limits) -> Iterator[Finding]:
    if not of.joints:
        return
    work, kinetic = of.extreme("gapWorkMax"), of.extreme("largestKineticEnergy")
    word = PASS if work <= max(GAP_WORK * kinetic, ROUND_OFF * of.energy_size) else WARN
    yield Finding("work of the joints", word, f"joints' forces have {work:.1e} J in their gaps")


def _newton(of: Figures, limits: Limits) -> Iterator[Finding]:
    each = of.iterations / max(of.steps, 1)
    text = f"{each:.1f} iterations a step"
    if of.root_steps:
        text += f", {of.root_steps} steps by scipy"
    if of.halvings:
        text += (
            f"; hard steps were halved {of.halvings} times: something is too quick for the step; "
            "look there, and shorten it"
        )
    yield Finding("solver", WARN if of.halvings else PASS, text)


def _condition(of: Figures, limits: Limits) -> Iterator[Finding]:
    if of.condition is not None:
        word = PASS if of.condition <= CONDITION else WARN
        advice = "" if word == PASS else ": near a singular position, or sizes too far apart"
        text = f"pivots of the Jacobian spread over {of.condition:.1e}{advice}"
        yield Finding("condition", word, text)


def _reactions(of: Figures, limits: Limits) -> Iterator[Finding]:
    if of.shared:
        told = dict(list(of.shared.items())[:MOST_TOLD])
        more = len(of.shared) - len(told)
        text = (
            "joints are redundant: motion and energy are unique, these reactions are not: "
            f"{describe_shared(told)}{f'; and of {more} more' if more else ''}"
        )
        yield Finding("reactions", PASS, text)


def describe_shared(shared: dict[str, list[str]]) -> str:
    """Reactions, or components of them, that are not unique, in words."""
    return "; ".join(f"{name}: {', '.join(columns)}" for name, columns in shared.items())


def _start(of: Figures, limits: Limits) -> Iterator[Finding]:
    speed = max(of.extreme("speedMax"), of.velocity_change)
    if of.velocity_change > CHANGED * speed:
        rate = f"{of.velocity_change:.1e} m/s"
        text = f"the deck's velocities do not fit its joints (by {rate}); see the warnings"
        yield Finding("start", WARN, text)


def _accuracy(of: Figures, limits: Limits) -> Iterator[Finding]:
    """Of two runs if there are, else of the steps' local errors."""
    yield _trust(of) if of.shadow else _local(of)


def _trust(of: Figures) -> Finding:
    shadow: dict[str, float | bool] = of.shadow or {}
    tolerance = float(shadow["tolerance"])
    way, turn = float(shadow["positionApartMax"]), float(shadow["turnApartMax"])
    apart = max(way, turn)
    word = grade(apart, tolerance, BETWEEN * tolerance)
    measure = "positions" if way >= turn else "turns, times the bodies' lengths,"
    text = f"at half the step {measure} are the same to {apart:.1e} m"
    if not shadow["agrees"]:
        word = WARN if word == PASS else word
        text = (
            f"trust horizon t = {shadow['trustHorizon']:g} s: up to there the run at half the step "
            f"agrees within {tolerance:g} m; {measure} come to differ by {apart:.1e} m"
        )
    elif word == PASS and (sign := _hidden(of, tolerance)):
        word = WARN
        text += f", yet something vibrates quicker than both steps: {sign}"
    return Finding("accuracy", word, text)


def _hidden(of: Figures, tolerance: float) -> str:
    """The sign of a vibration that hides between the rows of both runs, whose steps see it as
    nothing; empty if there is none.
    """
    if of.tolerance is not None:
        return ""
    way = of.dt * of.extreme("speedMax")
    if of.extremes["localErrorSum"] is None:
        return _unresolved(of) if way > BETWEEN * tolerance else ""
    quick = of.extreme("localErrorMax") > UNSEEN * way
    total = of.extreme("localErrorSum")
    return f"local errors add up to {total:.1e} m" if quick and total > BETWEEN * tolerance else ""


def _unresolved(of: Figures) -> str:
    """The sign, in a run of higher order, of motions that its steps do not resolve; empty if there
    is none.
    """
    taken, kinetic = of.extremes.get("energyTaken") or 0.0, of.extreme("largestKineticEnergy")
    if kinetic and taken > TAKEN * kinetic:
        return f"the scheme took {taken / kinetic:.1e} of the largest kinetic energy"
    # No less than the fastest mass centre's: highest speeds are told with those of turning.
    way = min(of.dt, of.time) * of.extreme("speedMax") - of.length * of.extreme("turnPerStepMax")
    if way > FARTHER * of.extreme("wayMax"):
        farthest = f"{of.extreme('wayMax'):.1e} m from where it began"
        return f"a body goes {way:.1e} m a step, and at no step's end is more than {farthest}"
    return ""


def _local(of: Figures) -> Finding:
    if of.extremes["localErrorSum"] is None:
        sign = _unresolved(of)
        if not sign:
            return Finding("accuracy", PASS, "accuracy not estimated: --shadow TOL tells")
        text = f"the step is large for something that moves: {sign}"
        return Finding("accuracy", WARN, f"{text}; --shadow TOL tells how far to trust the run")
    total, length = of.extreme("localErrorSum"), max(of.length, of.extreme("wayMax"))
    if of.tolerance is not None:
        word = grade(total, of.tolerance, BETWEEN * of.tolerance)
        text = f"own errors of the steps add up to {total:.1e} m ({of.tolerance:g} m asked)"
        return Finding(
            "accuracy", word, f"{text}; --shadow TOL tells what the motion makes of them"
        )
    text = f"local errors add up to {total:.1e} m"
    if total <= LOCAL_ERROR * length:
        return Finding("accuracy", PASS, text)
    enough = of.dt * (LOCAL_ERROR * length / total) ** 0.5
    return Finding(
        "accuracy",
        WARN,
        f"{text} in a scene of {length:.1e} m: --dt {enough:.1g} would do, and --shadow TOL tells "
        "how far to trust the run",
    )


CHECKS: tuple[Callable[[Figures, Limits], Iterator[Finding]], ...] = (
    _end,
    _accuracy,
    _energy,
    _momentum,
    _gap,
    _gap_rate,
    _work,
    _newton,
    _condition,
    _reactions,
    _start,
)
"""All checks, in the order they are told in."""
