"""The global error of a run, estimated by comparison with a companion run of higher accuracy.

At every output time the results y of the run are compared with the results y* of its companion:

    |y - y_exact|  <=  SAFETY |y - y*| / (1 - 2^-p)        companion at half the step, order p
    |y - y_exact|  <=  SAFETY |y - y*|                     companion of a higher order

The quotient is Richardson's, exact as the step size tends to zero: a companion at half the step has
2^-p of the error. No estimate is below the round-off of the largest coordinate.

A vibration that is faster than the steps may look the same at the output times of both runs while
its true amplitude a is missed. Its half-period is shorter than the step size h, so a < h/pi times
the error of the velocity, which such a vibration reverses from step to step. Where that error is a
noticeable fraction of the speeds, position errors are assumed to be no smaller, except in a
subsystem whose constraints determine all its motion: that cannot vibrate. A dissipative
scheme removes the energy E of the vibration in both runs alike, while the energy that it takes from
resolved motions decreases by 2^-p or more at half the step:

    a < h/2 |v|_max sqrt(E / K_max) ,    E = 2 E_companion - E_run     [J]

if the companion lost three quarters of what the run lost, and more than round-off. A gauss scheme
of even degree may keep both position and velocity of such a vibration. Then a body moves by h |v|
in a step and yet is never far from its position at t = 0, and h |v|/pi is the estimate.

Errors that both runs make alike are in ``unseen_errors``.

Errors are those of the published numbers: positions of the bodies' reference points [m],
orientations as angle times the body's length [m], velocities [m/s] and angular velocities [rad/s]
in body axes, joint forces [N] and moments [N m], loads of couplings and prescribed motions, and
signals, auxiliary states and loads of actuators, each by itself (``signal_errors``). Where contacts
or events make velocities jump, vibrations are looked for, and reactions judged, by errors that last
(``lasting``).
"""

from collections.abc import Iterable, Iterator, Sequence
from sys import float_info
from typing import Any

import numpy as np

from msahl.algebra.rotation_arrays import angles
from msahl.model import Model, RunSettings
from msahl.run.companion import (
    SAFETY,
    Companion,
    EarlierRun,
    HalfStepCompanion,
    HigherOrderCompanion,
    Rows,
    Steps,
    first_rows,
)
from msahl.run.error_history import GROWTH, ErrorHistory
from msahl.run.lasting import Lasting
from msahl.run.signal_errors import SignalErrors
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.unseen_errors import unseen_jump, unseen_motion
from msahl.schemes.output_schedule import OutputSchedule
from msahl.system.names import reaction_columns
from msahl.system.signal_terms import Scales, Sizes

ROUND_OFF = 4.0 * float_info.epsilon
"""Smallest relative error of the largest coordinate that an estimate may have."""
OSCILLATING = 2.0
"""Ratio of a step's displacement at the highest speed to the largest displacement since t = 0 above
which the motion oscillates within one step: it then passes a third of a cycle or more in one. A
gauss or radau scheme of degree s resolves s times that in a step and half of it in a half step, so
the comparison shows its error up to there."""
LOST_ALIKE = 0.75
"""Fraction of the run's energy loss that the companion loses as well if it is the energy of
vibrations that neither resolves. Of resolved motions it is a half at most, up to higher orders."""
REVERSED = 0.02
"""Fraction of a body's highest speed so far above which an error of its velocity may be a vibration
that the steps reverse. Errors of resolved motions are smaller, or appear in the positions."""
SAME_LOSS = 0.1
"""Largest relative difference of the energies that radau takes at both step sizes, in either half
of the run, if the loss does not depend on the step. That of motions which the steps resolve does,
and vibrations that they do not resolve are gone after a few steps."""
ENERGY_ROUND_OFF = 1e3 * float_info.epsilon
"""Sum of the rounding errors of a run's energies, relative to the largest energy."""
STATE_FIGURES = ("position", "orientation", "velocity", "angularVelocity")
REACTION_FIGURES = ("force", "moment", "load")
FIGURES = (*STATE_FIGURES, *REACTION_FIGURES)
NO_ERRORS = np.zeros((0, 3))
"""Rows of the table of errors where none are known."""


class ErrorEstimate:
    """The estimate while the run goes on: largest errors, when they were reached, and whether the
    companion has stopped.
    """

    def __init__(
        self,
        model: Model,
        integrators: Sequence[SubsystemIntegrator],
        companion: Companion,
        settings: RunSettings,
    ) -> None:
        self.companion, self.accuracy = companion, settings.accuracy
        self.lengths = [one.workspace.system.frames.length[:-1] for one in integrators]
        self.columns = [_reaction_kinds(one.model) for one in integrators]
        self.is_free = [one.rank < 6 * one.size for one in integrators]
        # Mean reactions have no counterpart in a scheme of higher order.
        self.compares_reactions = (
            not isinstance(companion, HigherOrderCompanion) or settings.instantaneous
        )
        self.largest = dict.fromkeys(FIGURES, 0.0)
        self.sizes = dict.fromkeys(REACTION_FIGURES, 0.0)  # largest reactions so far
        self.signals = SignalErrors(model, integrators)
        self.history = ErrorHistory()
        self.speeds = [np.zeros((2, len(one))) for one in self.lengths]  # highest so far
        self.lasting = dict.fromkeys(REACTION_FIGURES, 0.0)  # errors of reactions that last
        # What is a jump where velocities may do so is no vibration, and spoils no reactions.
        changing = [k for k, one in enumerate(integrators) if one.changes]
        self.lasting_rates = {k: Lasting(2 * len(self.lengths[k])) for k in changing}
        self.lasting_reactions = {k: Lasting(len(self.columns[k])) for k in changing}
        self.stopped = False
        if not isinstance(companion, EarlierRun) and not settings.adaptive:
            unseen = unseen_motion(model, max(float(one.max()) for one in self.lengths))
            self.largest["position"] = SAFETY * unseen
        self.oscillating = OSCILLATING * max(settings.degree, 1)
        # Energies that radau has taken in the run and in its companion, up to half of its time [J].
        self.half, self.taken_by_half = 0.5 * settings.t_final, np.zeros(2)
        radau = settings.dissipative and settings.degree > 0
        self.takes = radau and isinstance(companion, HalfStepCompanion)
        self.kept: list[list[Rows]] | None = None  # chunks of rows of all subsystems
        for integrator in companion.integrators:
            integrator.show_start()

    def begin(self, integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
        """Compare the rows at t = 0; returns the row that ``follow`` returns."""
        first, other = (
            [first_rows(integrator, 1) for integrator in group]
            for group in (integrators, self.companion.integrators)
        )
        if isinstance(self.companion, EarlierRun):
            other = self.companion.next_rows(1)
        return self.compare(first, other, np.zeros(1), np.zeros(1))

    def keep_rows(self) -> None:
        """Keep the companion's rows from now on, for an ``EarlierRun``."""
        self.kept = []

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> np.ndarray:
        """Let the companion follow the ``steps`` of the run, and compare the rows of the
        ``schedule``, at ``times``. Returns (m, 3 + signals): time [s], estimated errors of
        positions and of orientations [m], and of signals; without rows after the companion has
        stopped.
        """
        if self.stopped or not len(steps.sizes):
            return NO_ERRORS
        others = self.companion.follow(integrators, steps, schedule, times)
        if others is None or not all(np.isfinite(rows.states).all() for rows in others):
            self.stopped = True
            return NO_ERRORS
        if self.takes:
            self._note_taken(integrators, times)
        own = [first_rows(integrator, len(times)) for integrator in integrators]
        errors = self.compare(own, others, times, np.repeat(steps.sizes, np.diff(schedule.due)))
        self._add_unseen_jumps(integrators, times)
        return errors

    def _add_unseen_jumps(
        self, integrators: Sequence[SubsystemIntegrator], times: np.ndarray
    ) -> None:
        """Add the jumps of velocities at impacts that are on the wrong side of a row in both."""
        share = self.companion.factor / SAFETY
        pairs = zip(integrators, self.companion.integrators, self.lengths, strict=False)
        for integrator, other, lengths in pairs:
            given = (share, times, self.error, float(lengths.max()))
            jump = unseen_jump(integrator, other, *given)
            self.largest["velocity"] = max(self.largest["velocity"], jump)

    def compare(
        self, own: Sequence[Rows], others: Sequence[Rows], times: np.ndarray, h: np.ndarray
    ) -> np.ndarray:
        """Add the differences of rows, from steps of sizes ``h`` (m,) [s]; as ``follow``."""
        if not len(times):
            return NO_ERRORS
        if self.kept is not None:
            self.kept.append([Rows(*(table.copy() for table in rows)) for rows in others])
        found = dict.fromkeys(FIGURES, np.zeros(len(times)))
        for k, (mine, other) in enumerate(zip(own, others, strict=True)):
            errors = self._state_errors(k, mine.states, other.states, h)
            if self.compares_reactions:
                errors |= self._reaction_errors(k, mine.reactions, other.reactions)
            for name, value in errors.items():
                found[name] = np.maximum(found[name], value)
        for name in self.largest:
            self.largest[name] = max(self.largest[name], float(found[name].max()))
        self.history.note(np.maximum(found["position"], found["orientation"]), times)
        of_signals = self.signals.compare(
            [rows.signals for rows in own],
            [rows.signals for rows in others],
            self.companion.factor,
        )
        bodies = np.stack([times, found["position"], found["orientation"]], axis=1)
        return np.concatenate([bodies, of_signals], axis=1)

    def _state_errors(
        self, k: int, mine: np.ndarray, other: np.ndarray, h: np.ndarray
    ) -> dict[str, np.ndarray]:
        """(m,) largest estimated errors of the states of subsystem ``k``, by figure."""
        m, lengths, factor = len(mine), self.lengths[k], self.companion.factor
        a, b = (states.reshape(m, len(lengths), 4, 3) for states in (mine, other))
        apart = factor * np.linalg.norm(a[:, :, 0::2] - b[:, :, 0::2], axis=-1)
        floor = ROUND_OFF * (np.abs(a[:, :, 0]).max(axis=-1) + lengths)
        angular = factor * np.linalg.norm(a[:, :, 3] - b[:, :, 3], axis=-1)
        angle = factor * angles(a[:, :, 1], b[:, :, 1]) * lengths
        speeds = np.linalg.norm(a[:, :, 2:], axis=-1).transpose(0, 2, 1)
        speeds = np.maximum.accumulate(np.concatenate([self.speeds[k][None], speeds]))[1:]
        self.speeds[k] = speeds[-1]
        velocity = apart[:, :, 1]
        lasting = np.concatenate([velocity, angular], axis=1)
        if k in self.lasting_rates:
            lasting = self.lasting_rates[k].add(lasting)
        linear, rotary = np.split(lasting, 2, axis=1)
        reversed_velocity = np.where(linear > REVERSED * speeds[:, 0], linear, 0.0)
        reversed_angular = np.where(rotary > REVERSED * speeds[:, 1], rotary * lengths, 0.0)
        hidden = h[:, None] / np.pi if self.is_free[k] else np.zeros((m, 1))
        position = np.maximum(np.maximum(apart[:, :, 0], floor), hidden * reversed_velocity)
        angle = np.maximum(np.maximum(angle, ROUND_OFF * lengths), hidden * reversed_angular)
        return {
            "position": position.max(axis=1),
            "orientation": angle.max(axis=1),
            "velocity": velocity.max(axis=1),
            "angularVelocity": angular.max(axis=1),
        }

    def _reaction_errors(
        self, k: int, mine: np.ndarray, other: np.ndarray
    ) -> dict[str, np.ndarray]:
        """(m,) largest estimated errors of the reactions of subsystem ``k``, by figure."""
        errors = dict.fromkeys(self.columns[k], np.zeros(len(mine)))
        apart = self.companion.factor * np.abs(mine - other)
        for kind, columns in self.columns[k].items():
            if len(columns):
                errors[kind] = np.linalg.norm(apart[:, columns], axis=2).max(axis=1)
                size = float(np.linalg.norm(mine[:, columns], axis=2).max())
                self.sizes[kind] = max(self.sizes[kind], size)
        lasting = np.stack([*errors.values()], axis=1)
        if k in self.lasting_reactions:
            lasting = self.lasting_reactions[k].add(lasting)
        for kind, values in zip(errors, lasting.T, strict=True):
            self.lasting[kind] = max(self.lasting[kind], float(values.max()))
        return errors

    def add_damped(
        self, dissipated: float, size: float, kinetic: float, displacement: float
    ) -> None:
        """Add the error behind the energy ``dissipated`` [J] by damping. The energies have this
        ``size`` [J], its largest kinetic energy is ``kinetic`` [J], and no body moves farther than
        ``displacement`` [m] in a step.
        """
        of_companion = -sum(
            float(integrator.workspace.state.work[-1]) for integrator in self.companion.integrators
        )
        hidden = 2.0 * of_companion - dissipated
        counts = of_companion > LOST_ALIKE * dissipated and hidden > ENERGY_ROUND_OFF * size
        if isinstance(self.companion, HalfStepCompanion) and kinetic > 0.0 and counts:
            amplitude = 0.5 * displacement * (hidden / kinetic) ** 0.5
            self.largest["position"] = max(self.largest["position"], amplitude)

    def _note_taken(self, integrators: Sequence[SubsystemIntegrator], times: np.ndarray) -> None:
        """Note what the scheme has taken up to the last of the ``times`` in the first half."""
        last = int(np.searchsorted(times, self.half, side="right")) - 1
        if last >= 0:
            self.taken_by_half = _taken(
                [one.workspace.tables.work[last] for one in group]
                for group in (integrators, self.companion.integrators)
            )

    def taken_at_any_step(self, integrators: Sequence[SubsystemIntegrator]) -> float | None:
        """Energy [J] that radau took in the second half of the run and that no smaller step keeps:
        energies or works are not those of the motion then. None where it is not known.
        """
        if not self.takes or self.stopped:
            return None
        total = _taken(
            [one.workspace.state.work for one in group]
            for group in (integrators, self.companion.integrators)
        )
        losses = np.stack([self.taken_by_half, total - self.taken_by_half])
        alike = np.abs(np.diff(losses, axis=1)[:, 0]) <= SAME_LOSS * losses[:, 0]
        return float(losses[1, 1]) if alike.all() else 0.0

    def add_unresolved(self, displacement: float, farthest: float, unseen: float) -> None:
        """Add that a body's velocity moves it by at least ``displacement`` [m] in a step, while it
        never was more than ``farthest`` [m] from its position at t = 0; and the ``unseen`` error
        [m] of a velocity that is wrong all the time.
        """
        amplitude = displacement / np.pi if displacement > self.oscillating * farthest else 0.0
        self.largest["position"] = max(self.largest["position"], amplitude, unseen)
        if self.history.until > 0.0:
            self.largest["velocity"] = max(self.largest["velocity"], unseen / self.history.until)

    def judge_signals(
        self, integrators: Sequence[SubsystemIntegrator], scales: Scales, asked: float
    ) -> None:
        """Compare the errors of signals with their sizes, at the end of the run."""
        if self.signals.names:
            self.signals.compare_sizes(integrators, scales, asked, self._of_motion())

    def _of_motion(self) -> Sizes:
        """Largest errors of positions and velocities, of points and of coordinates, and those of
        reactions, if they are known.
        """
        largest, lengths = self.largest, np.concatenate(self.lengths)
        reactions = [largest[name] for name in REACTION_FIGURES]
        return Sizes(
            position=largest["position"] + largest["orientation"],
            angle=largest["orientation"] / float(lengths.min()),
            velocity=largest["velocity"] + float(lengths.max()) * largest["angularVelocity"],
            spin=largest["angularVelocity"],
            reaction=max(reactions) if self.compares_reactions else np.inf,
            time=0.0,
        )

    def as_earlier_run(self) -> EarlierRun:
        """The companion's rows of the complete run, which were kept."""
        assert self.kept is not None
        subsystems = zip(*self.kept, strict=True)
        return EarlierRun(
            [Rows(*map(np.concatenate, zip(*parts, strict=True))) for parts in subsystems]
        )

    @property
    def error(self) -> float:
        """Largest error of positions and orientations [m]."""
        return max(self.largest["position"], self.largest["orientation"])

    def over_tolerance(self, tolerance: float) -> float:
        """Largest error over what a ``tolerance`` [m] allows, of positions and of signals."""
        length = max(float(lengths.max()) for lengths in self.lengths)
        return max(self.error / tolerance, self.signals.over_limits(tolerance / length))

    def horizon(self, accuracy: float) -> float:
        """Time [s] up to which the error stays within ``accuracy`` [m]; 0 if it never does, or if
        an error that appears in no row is larger.
        """
        if self.error > max(accuracy, GROWTH * self.history.largest):
            return 0.0
        return self.history.horizon(accuracy)

    def numbers(self) -> dict[str, Any]:
        """All figures so far, for a snapshot."""
        return {
            "largest": dict(self.largest),
            **self.history.numbers(),
            "speeds": [speeds.tolist() for speeds in self.speeds],
            "stopped": self.stopped,
            "sizes": dict(self.sizes),
            "lasting": dict(self.lasting),
            "takenByHalf": self.taken_by_half.tolist(),
            "signals": self.signals.numbers(),
            "medians": [one.last.tolist() for one in self._medians()],
        }

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        self.largest, self.stopped = dict(numbers["largest"]), numbers["stopped"]
        self.history.restore(numbers)
        self.speeds = [np.array(speeds) for speeds in numbers["speeds"]]
        self.sizes = dict(numbers["sizes"])
        self.lasting = dict(numbers["lasting"])
        self.taken_by_half = np.array(numbers["takenByHalf"])
        self.signals.restore(numbers["signals"])
        for one, last in zip(self._medians(), numbers["medians"], strict=True):
            one.last = np.array(last)
        self.kept = None  # the rows before are missing

    def _medians(self) -> Iterator[Lasting]:
        """The medians of all subsystems that have them."""
        yield from (*self.lasting_rates.values(), *self.lasting_reactions.values())

    def as_json(self) -> dict[str, Any]:
        """The figures by their names in ``run.json``; after ``until`` the error is not known."""
        known = [kinds for kinds in self.columns if self.compares_reactions]
        shown: dict[str, Any] = {
            name: float(value)
            for name, value in self.largest.items()
            if name in STATE_FIGURES or any(len(kinds[name]) for kinds in known)
        }
        reactions = [kind for kind in REACTION_FIGURES if kind in shown]
        if reactions:
            shown["largest"] = {kind: self.sizes[kind] for kind in reactions}
            shown["lasting"] = {kind: self.lasting[kind] for kind in reactions}
        if self.signals.names:
            shown["signals"] = self.signals.as_json()
        accuracy = {}
        if self.accuracy is not None:
            accuracy = {"accuracy": self.accuracy, "trustHorizon": self.horizon(self.accuracy)}
        until, complete = self.history.until, not self.stopped
        end = {"companion": self.companion.name, "until": until, "complete": complete}
        return {**shown, **accuracy, **end}


def _taken(works: Iterable[Sequence[np.ndarray]]) -> np.ndarray:
    """Energies [J] that the scheme took, of the ``works`` of the subsystems of several runs."""
    return np.array([-sum(float(work[-1]) for work in run) for run in works])


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
