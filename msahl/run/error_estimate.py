"""The global error of a run, estimated by a companion run of higher accuracy beside it.

At every output time the results y of the run are compared with the results y* of its companion:

    |y - y_exact|  <=  SAFETY |y - y*| / (1 - 2^-p)        companion at half the step, order p
    |y - y_exact|  <=  SAFETY |y - y*|                     companion of a higher order

The quotient is Richardson's, exact as the step goes to zero: a companion at half the step has 2^-p
of the error itself. An estimate is never below what rounding leaves of the largest coordinate.

A vibration that is faster than the steps may be the same at the output times of both runs while
its true amplitude a is missed. Its half-period is shorter than the step h, so a < h/pi times the
error of the velocity, which such a vibration reverses from step to step; where that error is a
noticeable part of the speeds, errors of positions are taken to be no smaller. A scheme that damps
it loses its energy E in both runs alike, where the loss from what the steps resolve falls by 2^-p
or more at half the step:

    a < h/2 |v|_max sqrt(E / K_max) ,    E = 2 E_companion - E_run     [J]

if the companion lost three quarters of what the run lost, and more than round-off. A gauss scheme
of even degree may keep both position and velocity of such a vibration; then a body goes by h |v| in
a step and yet is never far from where it began, and h |v|/pi is the estimate.

A prescribed motion that oscillates between the times at which both runs meet it is a third case:
its own size is then the estimate (``unseen_motion``). So is friction whose regularisation width is
passed within a step (``unresolved_friction``).

Errors are those of the published numbers: positions of the bodies' reference points [m],
orientations as angle times the body's length [m], velocities [m/s] and angular velocities [rad/s]
in body axes, joint forces [N] and moments [N m], loads of couplings and prescribed motions.
"""

from collections.abc import Sequence
from dataclasses import replace
from sys import float_info
from typing import Any, NamedTuple, Protocol

import numpy as np

from msahl.algebra.functions import build_laws, evaluate
from msahl.algebra.rotation_arrays import angles
from msahl.elements import forces
from msahl.model import (
    INSTANTANEOUS,
    Model,
    degree_of,
    local_tolerance_of,
    order_of,
    reactions_of,
    scheme_of,
)
from msahl.model.motions import JointMotion
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from msahl.system.names import reaction_columns

SAFETY = 1.5
"""The estimate aims above the error: the terms of higher order are unknown."""
ROUND_OFF = 4.0 * float_info.epsilon
"""Relative error of the largest coordinate below which no estimate goes."""
FARTHER = 2.0
"""A step's way, in the longest way from the start, from which a motion turns back within a step: it
then makes a third of a turn or more in one."""
LOST_ALIKE = 0.75
"""Part of the energy lost by a run that its companion loses as well if that is of vibrations which
neither resolves; of resolved motions it is a half at most, but for terms of higher order."""
REVERSED = 0.02
"""Part of a body's highest speed so far from which an error of its velocity may be a vibration that
the steps reverse. Errors of resolved motions are smaller, or show in the positions."""
ENERGY_ROUND_OFF = 1e3 * float_info.epsilon
"""Sum of the rounding errors of a run's energies, relative to the largest."""
RISE = 1.05
"""Factor by which the largest error must have grown to be recorded with its time."""
SECONDS_PER_UNKNOWN = 1.2e-7
"""Time of the loop for one unknown and step of order 2; the machine decides, this is its size. It
is not measured in the run, so that the same deck has the same companion everywhere."""
WORTH = 1.0
"""Seconds that a companion may always take."""
DEGREE_COST = {0: 1.0, 1: 2.5, 2: 4.3, 3: 6.5, 4: 9.5, 5: 13.0}
"""Time of a step by its degree, in steps of order 2 (see ``benchmarks/results/speed.md``)."""


MOTION_SAMPLES = 64
"""Steps at which prescribed motions are looked at, from the first to the last."""
MET, BETWEEN = np.array([0.0, 0.5, 1.0]), np.array([0.21, 0.36, 0.64, 0.79])
"""Times that run and companion meet, and others between them, in parts of a step."""
PARABOLA = np.array(
    [(1 - 2 * BETWEEN) * (1 - BETWEEN), 4 * BETWEEN * (1 - BETWEEN), BETWEEN * (2 * BETWEEN - 1)]
)
"""Weights of the values met for those between, by the parabola through them."""
SAME = 1e-9
"""Part of the range of a motion over the whole run that is none within a step."""
UNFOLLOWED, OFTEN = 0.3, 0.25
"""Part of its range that a motion is off that parabola if a step does not follow it, and the part
of all steps for which this must be so: a kink is met by one step alone."""


class Coarser(NamedTuple):
    """A companion of higher order: so many steps of the run make one of its steps."""

    scheme: str
    degree: int
    stride: int


COARSER = {
    ("preserving", 0): Coarser("gauss", 3, 8),
    ("decaying", 0): Coarser("radau", 3, 8),
    ("gauss", 1): Coarser("gauss", 3, 4),
    ("gauss", 2): Coarser("gauss", 4, 3),
    ("gauss", 3): Coarser("gauss", 5, 3),
    ("gauss", 4): Coarser("gauss", 5, 2),
    ("radau", 1): Coarser("radau", 3, 4),
    ("radau", 2): Coarser("radau", 3, 2),
}
"""Companions that cost less than the run itself, by the run's scheme and degree; a vibration that
the run damps is damped by its companion as well."""


class Rows(NamedTuple):
    """Published rows of one independent subsystem: states (m, 12 n), reactions (m, ...)."""

    states: np.ndarray
    reactions: np.ndarray


class Steps(NamedTuple):
    """Steps that a run has taken, from ``begin`` [s]."""

    begin: float
    sizes: np.ndarray  # (m,) [s]
    ends: np.ndarray  # (m,) [s], by the run's own grid and not by sums of sizes


class Companion(Protocol):
    """A run beside the run."""

    name: str
    factor: float  # of the difference, for the estimate
    stride: int  # steps of the run that make one of its own
    integrators: list[SubsystemIntegrator]  # what advances with the run

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """Take the time of these ``steps``; the rows of ``plan``, at ``times``, by
        subsystem, or None if a step did not converge.
        """


class HalfStep:
    """Every step of the run in two halves, by the same scheme."""

    name, stride = "half the step", 1

    def __init__(
        self, model: Model, integrators: Sequence[SubsystemIntegrator], full: bool, chunk: int
    ) -> None:
        instantaneous = reactions_of(model) == INSTANTANEOUS
        self.means = degree_of(model) == 0 and not instantaneous
        # Mean reactions need a row for either half of a step.
        self.integrators = [
            SubsystemIntegrator(_at_given_steps(r.model), r.solver, full, 2 * chunk, instantaneous)
            for r in integrators
        ]
        self.factor = SAFETY / (1.0 - 0.5 ** order_of(model))

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """See ``Companion``."""
        halves, rows = schedule.both_halves() if self.means else schedule.halves(), []
        for integrator, own in zip(integrators, self.integrators, strict=True):
            own.stepper.follow_degree(integrator.stepper)
            if not _advance(own, np.repeat(0.5 * steps.sizes, 2), halves):
                return None
            if self.means:
                both = _rows(own, 2 * len(times))
                mean = 0.5 * (both.reactions[::2] + both.reactions[1::2])
                rows.append(Rows(both.states[1::2], mean))
            else:
                rows.append(_rows(own, len(times)))
        return rows


class HigherOrder:
    """A scheme of higher order at a multiple of the run's step."""

    factor = SAFETY

    def __init__(
        self,
        model: Model,
        integrators: Sequence[SubsystemIntegrator],
        full: bool,
        chunk: int,
        coarser: Coarser,
    ) -> None:
        self.stride = coarser.stride
        self.name = f"{coarser.scheme}{coarser.degree} at {coarser.stride} steps in one"
        self.integrators = [
            SubsystemIntegrator(_by(r.model, coarser), r.solver, full, chunk) for r in integrators
        ]

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """See ``Companion``."""
        first = range(0, len(steps.sizes), self.stride)
        groups = [steps.sizes[k : k + self.stride].sum() for k in first]
        ends = [steps.ends[min(k + self.stride, len(steps.ends)) - 1] for k in first]
        schedule = OutputSchedule.passed(times, steps.begin, np.array(ends))
        rows = []
        for own in self.integrators:
            if not _advance(own, np.array(groups), schedule):
                return None
            rows.append(_rows(own, len(times)))
        return rows


class Known:
    """The rows of a more accurate run that has been made before."""

    name, stride, factor = "an earlier run of higher accuracy", 1, SAFETY

    def __init__(self, rows: list[Rows]) -> None:
        self.rows, self.first = rows, 0  # of all rows, the next to give out
        self.integrators: list[SubsystemIntegrator] = []

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> list[Rows] | None:
        """See ``Companion``."""
        return self.next_rows(len(times))

    def next_rows(self, count: int) -> list[Rows]:
        """The rows that follow those given out so far."""
        span = slice(self.first, self.first + count)
        self.first += count
        return [Rows(*(table[span] for table in rows)) for rows in self.rows]


def _rows(integrator: SubsystemIntegrator, count: int) -> Rows:
    """The first rows of the present chunk."""
    tables = integrator.workspace.tables
    return Rows(tables.states[:count], tables.reactions[:count])


def choose_companion(
    model: Model,
    integrators: Sequence[SubsystemIntegrator],
    full: bool,
    chunk: int,
    steps: int,
    asked: bool,
) -> Companion | None:
    """The companion of a run of so many ``steps``; None where it would cost more than a second and
    more than the run itself, unless it is ``asked`` for.
    """
    degree, unknowns = degree_of(model), sum(r.workspace.unknowns.free.size for r in integrators)
    own = steps * unknowns * SECONDS_PER_UNKNOWN * DEGREE_COST[degree]
    if asked or local_tolerance_of(model) is not None or 2.0 * own <= WORTH:
        return HalfStep(model, integrators, full, chunk)
    coarser = COARSER.get((scheme_of(model), degree))
    if coarser is None:
        return None
    cost = DEGREE_COST[coarser.degree] / (DEGREE_COST[degree] * coarser.stride)
    return HigherOrder(model, integrators, full, chunk, coarser) if cost < 1.0 else None


def unseen_motion(model: Model, length: float) -> float:
    """How far prescribed motions go to and fro [m] between the times at which run and companion
    meet them, the ends and the middles of steps; 0 where these follow them. Angles count by
    ``length`` [m].
    """
    simulation, motions = model.simulation, model.motions
    laws = build_laws([motion.law for motion in motions])
    steps = np.linspace(0.0, simulation.t_final - simulation.dt, MOTION_SAMPLES)
    worst = 0.0
    for k, motion in enumerate(motions):
        met, between = (
            np.array([[evaluate(laws, k, t + tau * simulation.dt)[0] for tau in of] for t in steps])
            for of in (MET, BETWEEN)
        )
        followed = met @ PARABOLA
        off = np.abs(between - followed).max(axis=1)
        spread = np.ptp(np.hstack([met, between]), axis=1)
        missed = off > np.maximum(UNFOLLOWED * spread, SAME * np.ptp(met))
        if np.count_nonzero(missed) > OFTEN * MOTION_SAMPLES:
            angle = isinstance(motion, JointMotion) and motion.coordinate == "angle"
            worst = max(worst, float(off[missed].max()) * (length if angle else 1.0))
    return worst


def unresolved_friction(integrator: SubsystemIntegrator, h: float, t_final: float) -> float:
    """Error of positions [m] where friction changes a rate by more than its width in a step ``h``.

    While the rate passes the width friction is not yet at its limit. Both runs miss that if it is
    over within a step, which leaves a rate wrong by up to half the width until ``t_final``.
    """
    system, reaction = integrator.workspace.system, integrator.workspace.state.reaction
    passed = forces.unresolved_speed(system.forces, system.scalar, system.frames, reaction, h)
    return passed * t_final


class ErrorEstimate:
    """The estimate as it grows: largest errors, when they were reached, whether it has ended.

    ``accuracy`` [m] is what is asked of positions and orientations, if anything is.
    """

    def __init__(
        self,
        model: Model,
        integrators: Sequence[SubsystemIntegrator],
        companion: Companion,
        accuracy: float | None,
    ) -> None:
        self.companion, self.accuracy = companion, accuracy
        self.lengths = [r.workspace.system.frames.length[:-1] for r in integrators]
        self.columns = [_reaction_kinds(r.model) for r in integrators]
        # Means over steps have nothing to be compared with in a scheme of higher order.
        self.compared = (
            not isinstance(companion, HigherOrder) or reactions_of(model) == INSTANTANEOUS
        )
        self.largest = dict.fromkeys(FIGURES, 0.0)
        self.record: list[tuple[float, float]] = []  # last time before a larger error, and that
        self.speeds = [np.zeros((2, len(of))) for of in self.lengths]  # highest so far
        self.until, self.stopped = 0.0, False
        if not isinstance(companion, Known) and local_tolerance_of(model) is None:
            unseen = unseen_motion(model, max(float(of.max()) for of in self.lengths))
            self.largest["position"] = SAFETY * unseen
        self.kept: list[list[Rows]] | None = None  # chunks of rows of all subsystems
        for integrator in companion.integrators:
            integrator.show_start()

    def begin(self, integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
        """Compare the rows at t = 0; the row of ``follow``."""
        mine, other = (
            [_rows(r, 1) for r in of] for of in (integrators, self.companion.integrators)
        )
        if isinstance(self.companion, Known):
            other = self.companion.next_rows(1)
        return self.compare(mine, other, np.zeros(1), np.zeros(1))

    def keep_rows(self) -> None:
        """Keep the companion's rows, for ``Known``."""
        self.kept = []

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> np.ndarray:
        """Let the companion follow the ``steps`` that the run has taken, and compare
        the rows of ``plan``, at ``times``: (m, 3) time, estimated error of positions and of
        orientations [m]; no rows once the companion has stopped.
        """
        if self.stopped or not len(steps.sizes):
            return np.zeros((0, 3))
        others = self.companion.follow(integrators, steps, schedule, times)
        if others is None or not all(np.isfinite(rows.states).all() for rows in others):
            self.stopped = True
            return np.zeros((0, 3))
        mine = [_rows(r, len(times)) for r in integrators]
        return self.compare(mine, others, times, np.repeat(steps.sizes, np.diff(schedule.due)))

    def compare(
        self, own: Sequence[Rows], others: Sequence[Rows], times: np.ndarray, h: np.ndarray
    ) -> np.ndarray:
        """Take in the difference of rows, from steps of sizes ``h`` (m,) [s]; as ``follow``."""
        if not len(times):
            return np.zeros((0, 3))
        if self.kept is not None:
            self.kept.append([Rows(r.states.copy(), r.reactions.copy()) for r in others])
        found = dict.fromkeys(FIGURES, np.zeros(len(times)))
        for k, (mine, other) in enumerate(zip(own, others, strict=True)):
            for name, value in self._errors(k, mine, other, h).items():
                found[name] = np.maximum(found[name], value)
        for name in self.largest:
            self.largest[name] = max(self.largest[name], float(found[name].max()))
        self._note(np.maximum(found["position"], found["orientation"]), times)
        return np.stack([times, found["position"], found["orientation"]], axis=1)

    def _errors(self, k: int, mine: Rows, other: Rows, h: np.ndarray) -> dict[str, np.ndarray]:
        """(m,) largest estimated errors of the rows of subsystem ``k``, by figure."""
        m, lengths, factor = len(mine.states), self.lengths[k], self.companion.factor
        a, b = (rows.states.reshape(m, len(lengths), 4, 3) for rows in (mine, other))
        way = factor * np.linalg.norm(a[:, :, 0::2] - b[:, :, 0::2], axis=-1)
        floor = ROUND_OFF * (np.abs(a[:, :, 0]).max(axis=-1) + lengths)
        spin = factor * np.linalg.norm(a[:, :, 3] - b[:, :, 3], axis=-1)
        turn = factor * angles(a[:, :, 1], b[:, :, 1]) * lengths
        speeds = np.linalg.norm(a[:, :, 2:], axis=-1).transpose(0, 2, 1)
        speeds = np.maximum.accumulate(np.concatenate([self.speeds[k][None], speeds]))[1:]
        self.speeds[k] = speeds[-1]
        reversed_way = np.where(way[:, :, 1] > REVERSED * speeds[:, 0], way[:, :, 1], 0.0)
        reversed_turn = np.where(spin > REVERSED * speeds[:, 1], spin * lengths, 0.0)
        hidden = h[:, None] / np.pi
        position = np.maximum(np.maximum(way[:, :, 0], floor), hidden * reversed_way)
        turn = np.maximum(np.maximum(turn, ROUND_OFF * lengths), hidden * reversed_turn)
        errors = {
            "position": position.max(axis=1),
            "orientation": turn.max(axis=1),
            "velocity": way[:, :, 1].max(axis=1),
            "angularVelocity": spin.max(axis=1),
        }
        if self.compared:
            apart = factor * np.abs(mine.reactions - other.reactions)
            for kind, columns in self.columns[k].items():
                if len(columns):
                    square = (apart[:, columns] ** 2).sum(axis=2)
                    errors[kind] = np.sqrt(square).max(axis=1)
        return errors

    def _note(self, errors: np.ndarray, times: np.ndarray) -> None:
        """Record when the largest error has grown."""
        risen = np.maximum.accumulate(errors)
        before = np.append(self.until, times[:-1])
        last = self.record[-1][1] if self.record else 0.0
        while (k := int(np.searchsorted(risen, max(RISE * last, float_info.min)))) < len(risen):
            last = float(risen[k])
            self.record.append((float(before[k]), last))
        self.until = float(times[-1])

    def add_damped(self, lost: float, size: float, kinetic: float, way: float) -> None:
        """Take in the energy ``lost`` [J] by damping from a run whose energies are of this ``size``
        [J], the largest kinetic energy is ``kinetic`` [J], and whose bodies go no farther than
        ``way`` [m] in a step.
        """
        of_companion = -sum(float(r.workspace.state.work[-1]) for r in self.companion.integrators)
        hidden = 2.0 * of_companion - lost
        counts = of_companion > LOST_ALIKE * lost and hidden > ENERGY_ROUND_OFF * size
        if isinstance(self.companion, HalfStep) and kinetic > 0.0 and counts:
            amplitude = 0.5 * way * (hidden / kinetic) ** 0.5
            self.largest["position"] = max(self.largest["position"], amplitude)

    def add_unresolved(self, way: float, farthest: float, other: float) -> None:
        """Take in that a body would go at least a ``way`` [m] in a step, and never was more than
        ``farthest`` [m] from where it began; and the ``other`` error [m] that no run shows, of a
        velocity that is wrong all the time.
        """
        amplitude = way / np.pi if way > FARTHER * farthest else 0.0
        self.largest["position"] = max(self.largest["position"], amplitude, other)
        if self.until > 0.0:
            self.largest["velocity"] = max(self.largest["velocity"], other / self.until)

    def known(self) -> Known:
        """The companion's rows of the whole run, which were kept."""
        assert self.kept is not None
        of_subsystems = zip(*self.kept, strict=True)
        return Known([Rows(*map(np.concatenate, zip(*r, strict=True))) for r in of_subsystems])

    @property
    def error(self) -> float:
        """Largest error of positions and orientations [m]."""
        return max(self.largest["position"], self.largest["orientation"])

    def horizon(self, accuracy: float) -> float:
        """Up to which time [s] the error stays within ``accuracy`` [m]; 0 if it never does, or if
        an error that no row shows is larger.
        """
        shown = self.record[-1][1] if self.record else 0.0
        if self.error > max(accuracy, RISE * shown):
            return 0.0
        return next((time for time, error in self.record if error > accuracy), self.until)

    def figures(self) -> dict[str, Any]:
        """All that it has found so far, as JSON can hold it."""
        return {
            "largest": dict(self.largest),
            "record": list(self.record),
            "speeds": [of.tolist() for of in self.speeds],
            "until": self.until,
            "stopped": self.stopped,
        }

    def recall(self, figures: dict[str, Any]) -> None:
        """Go back to what ``figures`` told."""
        self.largest, self.stopped = dict(figures["largest"]), figures["stopped"]
        self.record = [(time, error) for time, error in figures["record"]]
        self.speeds = [np.array(of) for of in figures["speeds"]]
        self.until = figures["until"]
        self.kept = None  # the rows before are not among them

    def as_json(self) -> dict[str, Any]:
        """The figures by name, as ``run.json`` has them; the error is not known after ``until``."""
        known = [kinds for kinds in self.columns if self.compared]
        shown = {
            name: float(value)
            for name, value in self.largest.items()
            if name in STATE_FIGURES or any(len(kinds[name]) for kinds in known)
        }
        accuracy = {}
        if self.accuracy is not None:
            accuracy = {"accuracy": self.accuracy, "trustHorizon": self.horizon(self.accuracy)}
        end = {"companion": self.companion.name, "until": self.until, "complete": not self.stopped}
        return {**shown, **accuracy, **end}


STATE_FIGURES = ("position", "orientation", "velocity", "angularVelocity")
REACTION_FIGURES = ("force", "moment", "load")
FIGURES = (*STATE_FIGURES, *REACTION_FIGURES)


def _reaction_kinds(model: Model) -> dict[str, np.ndarray]:
    """Columns (k, 3) of the joints' forces and moments and (k, 1) of other loads, of the table of
    reactions without the time.
    """
    names = [name.rsplit(".", 1)[1] for name in reaction_columns(model)[1:]]
    first = {kind: [i for i, n in enumerate(names) if n == kind] for kind in ("Fx", "Mx", "load")}
    three = np.arange(3)
    return {
        "force": np.array(first["Fx"], dtype=int)[:, None] + three,
        "moment": np.array(first["Mx"], dtype=int)[:, None] + three,
        "load": np.array(first["load"], dtype=int)[:, None],
    }


def _at_given_steps(model: Model) -> Model:
    """The same, at steps that are given."""
    simulation = replace(
        model.simulation, scheme=scheme_of(model), tolerance=None, local_tolerance=None
    )
    return replace(model, simulation=simulation)


def _by(model: Model, coarser: Coarser) -> Model:
    """The same by the scheme and at the step of its companion."""
    dt = coarser.stride * model.simulation.dt
    simulation = replace(
        model.simulation, scheme=coarser.scheme, degree=coarser.degree, dt=dt, interval=None
    )
    return replace(model, simulation=simulation)


def _advance(integrator: SubsystemIntegrator, sizes: np.ndarray, schedule: OutputSchedule) -> bool:
    """Take steps of these ``sizes``; whether all were solved."""
    first = 0
    for last in [*(np.flatnonzero(np.diff(sizes)) + 1), len(sizes)]:
        chunk = Chunk(int(last), first, float(sizes[first]), schedule=schedule)
        if integrator.advance(chunk).steps < last:
            return False
        first = int(last)
    return True
