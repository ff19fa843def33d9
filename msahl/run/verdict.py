"""The verdict on a run: PASS, DONE, WARN or FAIL, check by check, with the reasons in words.

A figure within its limit passes, beyond it warns, and far beyond it fails. Our limits are tight, as
what is kept is kept to round-off; a figure that fails spoils the motion. No limit is below the
round-off of what a figure is the difference of. PASS promises that the global error is known and
small; a run whose error was not estimated can be no better than DONE.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from sys import float_info
from typing import Any, NamedTuple

from msahl.model import Limits

PASS, DONE, WARN, FAIL = WORDS = ("PASS", "DONE", "WARN", "FAIL")

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
ERROR, ERROR_SPOILT = 0.01, 0.3
"""Parts of the model's size, the longest body or the longest way of one: global errors of positions
and orientations beyond which a run warns, where no accuracy is asked for, and fails."""
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
SPINS = 0.1
"""Rotation in a step [rad] from which its tangent is 1e-3 of it off."""
MOST_TOLD = 8
"""Joints that a finding names; all are in ``run.json`` under ``nonUniqueReactions``."""
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
        """PASS, DONE, WARN or FAIL."""
        return max((f.word for f in self.findings), key=WORDS.index)

    @property
    def reasons(self) -> list[str]:
        """Why it is not PASS, the worst first."""
        bad = [f for f in self.findings if f.word in (WARN, FAIL)]
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
    subdivisions: int
    scipy_steps: int
    joints: int
    dt: float
    order: int  # of the scheme
    by_cayley: bool  # whether the tangent of a step's rotation is its mean angular velocity
    tolerance: float | None  # of the global error [m], by which the steps were chosen
    local_tolerance: float | None  # of the sum of local errors [m], likewise
    length: float  # of the longest body
    energy_size: float  # largest of the energies the balance is a difference of
    extremes: dict[str, float | None]
    momentum: tuple[float | None, float | None]
    condition: float | None
    velocity_change: float
    shared: dict[str, list[str]]  # columns of reactions that are not unique, by element
    error: dict[str, Any] | None  # as ``msahl.error_estimate`` tells it
    horizon: Callable[[float], float] | None  # time [s] up to which the error is within so many m

    @property
    def size(self) -> float:
        """Size of the model [m]: its longest body, or the longest way of one if that is longer."""
        return max(self.length, self.extreme("displacementMax"))

    def extreme(self, name: str) -> float:
        """A figure of the run that is known."""
        value = self.extremes[name]
        return float("nan") if value is None else value


def never_begun(status: str) -> Verdict:
    """The verdict on a run that took no step."""
    return Verdict((Finding("completion", FAIL, status),))


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
    yield Finding("completion", words.get(of.status, FAIL), text)


def _energy(of: Figures, limits: Limits) -> Iterator[Finding]:
    error, kinetic = of.extreme("energyErrorMax"), of.extreme("largestKineticEnergy")
    floor = ROUND_OFF * of.energy_size
    if of.extremes["energyErrorMaxRelative"] is None:
        word = grade(error, floor, floor)
        yield Finding("energy", word, f"nothing moves, and the energy is off by {error:.1e} J")
        return
    # Places that may be wrong by so much make energies wrong by as much.
    own = max(ENERGY, BETWEEN * (of.tolerance or of.local_tolerance or 0.0) / of.length)
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
            yield Finding(f"{kind}Momentum", word, f"{kind} momentum kept to {lost:.1e} of itself")


def _gap(of: Figures, limits: Limits) -> Iterator[Finding]:
    if not of.joints:
        return
    violation = of.extreme("constraintViolationMax")
    floor = ROUND_OFF * of.extreme("distanceMax")
    limit, spoilt = _asked(limits.violation, GAP * of.length, GAP_SPOILT * of.length)
    word = grade(violation, max(limit, floor), spoilt)
    how = "closed" if word == PASS else "closed only"
    yield Finding("constraintViolation", word, f"joints {how} to {violation:.1e} m")


def _gap_rate(of: Figures, limits: Limits) -> Iterator[Finding]:
    if not of.joints:
        return
    rate, speed = of.extreme("constraintViolationRateMax"), of.extreme("speedMax")
    floor = ROUND_OFF * of.extreme("distanceMax") / of.dt
    word = PASS if rate <= max(GAP_RATE * speed, floor) else WARN
    part = f", {rate / speed:.1e} of the highest speed" if speed else ""
    advice = "" if word == PASS else ": the step is large for this motion; shorten it"
    text = f"joints part at up to {rate:.1e} m/s at the rows{part}{advice}"
    yield Finding("constraintViolationRate", word, text)


def _work(of: Figures, limits: Limits) -> Iterator[Finding]:
    if not of.joints:
        return
    work, kinetic = of.extreme("constraintWorkMax"), of.extreme("largestKineticEnergy")
    word = PASS if work <= max(GAP_WORK * kinetic, ROUND_OFF * of.energy_size) else WARN
    yield Finding("constraintWork", word, f"joints' forces have {work:.1e} J in their gaps")


def _newton(of: Figures, limits: Limits) -> Iterator[Finding]:
    each = of.iterations / max(of.steps, 1)
    text = f"{each:.1f} iterations a step"
    if of.scipy_steps:
        text += f", {of.scipy_steps} steps by scipy"
    if of.subdivisions:
        text += (
            f"; hard steps were halved {of.subdivisions} times: a motion is too fast for the step; "
            "look there, and shorten it"
        )
    yield Finding("solver", WARN if of.subdivisions else PASS, text)


def _condition(of: Figures, limits: Limits) -> Iterator[Finding]:
    if of.condition is not None:
        word = PASS if of.condition <= CONDITION else WARN
        advice = "" if word == PASS else ": near a singular position, or sizes too far apart"
        text = f"pivots of the Jacobian spread over {of.condition:.1e}{advice}"
        yield Finding("pivotRatio", word, text)


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
        yield Finding("initialVelocities", WARN, text)


def _accuracy(of: Figures, limits: Limits) -> Iterator[Finding]:
    """The global error, if it was estimated; else the sum of the steps' own errors."""
    yield _global(of, of.error) if of.error is not None else _local(of)


def _global(of: Figures, error: dict[str, Any]) -> Finding:
    position, orientation = float(error["position"]), float(error["orientation"])
    largest = max(position, orientation)
    text = f"position error at most {position:.1e} m (estimated)"
    if orientation > position:
        text = f"position error at most {position:.1e} m, orientation error {orientation:.1e} m"
        text += " (angle times length; estimated)"
    limit, spoilt = ERROR * of.size, ERROR_SPOILT * of.size
    if error.get("accuracy") is not None:
        limit = float(error["accuracy"])
        spoilt = min(spoilt, BETWEEN * limit) if spoilt > limit else BETWEEN * limit
    if of.tolerance is not None and largest > of.tolerance:
        return Finding("accuracy", WARN, _too_sensitive(of, of.tolerance, text))
    word = grade(largest, limit, spoilt)
    if not error["complete"]:
        word = max(word, WARN, key=WORDS.index)
        text += f" up to t = {error['until']:g} s, where {error['companion']} did not converge"
    if word != PASS:
        text += _advice(of, largest, limit)
    return Finding("accuracy", word, text)


def _too_sensitive(of: Figures, tolerance: float, text: str) -> str:
    until = of.horizon(tolerance) if of.horizon else 0.0
    return (
        f"{text}: the motion amplifies round-off, and the tolerance of {tolerance:g} m holds up to "
        f"t = {until:g} s"
    )


def _advice(of: Figures, error: float, limit: float) -> str:
    """Up to when the run is good enough, and what to try."""
    good = f"; within {limit:.1e} m up to t = {of.horizon(limit):g} s" if of.horizon else ""
    if of.tolerance is not None or of.local_tolerance is not None:
        return good
    enough = of.dt * (0.5 * limit / error) ** (1.0 / of.order)
    turns = of.by_cayley and of.extreme("rotationPerStepMax") > SPINS
    spin = (
        f" (bodies rotate {of.extreme('rotationPerStepMax'):.2g} rad per step), "
        "--rotation-update exponential"
    )
    try_dt = f"{good}; try --dt {enough:.1g}{spin if turns else ''}"
    return f"{try_dt} or --scheme auto --tolerance {limit:.0e}"


def _unresolved(of: Figures) -> str:
    """The sign, in a run of higher order, of motions that its steps do not resolve; empty if there
    is none.
    """
    taken, kinetic = of.extremes.get("energyTaken") or 0.0, of.extreme("largestKineticEnergy")
    if kinetic and taken > TAKEN * kinetic:
        return f"the scheme took {taken / kinetic:.1e} of the largest kinetic energy"
    # No less than the fastest mass centre's: highest speeds are told with those of turning.
    way = min(of.dt, of.time) * of.extreme("speedMax") - of.length * of.extreme(
        "rotationPerStepMax"
    )
    if way > FARTHER * of.extreme("displacementMax"):
        farthest = f"{of.extreme('displacementMax'):.1e} m from where it began"
        return f"a body goes {way:.1e} m a step, and at no step's end is more than {farthest}"
    return ""


def _local(of: Figures) -> Finding:
    """What the steps' own errors say; never that the run is good."""
    if of.extremes["localErrorSum"] is None:
        sign = _unresolved(of) if of.local_tolerance is None else ""
        if sign:
            return Finding("accuracy", WARN, f"the step is large for something that moves: {sign}")
        return Finding("accuracy", DONE, "error not estimated (--error estimate does)")
    total = of.extreme("localErrorSum")
    text = f"local errors add up to {total:.1e} m; global error not estimated"
    tolerance = of.local_tolerance
    if tolerance is not None:
        word = DONE if total <= tolerance else WARN
        return Finding("accuracy", word, f"{text} ({tolerance:g} m asked of the local errors)")
    if total <= ERROR * of.size:
        return Finding("accuracy", DONE, text)
    enough = of.dt * (ERROR * of.size / total) ** 0.5
    advice = f"--dt {enough:.1g} would do, and --error estimate shows how far to trust the run"
    return Finding("accuracy", WARN, f"{text}, in a model of {of.size:.1e} m: {advice}")


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
