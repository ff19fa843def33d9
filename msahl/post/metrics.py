"""Compute accuracy metrics of a run: energy balance, virtual work of joints, constraint violation.

    E     = sum over bodies of  m v_G.v_G/2 + w.J w/2 - m g.x_G         (3.5)-(3.10)
            + energy of the springs and beams
    error = E(t) - E(0) - work since t = 0 of what is not conservative: loads, dampers, motions
    RMS   = sqrt(mean of squares) over the output times                 (3.12)

The virtual work of the joints is that of ``post.virtual``. For the exact motion all metrics are
zero except Hainge's virtual work: it takes the velocity of the child instead of that of the joint,
and so measures the energy that the joint exchanges between translation and rotation. Equation
numbers: Hainge 2010.
"""

import numpy as np

from msahl.joints.registry import KINDS
from msahl.model import JointMotion, Model
from msahl.model.couplings import COORDINATES
from msahl.post.replay import History, observe
from msahl.post.virtual import child_work, joints_of, reaction_work
from msahl.records import record
from msahl.results.read import Run
from msahl.system.names import FORCE_COLUMNS, MOMENT_COLUMNS, workers

ROUND_OFF = 1e-12
"""If |E(1)| is below this fraction of the largest energy in the run, it is zero up to rounding."""


@record
class Statistics:
    """Root mean square, mean, and largest absolute value of a series."""

    rms: float
    mean: float
    max: float

    @classmethod
    def of(cls, series: np.ndarray) -> "Statistics":
        """Return the statistics of a series (m,) in its unit; zeros if it is empty."""
        if series.size == 0:
            return cls(0.0, 0.0, 0.0)
        largest = float(np.abs(series).max())
        # Squares of values near 1e-170 underflow to zero; those of scaled values do not.
        scale = largest if 0.0 < largest < np.inf else 1.0
        rms = scale * float(np.sqrt(np.mean((series / scale) ** 2)))
        return cls(rms, float(series.mean()), largest)

    def over(self, size: float | None) -> "Statistics | None":
        """Return the statistics of series / ``size``; ``None`` (undefined) if size is 0 or None."""
        return None if not size else Statistics(self.rms / size, self.mean / size, self.max / size)


@record
class Energy:
    """Energies [J] of n bodies at m output times, arrays (m, n); ``time`` [s], ``work`` of loads
    and motions [J] and ``elastic`` energy of springs and beams [J] (m,)."""

    time: np.ndarray
    bodies: tuple[str, ...]
    linear: np.ndarray
    rotational: np.ndarray
    potential: np.ndarray
    work: np.ndarray
    elastic: np.ndarray

    @property
    def kinetic(self) -> np.ndarray:
        """Return the kinetic energy of all bodies [J] (m,), eq. (3.8)."""
        kinetic: np.ndarray = (self.linear + self.rotational).sum(axis=1)
        return kinetic

    @property
    def total(self) -> np.ndarray:
        """Return kinetic, potential and elastic energy [J] (m,), eq. (3.9), (3.10)."""
        total: np.ndarray = self.kinetic + self.potential.sum(axis=1) + self.elastic
        return total

    @property
    def error(self) -> np.ndarray:
        """Return E(t) - E(0) - work of loads and motions since t = 0 [J] (m,)."""
        error: np.ndarray = self.balance - self.balance[0]
        return error

    @property
    def balance(self) -> np.ndarray:
        """Return total energy - work of loads and motions [J] (m,); it should be constant."""
        balance: np.ndarray = self.total - self.work
        return balance

    @property
    def largest_kinetic(self) -> float:
        """Return the largest kinetic energy [J]."""
        return float(self.kinetic.max())

    @property
    def first(self) -> float | None:
        """Return |E(1)| [J], the divisor of (3.11); ``None`` if it is zero up to rounding.

        Hainge divides by E(1) itself, which is negative for a body below the origin.
        """
        first = abs(float(self.total[0]))
        stored = (self.potential, self.elastic)
        largest = max(self.largest_kinetic, *(float(np.abs(part).max()) for part in stored))
        return first if first > ROUND_OFF * largest else None

    @property
    def absolute_error(self) -> Statistics:
        """Return the statistics of ``|error|`` [J]."""
        return Statistics.of(np.abs(self.error))

    @property
    def error_over_first(self) -> Statistics | None:
        """Return the statistics of |error| / |E(1)| (3.11), (3.12); ``None`` if E(1) is zero."""
        return self.absolute_error.over(self.first)

    @property
    def error_over_kinetic(self) -> Statistics | None:
        """Return the statistics of |error| over the largest kinetic energy; ``None`` at rest."""
        return self.absolute_error.over(self.largest_kinetic)


@record
class LoadWork:
    """``work`` since t = 0 and ``elastic`` energy [J] of w loads and motions, arrays (m, w); the
    elastic energy is nan for an element that stores none."""

    names: tuple[str, ...]
    work: np.ndarray
    elastic: np.ndarray


@record
class JointWork:
    """Virtual work [J] of k joints over each of m - 1 steps; arrays (m - 1, k).

    ``hainge``: F . C (V_{k-1} + V_k)/2 dt, F the mean force on the child over the step, V the
    velocity of the child's B in body axes, C the rotation matrix at the end of the step (the source
    does not say at which end). ``reaction``: work of the joint's reaction on both of its bodies
    (``post.virtual``). ``time`` [s] is the end of each step.
    """

    time: np.ndarray
    joints: tuple[str, ...]
    hainge: np.ndarray
    reaction: np.ndarray


@record
class Constraints:
    """Norms of the constraint violation of e joints, couplings and motions at ``time`` [s].

    ``violation`` is at position level, ``rate`` at velocity level. Arrays (m, e, 2): in m and m/s,
    and in rad and rad/s; nan where an element has no equation of that unit, or at position level if
    its equations constrain rates only. Scales to compare them with: ``length`` [m], the longest arm
    or radius of gyration in the model, and ``speed`` [m/s], the largest of a mass centre.
    """

    time: np.ndarray
    names: tuple[str, ...]
    violation: np.ndarray
    rate: np.ndarray
    length: float
    speed: float


@record
class Reactions:
    """Published reactions of e joints, couplings and motions; nan where an element has none.

    ``force`` [N] and ``moment`` [N m] (m, e, 3) of the parent on the child, inertial axes, and
    ``load`` (m, e, 2) of couplings and motions [N] and [N m]. ``not_unique`` (e,) names the columns
    of each element that are not unique, because joints are redundant.
    """

    names: tuple[str, ...]
    force: np.ndarray
    moment: np.ndarray
    load: np.ndarray
    not_unique: tuple[tuple[str, ...], ...]


@record
class Metrics:
    """All metrics of a run. ``work`` is ``None`` if not every step's mean reactions were written.

    ``joints`` counts the joints, which come first among the elements of constraints and reactions.
    """

    energy: Energy
    loads: LoadWork
    constraints: Constraints
    work: JointWork | None
    reactions: Reactions
    joints: int


def compute_metrics(run: Run) -> Metrics:
    """Compute the metrics of ``run`` at every output time, with the element laws that made it."""
    loads, reactions = _loads(run), _reactions(run)
    work = _JointWork(run, reactions) if run.has_means else None
    observed = observe(run, work.visit if work else lambda part, history: None)
    energy = Energy(
        run.time,
        tuple(body.name for body in run.model.shown_bodies),
        _of_shown(run.model, observed.linear),
        _of_shown(run.model, observed.rotational),
        _of_shown(run.model, observed.potential),
        loads.work.sum(axis=1),
        observed.elastic,
    )
    names = element_names(run.model)
    constraints = Constraints(
        run.time,
        names,
        observed.violation,
        observed.rate,
        observed.length,
        _speed(run, observed.linear),
    )
    found = work.found if work else None
    return Metrics(energy, loads, constraints, found, reactions, len(run.model.joints))


def element_names(model: Model) -> tuple[str, ...]:
    """Return the names of joints, couplings and motions: all elements with constraint equations."""
    return tuple(element.name for element in model.constrained)


def _of_shown(model: Model, values: np.ndarray) -> np.ndarray:
    """Return values (m, bodies) of the bodies that are shown: of an elastic body's frame with those
    of the bodies that carry its amplitudes and mass."""
    hidden = model.hidden
    if not hidden:
        return values
    place = {body.name: k for k, body in enumerate(model.shown_bodies)}
    result = np.zeros((len(values), len(place)))
    for b, body in enumerate(model.bodies):
        result[:, place[hidden.get(body.name, body.name)]] += values[:, b]
    return result


def _speed(run: Run, linear: np.ndarray) -> float:
    """Return the largest speed of a mass centre [m/s], by kinetic energies [J] (m, bodies)."""
    mass = np.array([body.mass for body in run.model.bodies])
    return float(np.sqrt(2.0 * linear / mass).max())


def _loads(run: Run) -> LoadWork:
    names = workers(run.model)
    work, elastic = np.full((2, len(run.time), len(names)), np.nan)
    for i, name in enumerate(names):
        assert run.work is not None
        work[:, i] = run.work[f"{name}.work"]
        if f"{name}.energy" in run.work:
            elastic[:, i] = run.work[f"{name}.energy"]
    return LoadWork(names, work, elastic)


def _reactions(run: Run) -> Reactions:
    model, names = run.model, element_names(run.model)
    along_angle = _is_along_angle(model)
    shape = (len(run.time), len(names))
    force = _without_values((*shape, 3), bool(model.joints))
    moment = _without_values((*shape, 3), any(KINDS[j.kind].moment for j in model.joints))
    load = _without_values((*shape, 2), bool(along_angle))
    for e, name in enumerate(names):
        assert run.reactions is not None
        if e >= len(model.joints):
            load[:, e, along_angle[e]] = run.reactions[f"{name}.load"]
            continue
        force[:, e] = run.reactions[[f"{name}.{c}" for c in FORCE_COLUMNS]]
        if KINDS[model.joints[e].kind].moment:
            moment[:, e] = run.reactions[[f"{name}.{c}" for c in MOMENT_COLUMNS]]
    listed = run.info.get("nonUniqueReactions", {})
    return Reactions(names, force, moment, load, tuple(tuple(listed.get(n, ())) for n in names))


def _without_values(shape: tuple[int, ...], written: bool) -> np.ndarray:
    """Return an array of nan; one that is not to be ``written`` takes no memory."""
    return np.full(shape, np.nan) if written else np.broadcast_to(np.nan, shape)


def _is_along_angle(model: Model) -> dict[int, int]:
    """By index of the element: 1 if its load is along an angle [N m], 0 if along a slide [N]."""
    coordinates = [COORDINATES[coupling.kind][1] for coupling in model.couplings]
    coordinates += [m.coordinate if isinstance(m, JointMotion) else "slide" for m in model.motions]
    sides = [getattr(side.contact, "coordinate", "slide") for side in model.contact_sides]
    coordinates += sides
    return {e: int(c == "angle") for e, c in enumerate(coordinates, start=len(model.joints))}


class _JointWork:
    """Sums the virtual work of the joints over each step, part by part of the output times."""

    def __init__(self, run: Run, reactions: Reactions) -> None:
        joints = len(run.model.joints)
        self.run, self.reactions, self.joints = run, reactions, joints_of(run.model)
        hainge, reaction = np.zeros((2, len(run.time) - 1, joints))
        self.found = JointWork(run.time[1:], reactions.names[:joints], hainge, reaction)

    def visit(self, part: slice, history: History) -> None:
        """Add the steps between the output times of a part."""
        joints = len(self.found.joints)
        force = np.ascontiguousarray(self.reactions.force[part, :joints])
        moment = np.nan_to_num(self.reactions.moment[part, :joints])
        steps = slice(part.start, part.stop - 1)
        self.found.hainge[steps] = child_work(self.joints, self.run, part, force)
        self.found.reaction[steps] = reaction_work(self.joints, history, force, moment)
