"""Motions that are prescribed completely: positions, velocities, accelerations and reactions.

At every output time the constraint equations are solved by themselves (``configuration``), from
the time before on the same branch (``follow``), so no error is carried from one time to the next.
How well the numbers are known follows from the condition of G: with its smallest singular value
sigma, its norm |G|, machine epsilon e, the size L of the model, the smallest length l of a body,
and the largest speed V and acceleration A of displacements and of rotations times lengths,

    e_q = e L / sigma                                                    [m]
    e_v = V (e |G| + e_q / l) / sigma                                    [m/s]
    e_a = (A (e |G| + e_q / l) + 2 V e_v / l + V^2 e_q / l^2) / sigma    [m/s^2]
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from msahl.analysis.constant_inputs import with_constant_inputs
from msahl.analysis.kinematics.configuration import EPSILON, Equations, new_equations
from msahl.analysis.kinematics.follow import Follower, Instant, LostError
from msahl.analysis.kinematics.prescribed import require_compatible, require_prescribed
from msahl.analysis.kinematics.singular import CLOSE, Singular, limit_position, singular_positions
from msahl.analysis.kinematics.tables import Recorder, element_names
from msahl.analysis.linearised.point import Point, at_start
from msahl.analysis.no_contacts import require_no_contacts
from msahl.jit.by_size import compiled_once
from msahl.model import INSTANTANEOUS, Model
from msahl.model.settings import YES
from msahl.records import record
from msahl.run.tables import Sink
from msahl.run.time_grid import TimeGrid
from msahl.start.velocities import StartError

MANY = 5000
"""Output times times bodies from which kernels are compiled, or loaded: plain Python takes some 4
ms for each, compiling some ten seconds."""
MOST_BODIES = 500
"""Bodies up to which matrices are decomposed as dense ones, in some seconds each."""
REVIEWS = 16
"""Output times at which it is found which reactions are unique."""


@dataclass
class ErrorBars:
    """Largest estimated round-off at the output times, of displacements and of rotations times
    lengths of bodies.
    """

    position: float = 0.0  # [m]
    velocity: float = 0.0  # [m/s]
    acceleration: float = 0.0  # [m/s^2]
    condition: float = 0.0  # largest condition number of G
    speed: float = 0.0  # largest V [m/s]
    largest: float = 0.0  # largest A [m/s^2]

    def add(self, equations: Equations, instant: Instant, length: float) -> None:
        """Take an ``instant`` into account; ``length`` [m] is the smallest of a body."""
        sigma, norm = max(instant.sigma, 1e-300), float(instant.solved.values[0])
        state, lengths = instant.state, equations.system.frames.length[:, None]
        V = max(_largest(state.v), _largest(lengths * state.w))
        A = max(_largest(state.a), _largest(lengths * state.alpha))
        q = EPSILON * equations.size / sigma
        relative = EPSILON * norm + q / length
        v = V * relative / sigma
        a = (A * relative + 2.0 * V * v / length + V * V * q / length**2) / sigma
        self.position, self.velocity = max(self.position, q), max(self.velocity, v)
        self.acceleration = max(self.acceleration, a)
        self.condition = max(self.condition, instant.condition)
        self.speed, self.largest = max(self.speed, V), max(self.largest, A)


def _largest(vectors: np.ndarray) -> float:
    return float(np.linalg.norm(vectors, axis=1).max(initial=0.0))


@dataclass
class Motion:
    """What was found of a prescribed motion, besides the rows that the sink received."""

    point: Point
    equations: Equations
    errors: ErrorBars = field(default_factory=ErrorBars)
    singular: list[Singular] = field(default_factory=list)
    omitted: list[float] = field(default_factory=list)  # output times at singular positions [s]
    rows: int = 0
    time: float = 0.0  # of the last row [s]
    complete: bool = False
    steps: int = 0
    iterations: int = 0
    violation: float = 0.0  # [m]
    contradiction: float = 0.0
    energy_error: float = 0.0  # [J]
    kinetic: float = 0.0  # largest kinetic energy [J]
    non_unique: dict[str, list[str]] = field(default_factory=dict)
    redundant: int = 0


@record(slots=False)
class Prepared:
    """A model whose motion is prescribed completely, at t = 0; ``rank`` of its equations."""

    model: Model
    point: Point
    equations: Equations
    rank: int


def prepare(model: Model) -> Prepared:
    """Return a ``model`` ready to be followed; raises ``StartError`` if its motion is not
    prescribed completely, or if there are no consistent positions at t = 0.
    """
    if len(model.bodies) > MOST_BODIES:
        raise StartError(
            f"the model has {len(model.bodies)} bodies; motions of up to {MOST_BODIES} are "
            "computed, by dense matrices: run the deck with msahl run"
        )
    require_no_contacts(model)
    model = with_constant_inputs(model)
    # Velocities of the deck at t = 0 do not count: all follow from the motions.
    point = at_start(replace(model, velocity="asGiven"))
    equations = new_equations(point.system, point.state)
    rank = require_prescribed(model, equations, point.state)
    require_compatible(model, equations, point.state)
    return Prepared(model, point, equations, rank)


def follow(
    prepared: Prepared,
    times: Sequence[float] | np.ndarray,
    sink: Sink,
    progress: Callable[[float], Any] = lambda t: None,
) -> Motion:
    """Compute a prescribed motion at the ``times`` [s], which increase from 0, into ``sink``.

    Raises ``StartError`` if the positions at t = 0 are singular. A motion that cannot be followed
    to the last time is not ``complete``.
    """
    point, equations = prepared.point, prepared.equations
    if len(times) * len(prepared.model.bodies) >= MANY:
        equations = new_equations(
            point.system, point.state, lambda k, *given: compiled_once(k)(*given)
        )
    found = Motion(point, equations, redundant=equations.equation.size - prepared.rank)
    try:
        follower = Follower(equations, point.state, prepared.rank, float(times[-1]))
    except LostError as error:
        raise StartError(f"{error} at t = 0: look for motions that contradict each other") from None
    _require_regular(follower.last)
    recorder = Recorder(prepared.model, equations, point.unknowns, sink)
    try:
        _record_all(found, follower, recorder, [float(t) for t in times], progress)
        found.complete = True
    except LostError:
        passed = follower.passed
        found.singular += _new(found, singular_positions(follower, passed))
        limit = limit_position(follower, passed)
        found.singular += [limit] if limit else []
    found.steps, found.iterations = follower.steps, follower.iterations
    found.energy_error, found.kinetic = recorder.finish(), recorder.kinetic
    found.non_unique = element_names(prepared.model, recorder.shared)
    return found


def _record_all(
    found: Motion,
    follower: Follower,
    recorder: Recorder,
    times: list[float],
    progress: Callable[[float], Any],
) -> None:
    """Record all output times, as far as the motion goes; raises ``LostError`` there."""
    reviewed = set(np.linspace(0, len(times) - 1, REVIEWS).astype(int).tolist())
    for k, time in enumerate(times):
        instant = follower.last if k == 0 else _at(follower, time, found)
        if instant is not None:
            _record(found, recorder, instant, follower.length)
            if found.redundant and k in reviewed:
                recorder.review_reactions()
        passed = follower.passed
        found.singular += _new(found, singular_positions(follower, passed))
        follower.forget()
        progress(time)


def _at(follower: Follower, time: float, found: Motion) -> Instant | None:
    """Return the instant at an output time; None if it cannot be told from a singular position."""
    if time <= follower.last.time:  # passed because an output time before it was singular
        found.omitted.append(time)
        return None
    instant = follower.go_to(time)
    if instant is None or 1.0 / instant.condition < CLOSE:
        found.omitted.append(time)
        return None
    return instant


def _require_regular(first: Instant) -> None:
    if 1.0 / first.condition < CLOSE:
        raise StartError(
            "the positions at t = 0 are singular (condition number "
            f"{first.condition:.1e}), so velocities do not follow from the motions; begin the "
            "motion elsewhere"
        )


def _record(found: Motion, recorder: Recorder, instant: Instant, length: float) -> None:
    recorder.add(instant)
    found.errors.add(found.equations, instant, length)
    found.violation = max(found.violation, instant.violation)
    found.contradiction = max(found.contradiction, instant.contradiction)
    found.rows, found.time = found.rows + 1, instant.time


def _new(found: Motion, positions: list[Singular]) -> list[Singular]:
    """Return the singular positions that are not among those found: the last interval of a chunk
    is seen again as the first one of the next.
    """
    known = [s.time for s in found.singular]
    new = list[Singular]()
    for position in positions:
        tolerance = 1e-6 * max(abs(position.time), 1e-300)
        if not any(abs(position.time - t) <= tolerance for t in known):
            new.append(position)
            known.append(position.time)
    return new


def options_of(step: float | None, t_final: float | None) -> dict[str, Any]:
    """Return the options with which a run would write what is computed here."""
    given: dict[str, Any] = {"reactions": INSTANTANEOUS, "accelerations": YES}
    given |= {"t_final": t_final, "dt": step, "output_interval": step}
    return {name: value for name, value in given.items() if value is not None}


def output_times(model: Model, every: int = 1) -> np.ndarray:
    """(m,) every ``every``-th output time of a run of the ``model``, and the last one [s]."""
    grid = TimeGrid.of_output(model.simulation)
    rows = np.arange(grid.n + 1)
    return np.asarray(grid.times(rows[(rows % every == 0) | (rows == grid.n)]))
