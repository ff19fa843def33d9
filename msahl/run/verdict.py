"""The verdict on a run: PASS, DONE, WARN or FAIL, check by check, with the reasons in words.

A figure within its limit passes, beyond it warns, and far beyond it fails. The limits are tight, as
the scheme conserves to round-off what it conserves; a figure that fails makes the motion unusable.
No limit is below the round-off of the terms whose difference the figure is. PASS means that the
global error was estimated and is small. A run whose error was not estimated is DONE at best.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from sys import float_info
from typing import Any, NamedTuple

from msahl.model import Limits
from msahl.model.beams import HIGHEST_DEGREE
from msahl.records import record
from msahl.run.signal_errors import SIGNAL, STATE

PASS, DONE, WARN, FAIL = WORDS = ("PASS", "DONE", "WARN", "FAIL")

WARN_FACTOR = 10.0
"""Factor times a limit of the deck up to which a figure warns; beyond it fails."""
ENERGY, ENERGY_FAIL = 1e-8, 1e-3
"""Energy error relative to the largest kinetic energy that warns, and fails, of schemes that
conserve it. A million steps of the preserving scheme drift by about 1e-12."""
VIOLATION, VIOLATION_FAIL = 1e-9, 1e-5
"""Constraint violation relative to the longest body that warns, and fails; steps reach 1e-14."""
MOMENTUM, MOMENTUM_FAIL = 1e-9, 1e-4
"""Relative change of the momenta that warns, and fails."""
VIOLATION_RATE = 0.05
"""Constraint violation at velocity level relative to the highest speed that warns: the step size is
large, but the run may be good."""
ERROR, ERROR_FAIL = 0.01, 0.3
"""Global error of positions and orientations relative to the size of the model (its longest body,
or its largest displacement if larger) that warns, if the deck sets no limit, and fails."""
TAKEN, TAKEN_FAIL = 0.01, 0.1
"""Fraction of the largest kinetic energy that a scheme of higher order may take from motions that
it resolves. A vibration loses twice the fraction of its amplitude, which is then its error. Of a
loss that does not depend on the step, ten times that fails."""
OSCILLATING = 2.0
"""Ratio of a step's displacement at the highest speed to the largest displacement since t = 0 above
which the motion oscillates within one step: it then passes a third of a cycle in one."""
CONSTRAINT_WORK = 1e-8
"""Work of the reactions in the constraint violations of a step, relative to the largest kinetic
energy, that warns."""
MESH_SHARE = 0.5
"""Share of a limit that the error by the mesh of beams may take, beside that of the steps."""
PIVOT_RATIO = 1e13
"""Ratio of the pivots above which a step's solution keeps fewer than three digits."""
SIGNAL_FAIL = 0.3
"""Error of a signal, a state or the load of an actuator, relative to its largest value, that fails.
It is one that lasts (``signal_errors``)."""
REACTION = 1.0
"""Error of a kind of reactions, relative to the largest of them, that warns."""
NOISE = 1e-9
"""Reactions, relative to the energies over the bodies' length, that are zero but for noise."""
LARGE_ROTATION = 0.1
"""Rotation in a step [rad] at which the Cayley transform is off by a thousandth of it."""
MOST_NAMED = 8
"""Joints that a check names; all are in ``run.json`` under ``nonUniqueReactions``."""
CHANGED = 1e-6
"""Change of the initial velocities, relative to the highest speed, that is reported."""
ROUND_OFF = 1e3 * float_info.epsilon
"""Round-off of a sum over a run, relative to its largest term."""
AT_REST = 1e-9
"""Energy error at output times between steps of a model at rest, relative to the largest energy,
that is round-off: steps may be as long as the run there, and the polynomials between their ends
multiply the rounding errors of accelerations."""


class Finding(NamedTuple):
    """The result of one check."""

    check: str
    word: str
    text: str


@record
class Verdict:
    """All findings; the worst of them is the word."""

    findings: tuple[Finding, ...]

    @property
    def word(self) -> str:
        """PASS, DONE, WARN or FAIL."""
        return max((f.word for f in self.findings), key=WORDS.index)

    @property
    def reasons(self) -> list[str]:
        """Why the word is WARN or FAIL, the worst first."""
        bad = [f for f in self.findings if f.word in (WARN, FAIL)]
        return [f.text for f in sorted(bad, key=lambda f: -WORDS.index(f.word))]

    def as_json(self) -> dict[str, object]:
        """The verdict as ``run.json`` has it."""
        checks = {f.check: {"word": f.word, "text": f.text} for f in self.findings}
        return {"word": self.word, "reasons": self.reasons, "checks": checks}


@record
class Figures:
    """What a run is judged by. Lengths in m, speeds in m/s, energies in J, times in s.

    ``momentum`` is the relative change of linear and angular momentum in subsystems on which
    nothing acts from outside, None where there is none or the scheme does not conserve it.
    ``pivot_ratio`` is None if no Jacobian was factored, or if redundant joints make it large by
    themselves.
    """

    status: str
    time: float
    steps: int
    iterations: int
    subdivisions: int
    scipy_steps: int
    path_steps: int
    joints: int
    dt: float
    order: int  # of the scheme
    conserves: bool  # whether the scheme conserves energy at any step size
    works: bool  # whether anything did work, so that energy is a balance
    by_cayley: bool  # whether rotations are updated by the Cayley transform
    tolerance: float | None  # of the global error [m], by which the step size was chosen
    local_tolerance: float | None  # of the sum of local errors [m], likewise
    length: float  # of the longest body
    energy_size: float  # largest of the energies whose difference the balance is
    extremes: dict[str, float | None]
    momentum: tuple[float | None, float | None]
    pivot_ratio: float | None
    velocity_change: float
    non_unique_reactions: dict[str, list[str]]  # columns, by element
    error: dict[str, Any] | None  # as ``ErrorEstimate.as_json`` returns it
    horizon: Callable[[float], float] | None  # time [s] up to which the error is within so many m
    jumping: Sequence[str] = ()  # what has expressions that may jump by reactions
    energy_gained: float = 0.0  # by impacts
    explicit: bool = False  # whether steps solve for nothing, and energy drifts
    speed_jumps: Sequence[str] = ()  # motions whose speed jumps, and when
    parallel: Sequence[str] = ()  # contacts of capsules that press while parallel, and when

    @property
    def size(self) -> float:
        """Size of the model [m]: its longest body, or its largest displacement if larger."""
        return max(self.length, self.extreme("displacementMax"))

    @property
    def by_tolerance(self) -> bool:
        """Whether the size of the steps was chosen by a tolerance."""
        return self.tolerance is not None or self.local_tolerance is not None

    @property
    def size_in_words(self) -> str:
        """What the size of the model is."""
        moves = self.size > self.length
        return f"the {'largest displacement' if moves else 'longest body'}, {self.size:.3g} m"

    def extreme(self, name: str) -> float:
        """An extreme of the run by its name; NaN where it is not known."""
        value = self.extremes[name]
        return float("nan") if value is None else value


def not_started(status: str) -> Verdict:
    """The verdict on a run that took no step."""
    return Verdict((Finding("completion", FAIL, status),))


def judge(figures: Figures, limits: Limits) -> Verdict:
    """The verdict on a run by the deck's ``limits``."""
    return Verdict(tuple(f for check in CHECKS for f in check(figures, limits)))


def grade(value: float, limit: float, fail: float) -> str:
    """Word for a figure with a limit to warn and one to ``fail``; a NaN fails."""
    if value <= limit:
        return PASS
    return WARN if value <= max(limit, fail) else FAIL


def _limits_of(limit: float | None, default: float, fail: float) -> tuple[float, float]:
    """Where a figure begins to warn and to fail: by the deck, or else by the limits above."""
    return (default, fail) if limit is None else (limit, WARN_FACTOR * limit)


def _completion(figures: Figures, limits: Limits) -> Iterator[Finding]:
    words = {"completed": PASS, "interrupted": WARN}
    ended = "" if figures.status == "completed" else f"{figures.status} after "
    text = f"{ended}{figures.steps} steps to t = {figures.time:g} s"
    yield Finding("completion", words.get(figures.status, FAIL), text)


def _energy(figures: Figures, limits: Limits) -> Iterator[Finding]:
    error, kinetic = figures.extreme("energyErrorMax"), figures.extreme("largestKineticEnergy")
    floor = ROUND_OFF * figures.energy_size
    if figures.extremes["energyErrorMaxRelative"] is None:
        between = figures.extremes.get("energyErrorBetweenSteps") or 0.0
        allowed = AT_REST * figures.energy_size
        word = max(grade(error, floor, floor), grade(between, allowed, allowed), key=WORDS.index)
        error = max(error, between)
        yield Finding("energy", word, f"nothing moves, and the energy error is {error:.1e} J")
        return
    limit, fail = _limits_of(limits.energy, *_energy_limits(figures))
    word = grade(error, max(limit * kinetic, floor), fail * kinetic)
    kept = "energy balance closed" if figures.works else "energy conserved"
    only = "" if word == PASS else " only"
    text = f"{kept}{only} to {error / kinetic:.1e} of the largest kinetic energy"
    taken = figures.extremes.get("energyTaken")
    more = f"; the scheme took {taken / kinetic:.1e} of it" if taken else ""
    lost = (figures.extremes.get("energyTakenAtAnyStep") or 0.0) / kinetic
    if lost > TAKEN:
        word = max(word, grade(lost, TAKEN, TAKEN_FAIL), key=WORDS.index)
        more += (
            f", in the second half of the run {lost:.1e} at half the step as well: the energies or "
            "works are not those of the motion; try --scheme preserving, whose balance shows it"
        )
    if word != PASS and figures.explicit:
        more += ", as explicit steps do not conserve it: reduce --dt, or try --scheme gauss3"
    of_rows, text_of_rows = _energy_between_steps(figures, limits)
    word = max(word, of_rows, key=WORDS.index)
    yield Finding("energy", word, f"{text}{more}{text_of_rows}")


def _energy_between_steps(figures: Figures, limits: Limits) -> tuple[str, str]:
    """The word for the output times between steps, where motion and works are interpolated, and
    what there is to say of them. Where a damper takes nearly all of a spring's energy, kinetic
    energy is a small part of what is exchanged; the error is judged by the larger of both.
    """
    error = figures.extremes.get("energyErrorBetweenSteps")
    kinetic = figures.extreme("largestKineticEnergy")
    if error is None:
        return PASS, ""
    exchanged = figures.extremes.get("potentialEnergyChangeBetweenSteps") or 0.0
    energy = max(kinetic, exchanged)
    limit, fail = _limits_of(limits.energy, *_energy_limits_between_steps(figures))
    word = grade(error, max(limit * energy, ROUND_OFF * figures.energy_size), fail * energy)
    text = f"; at output times between steps to {error / energy:.1e}"
    if exchanged > kinetic:
        text += " of the largest change of the potential energy"
    if word == PASS:
        return word, text if error > figures.extreme("energyErrorMax") else ""
    remedy = "reduce --tolerance"
    if not figures.by_tolerance:
        remedy = "reduce --dt, or let the output interval be a multiple of the step"
    more = "energies and works are interpolated there, and less accurate than at the steps"
    return word, f"{text}: {more}; {remedy}"


def _energy_limits_between_steps(figures: Figures) -> tuple[float, float]:
    """As ``_energy_limits``, between steps. What a position error does to the energy there
    depends on how far the model moves: it may vibrate by less than its length.
    """
    asked = figures.tolerance or figures.local_tolerance or (figures.error or {}).get("accuracy")
    if asked is None:
        return ERROR, ERROR_FAIL
    rotation = figures.length * figures.extreme("rotationPerStepMax")
    size = min(figures.length, max(figures.extreme("displacementMax"), rotation))
    if 0.0 < size <= float(asked):
        return math.inf, math.inf  # nothing of such a motion was asked for
    allowed = ERROR_FAIL if size == 0.0 else min(WARN_FACTOR * float(asked) / size, ERROR_FAIL)
    limit = max(ENERGY, allowed)
    return limit, max(ERROR_FAIL, WARN_FACTOR * limit)


def _energy_limits(figures: Figures) -> tuple[float, float]:
    """Relative energy errors that warn, and fail. A scheme that does not conserve energy by itself
    is judged by the accuracy asked for: a position error makes a relative energy error of its size.
    """
    if figures.conserves:
        return ENERGY, ENERGY_FAIL
    asked = figures.tolerance or figures.local_tolerance or (figures.error or {}).get("accuracy")
    default = ENERGY_FAIL if figures.error is None else ERROR
    if asked is not None:
        default = max(ENERGY, WARN_FACTOR * float(asked) / figures.length)
    return default, max(ENERGY_FAIL, WARN_FACTOR * default)


def _momentum(figures: Figures, limits: Limits) -> Iterator[Finding]:
    for kind, change in zip(("linear", "angular"), figures.momentum, strict=True):
        if change is not None:
            word = grade(change, MOMENTUM, MOMENTUM_FAIL)
            text = f"{kind} momentum conserved to {change:.1e} of its size"
            yield Finding(f"{kind}Momentum", word, text)


def _violation(figures: Figures, limits: Limits) -> Iterator[Finding]:
    if not figures.joints:
        return
    violation = figures.extreme("constraintViolationMax")
    floor = ROUND_OFF * figures.extreme("distanceMax")
    default, fail = VIOLATION * figures.length, VIOLATION_FAIL * figures.length
    limit, fail = _limits_of(limits.violation, default, fail)
    word = grade(violation, max(limit, floor), fail)
    yield Finding("constraintViolation", word, f"constraint violation at most {violation:.1e} m")


def _violation_rate(figures: Figures, limits: Limits) -> Iterator[Finding]:
    if not figures.joints:
        return
    rate, speed = figures.extreme("constraintViolationRateMax"), figures.extreme("speedMax")
    # A model at rest in the origin has no distance and next to no speed.
    floor = ROUND_OFF * max(figures.extreme("distanceMax"), figures.length) / figures.dt
    word = PASS if rate <= max(VIOLATION_RATE * speed, floor) else WARN
    part = f", {rate / speed:.1e} of the highest speed" if speed else ""
    advice = "" if word == PASS else ": the step size is too large for this motion; reduce --dt"
    text = f"constraint violation at velocity level at most {rate:.1e} m/s{part}{advice}"
    yield Finding("constraintViolationRate", word, text)


def _constraint_work(figures: Figures, limits: Limits) -> Iterator[Finding]:
    if not figures.joints:
        return
    work, kinetic = figures.extreme("constraintWorkMax"), figures.extreme("largestKineticEnergy")
    word = PASS if work <= max(CONSTRAINT_WORK * kinetic, ROUND_OFF * figures.energy_size) else WARN
    text = f"work of the reactions in the constraint violations at most {work:.1e} J per step"
    yield Finding("constraintWork", word, text)


def _solver(figures: Figures, limits: Limits) -> Iterator[Finding]:
    counted = "evaluations" if figures.explicit else "iterations"
    text = f"{figures.iterations / max(figures.steps, 1):.1f} {counted} per step"
    if figures.scipy_steps:
        text += f", {figures.scipy_steps} steps by scipy"
    hard = []
    if figures.path_steps:
        hard.append(f"{figures.path_steps} steps were solved by continuation from shorter ones")
    if figures.subdivisions:
        hard.append(f"steps were subdivided {figures.subdivisions} times")
    if hard:
        text += (
            f"; {', '.join(hard)}: a motion is too fast for the step size; look at the results "
            "there, and reduce --dt"
        )
    yield Finding("solver", WARN if hard else PASS, text)


def _pivot_ratio(figures: Figures, limits: Limits) -> Iterator[Finding]:
    if figures.pivot_ratio is not None:
        word = PASS if figures.pivot_ratio <= PIVOT_RATIO else WARN
        advice = (
            ""
            if word == PASS
            else ": the model is near a singular position, or its masses or lengths differ too much"
        )
        text = f"pivot ratio of the Jacobian at most {figures.pivot_ratio:.1e}{advice}"
        yield Finding("pivotRatio", word, text)


def _reaction_errors(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """Reactions of which the estimated error leaves nothing; small ones are judged by the user."""
    error: dict[str, Any] = figures.error or {}
    energy, length = figures.energy_size, figures.length
    units = {"force": ("N", length), "moment": ("N m", 1.0), "load": ("N or N m", min(length, 1.0))}
    remedy = (
        "a smaller --tolerance" if figures.by_tolerance else "a smaller --dt, or --scheme gauss"
    )
    for kind, largest in error.get("largest", {}).items():
        (unit, lever), lasting = units[kind], error["lasting"][kind]
        if lasting > max(REACTION * largest, NOISE * energy / lever):
            text = (
                f"estimated error of the joints' {kind}s {lasting:.1e} {unit}, of at most "
                f"{largest:.1e} {unit}: do not use them; try {remedy}"
            )
            yield Finding(f"{kind}Error", WARN, text)


def _reactions(figures: Figures, limits: Limits) -> Iterator[Finding]:
    if figures.non_unique_reactions:
        named = dict(list(figures.non_unique_reactions.items())[:MOST_NAMED])
        more = len(figures.non_unique_reactions) - len(named)
        text = (
            "joints are redundant: motion and energy are unique, but these reactions are not: "
            f"{describe_reactions(named)}{f'; and those of {more} more' if more else ''}"
        )
        yield Finding("reactions", PASS, text)


def describe_reactions(reactions: dict[str, list[str]]) -> str:
    """Reactions, as columns by element, in words."""
    return "; ".join(f"{name}: {', '.join(columns)}" for name, columns in reactions.items())


def _jumps(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """Jumps by reactions occur a step late: run and companion may have them in the same step."""
    if figures.jumping and figures.error is not None:
        text = (
            f"the expression of {' and of '.join(figures.jumping[:3])} may jump by reactions of "
            "joints, which are those of the step before: the time of a jump is known to a step "
            "only, which the estimated error may not show; compare with a smaller --dt, or give "
            "the jump a width, such as tanh(x/w)"
        )
        yield Finding("jumps", WARN, text)


def _impacts(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """Newton's law may add energy where several contacts take part in an impact."""
    if figures.energy_gained > 0.0:
        text = (
            f"impacts added {figures.energy_gained:.1e} J to the energy, as Newton's law may "
            'where contacts of different restitution take part; write impactLaw="poisson"'
        )
        yield Finding("impacts", WARN, text)


def _speed_jumps(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """A speed that jumps takes an impulse, whose force is what the step makes of it."""
    if figures.speed_jumps:
        more = len(figures.speed_jumps) - 3
        text = (
            f"the speed of a prescribed motion jumps: {', '.join(figures.speed_jumps[:3])}"
            f"{f', and {more} more motions' if more > 0 else ''}; its load and the reactions are "
            "an impulse then, which a step spreads over its time and output times may miss, so "
            'they depend on the step size; do not use them there, or write interpolation="cubic", '
            "with ends at rest, or a <ramp>"
        )
        yield Finding("speedJumps", WARN, text)


def _parallel_capsules(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """One point of contact does not determine how they press, at any size of the steps."""
    if figures.parallel:
        more = len(figures.parallel) - 3
        text = (
            f"capsules press while they are parallel: contact {', '.join(figures.parallel[:3])}"
            f"{f', and {more} more contacts' if more > 0 else ''}; one point of contact does not "
            "determine their moment there, and the estimated error does not show it; tilt one of "
            "them, or give the ends of each as the spheres of cylinderContacts whose <length> is "
            "that of the other"
        )
        yield Finding("parallelCapsules", WARN, text)


def _initial_velocities(figures: Figures, limits: Limits) -> Iterator[Finding]:
    speed = max(figures.extreme("speedMax"), figures.velocity_change)
    if figures.velocity_change > CHANGED * speed:
        text = (
            "the deck's initial velocities violate the joints' constraints by "
            f"{figures.velocity_change:.1e} m/s; see the warnings"
        )
        yield Finding("initialVelocities", WARN, text)


def _accuracy(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """The global error if it was estimated, else the sum of the local errors."""
    yield (
        _global_error(figures, figures.error)
        if figures.error is not None
        else _local_errors(figures)
    )


def _global_error(figures: Figures, error: dict[str, Any]) -> Finding:
    position, orientation = float(error["position"]), float(error["orientation"])
    largest = max(position, orientation)
    text = f"estimated position error at most {position:.1e} m"
    if orientation > position:
        text += f", orientation error at most {orientation:.1e} m (angle times body length)"
    if error.get("accuracy") is None:
        text += f", {largest / figures.size:.1g} of {figures.size_in_words}"
    mesh = error.get("mesh", {})
    by_mesh = float(mesh.get("error", 0.0))
    if by_mesh > 0.0:
        text += f", {by_mesh:.1e} m of it by the mesh of the beams"
    # A displacement that is wrong altogether is no size.
    size = figures.size if largest <= figures.size else figures.length
    limit, fail = ERROR * size, ERROR_FAIL * size
    if error.get("accuracy") is not None:
        limit = float(error["accuracy"])
        fail = min(fail, WARN_FACTOR * limit) if fail > limit else WARN_FACTOR * limit
    if figures.tolerance is not None and largest > figures.tolerance:
        if by_mesh > MESH_SHARE * figures.tolerance:
            return Finding("accuracy", WARN, text + _finer_mesh(mesh, figures.tolerance))
        return Finding("accuracy", WARN, _too_sensitive(figures, figures.tolerance, text))
    word = grade(largest, limit, fail)
    met = figures.tolerance is not None and largest <= figures.tolerance
    if met and error.get("accuracy") is None:
        # The tolerance that was asked for may be a large part of the model.
        word = PASS if word in (PASS, WARN) else WARN
    if not error["complete"]:
        word = max(word, WARN, key=WORDS.index)
        text += (
            f" up to t = {error['until']:g} s, where the companion run ({error['companion']}) did "
            "not converge"
        )
    if word != PASS and by_mesh > MESH_SHARE * limit:
        text += _finer_mesh(mesh, limit)
    if word != PASS and largest - by_mesh > MESH_SHARE * limit:
        text += _advice(figures, largest - by_mesh, limit)
    if "unknown" in mesh:
        word = max(word, DONE, key=WORDS.index)
        text += f"; the error by the mesh of the beams is not known: {mesh['unknown']}"
    return Finding("accuracy", word, text)


def _finer_mesh(mesh: dict[str, Any], limit: float) -> str:
    """What mesh of the beams would be fine enough: of the same degree p, by its order 2 p."""
    elements, degree = mesh["elements"], mesh["degree"]
    factor = (mesh["error"] / (MESH_SHARE * limit)) ** (0.5 / degree)
    more = max(elements + 1, math.ceil(factor * elements))
    higher = f" or of a degree above {degree}" if degree < HIGHEST_DEGREE else ""
    return (
        f"; the mesh is too coarse: try {more} elements of all beams together in place of "
        f"{elements},{higher}"
    ).rstrip(",")


def _too_sensitive(figures: Figures, tolerance: float, text: str) -> str:
    until = figures.horizon(tolerance) if figures.horizon else 0.0
    return (
        f"{text}: smaller steps did not help, so the motion amplifies round-off, or a load has a "
        f"kink at which no step ends; the tolerance of {tolerance:g} m is met up "
        f"to t = {until:g} s"
    )


def _advice(figures: Figures, error: float, limit: float) -> str:
    """Up to when the run is accurate enough, and what to try."""
    good = (
        f"; within {limit:.1e} m up to t = {figures.horizon(limit):g} s" if figures.horizon else ""
    )
    if figures.by_tolerance:
        return good
    enough = _shorter(figures.dt, (0.5 * limit / error) ** (1.0 / figures.order))
    rotation = figures.extreme("rotationPerStepMax")
    exponential = (
        f" (bodies rotate {rotation:.2g} rad per step), --rotation-update exponential"
        if figures.by_cayley and rotation > LARGE_ROTATION
        else ""
    )
    return f"{good}; try --dt {enough}{exponential} or --scheme auto --tolerance {limit:.0e}"


def _shorter(dt: float, factor: float) -> str:
    """``factor`` times the step size ``dt``, in as many digits as show that it is shorter."""
    text = f"{factor * dt:.1g}"
    return text if float(text) < dt else f"{factor * dt:.2g}"


def _unresolved(figures: Figures) -> str:
    """The sign, in a run of higher order, of motions that its steps do not resolve; empty if there
    is none.
    """
    taken, kinetic = (
        figures.extremes.get("energyTaken") or 0.0,
        figures.extreme("largestKineticEnergy"),
    )
    if kinetic and taken > TAKEN * kinetic:
        return f"the scheme took {taken / kinetic:.1e} of the largest kinetic energy"
    # At least that of the fastest mass centre, as the highest speed includes rotations.
    displacement = min(figures.dt, figures.time) * figures.extreme("speedMax")
    displacement -= figures.length * figures.extreme("rotationPerStepMax")
    if displacement > OSCILLATING * figures.extreme("displacementMax"):
        return (
            f"a body's velocity moves it by {displacement:.1e} m per step, but at no step's end is "
            f"it more than {figures.extreme('displacementMax'):.1e} m from where it was at t = 0"
        )
    return ""


def _signals(figures: Figures, limits: Limits) -> Iterator[Finding]:
    """The errors of signals, auxiliary states and loads of actuators, each over its own size."""
    columns: dict[str, Any] = (figures.error or {}).get("signals", {})
    if not columns:
        return
    asked = math.inf if figures.tolerance is None else figures.tolerance / figures.length
    limits_of = {True: min(STATE, asked), False: SIGNAL}  # of states, and of others
    beyond = {
        name: column
        for name, column in columns.items()
        if column["share"] > limits_of[column["state"]]
    }
    if not beyond:
        largest = max(column["share"] for column in columns.values())
        text = f"lasting errors of signals at most {largest:.1e} of their largest values"
        if largest == 0.0:
            text = "lasting errors of signals are round-off"
        yield Finding("signals", PASS, text)
        return
    # A state before what follows from it.
    name, worst = max(beyond.items(), key=lambda item: (item[1]["state"], item[1]["share"]))
    # Where positions are as asked for, what follows from them by rates or differences only warns.
    judged = [c["share"] for c in beyond.values() if c["state"] or figures.tolerance is None]
    word = grade(max(judged, default=0.0), 0.0, SIGNAL_FAIL) if judged else WARN
    more = f", and {len(beyond) - 1} more are off" if len(beyond) > 1 else ""
    what = "state" if worst["state"] else "signal"
    text = (
        f"estimated error of {what} '{name}' {worst['error']:.1e}, {worst['share']:.2g} of its "
        f"largest value {worst['largest']:.3g}{more}"
    )
    yield Finding("signals", word, text + _signal_advice(figures, worst["state"], asked))


def _signal_advice(figures: Figures, is_state: bool, asked: float) -> str:
    """What to try against the error of a signal; states may be wrong by the part ``asked``."""
    if figures.tolerance is None:
        return "; try a smaller --dt, or --scheme radau where states change faster than the steps"
    if is_state and asked < STATE:
        return (
            f"; the tolerance of {figures.tolerance:g} m means {asked:.1g} for states, its part of "
            f"the longest body, {figures.length:.3g} m: smaller steps did not help, so the motion "
            "amplifies errors, or a rate jumps in a way that its expression does not show"
        )
    return "; try a smaller --tolerance"


def _local_errors(figures: Figures) -> Finding:
    """The sum of the local errors; it never makes a run PASS."""
    if figures.extremes["localErrorSum"] is None:
        sign = _unresolved(figures) if figures.local_tolerance is None else ""
        if sign:
            text = f"the step size is too large for a fast motion: {sign}; reduce --dt"
            return Finding("accuracy", WARN, text)
        return Finding("accuracy", DONE, "error not estimated (use --error estimate)")
    total = figures.extreme("localErrorSum")
    text = f"sum of local position errors {total:.1e} m; global error not estimated"
    tolerance = figures.local_tolerance
    if tolerance is not None:
        word = DONE if total <= tolerance else WARN
        return Finding("accuracy", word, f"{text} (local tolerance: {tolerance:g} m)")
    if total <= ERROR * figures.size:
        return Finding("accuracy", DONE, text)
    enough = _shorter(figures.dt, (ERROR * figures.size / total) ** 0.5)
    advice = f"try --dt {enough}, or --error estimate to estimate the global error"
    return Finding("accuracy", WARN, f"{text}, in a model of size {figures.size:.1e} m; {advice}")


CHECKS: tuple[Callable[[Figures, Limits], Iterator[Finding]], ...] = (
    _completion,
    _accuracy,
    _signals,
    _energy,
    _momentum,
    _violation,
    _violation_rate,
    _constraint_work,
    _solver,
    _pivot_ratio,
    _reaction_errors,
    _reactions,
    _initial_velocities,
    _jumps,
    _speed_jumps,
    _parallel_capsules,
    _impacts,
)
"""All checks, in the order in which they are reported."""


def describe_verdict(verdict: dict[str, Any]) -> str:
    """The verdict's word and its reasons; of a good run the figures that made it pass."""
    checks = verdict["checks"]
    names = ("completion", "energy", "constraintViolation", "accuracy", "reactions")
    texts = [checks[name]["text"] for name in names if name in checks]
    return f"{verdict['word']}: {'; '.join(verdict['reasons'] or texts)}"
