"""How wrong a run is: energy balance, virtual work of the joints, gaps of the joints.

    E     = sum over bodies of  m v_G.v_G/2 + w.J w/2 - m g.x_G         (3.5)-(3.10)
            + energy of the springs
    error = E(t) - E(0) - work since t = 0 of what is not conservative: loads, dampers, motions
    RMS   = sqrt(mean of squares) over the rows                        (3.12)

The virtual work of the joints is that of ``post.virtual``. All are zero for the exact motion but
for Hainge's measure: the velocity it takes is the child's, not the joint's, so it shows what the
joint moves between translation and rotation. Equation numbers: Hainge 2010.
"""

from dataclasses import dataclass

import numpy as np

from msahl.joints.registry import KINDS
from msahl.model import JointMotion, Model
from msahl.model.couplings import COORDINATES
from msahl.post.replay import Rows, observe
from msahl.post.virtual import child_work, reaction_work
from msahl.results.read import Run
from msahl.system.names import FORCE_COLUMNS, MOMENT_COLUMNS, workers

ROUND_OFF = 1e-12
"""An E(1) below this part of the largest energy in the run is a zero with round-off in it."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Figures of a series: root mean square, mean, and largest absolute value."""

    rms: float
    mean: float
    max: float

    @classmethod
    def of(cls, series: np.ndarray) -> "Spread":
        """Figures of a series (m,) in its unit; zeros if it has no entries."""
        if series.size == 0:
            return cls(0.0, 0.0, 0.0)
        largest = float(np.abs(series).max())
        # Squares of values near 1e-170 and less are zero; of scaled ones they are not.
        scale = largest if 0.0 < largest < np.inf else 1.0
        rms = scale * float(np.sqrt(np.mean((series / scale) ** 2)))
        return cls(rms, float(series.mean()), largest)

    def over(self, size: float | None) -> "Spread | None":
        """The same series in parts of ``size``; ``None`` (undefined) without a size."""
        return None if not size else Spread(self.rms / size, self.mean / size, self.max / size)


@dataclass(frozen=True, slots=True)
class Energy:
    """Energies [J] of m rows and n bodies, arrays (m, n); ``time`` [s], ``work`` of loads and
    motions and ``elastic`` energy of springs [J] (m,)."""

    time: np.ndarray
    bodies: tuple[str, ...]
    linear: np.ndarray
    rotational: np.ndarray
    potential: np.ndarray
    work: np.ndarray
    elastic: np.ndarray

    @property
    def kinetic(self) -> np.ndarray:
        """(m,) kinetic energy of all bodies [J] (3.8)."""
        kinetic: np.ndarray = (self.linear + self.rotational).sum(axis=1)
        return kinetic

    @property
    def total(self) -> np.ndarray:
        """(m,) kinetic and potential energy, that of springs included [J] (3.9), (3.10)."""
        total: np.ndarray = self.kinetic + self.potential.sum(axis=1) + self.elastic
        return total

    @property
    def error(self) -> np.ndarray:
        """(m,) E(t) - E(0) - work of loads and motions since t = 0 [J]."""
        error: np.ndarray = self.balance - self.balance[0]
        return error

    @property
    def balance(self) -> np.ndarray:
        """(m,) total energy less the work of loads and motions [J]: it stays what it was."""
        balance: np.ndarray = self.total - self.work
        return balance

    @property
    def largest_kinetic(self) -> float:
        """Largest kinetic energy reached [J]."""
        return float(self.kinetic.max())

    @property
    def first(self) -> float | None:
        """|E(1)| [J], the divisor of (3.11); ``None`` if it is zero to round-off.

        Hainge divides by E(1) itself, which is negative for a body below the origin.
        """
        first = abs(float(self.total[0]))
        stored = (self.potential, self.elastic)
        largest = max(self.largest_kinetic, *(float(np.abs(part).max()) for part in stored))
        return first if first > ROUND_OFF * largest else None

    @property
    def absolute_error(self) -> Spread:
        """Figures of ``|error|`` [J]."""
        return Spread.of(np.abs(self.error))

    @property
    def error_over_first(self) -> Spread | None:
        """Figures of |error| / |E(1)| (3.11), (3.12); ``None`` if E(1) is zero to round-off."""
        return self.absolute_error.over(self.first)

    @property
    def error_over_kinetic(self) -> Spread | None:
        """Figures of |error| over the largest kinetic energy; ``None`` if nothing ever moves."""
        return self.absolute_error.over(self.largest_kinetic)


@dataclass(frozen=True, slots=True)
class Loads:
    """``work`` since t = 0 and ``elastic`` energy [J] of w loads and motions, arrays (m, w); the
    latter is nan for what stores none."""

    names: tuple[str, ...]
    work: np.ndarray
    elastic: np.ndarray


@dataclass(frozen=True, slots=True)
class JointWork:
    """Virtual work [J] of k joints over each of m - 1 steps; arrays (m - 1, k).

    ``hainge``: F . C (V_{k-1} + V_k)/2 dt, F the mean force on the child over the step, V the
    velocity of the child's B in body axes, C that of the row at the step's end (the source does not
    say which row's). ``sharp``: the work of the joint on both of its bodies (``post.virtual``).
    ``time`` [s] is the end of each step.
    """

    time: np.ndarray
    joints: tuple[str, ...]
    hainge: np.ndarray
    sharp: np.ndarray


@dataclass(frozen=True, slots=True)
class Constraints:
    """Sizes of the gap and of its rate of e joints, couplings and motions, ``time`` [s].

    Arrays (m, e, 2): in m and m/s, and in rad and rad/s; nan where an element has none of that
    unit, or has equations between rates only. To compare them with: ``length`` [m], the longest arm
    or radius of gyration in the scene, and ``speed`` [m/s], the largest of a mass centre.
    """

    time: np.ndarray
    names: tuple[str, ...]
    violation: np.ndarray
    rate: np.ndarray
    length: float
    speed: float


@dataclass(frozen=True, slots=True)
class Reactions:
    """Published reactions of e joints, couplings and motions, means over the step; nan where an
    element has none.

    ``force`` [N] and ``moment`` [N m] (m, e, 3) of the parent on the child, inertial axes, and
    ``load`` (m, e, 2) of couplings and motions [N] and [N m]. ``shared`` (e,) names the columns of
    each that are not unique, as joints are redundant.
    """

    names: tuple[str, ...]
    force: np.ndarray
    moment: np.ndarray
    load: np.ndarray
    shared: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, slots=True)
class Measures:
    """All of a run. ``work`` is ``None`` for a run without every step's mean reactions.

    ``joints`` counts the joints, which come first among the elements of constraints and reactions.
    """

    energy: Energy
    loads: Loads
    constraints: Constraints
    work: JointWork | None
    reactions: Reactions
    joints: int


def measure(run: Run) -> Measures:
    """Measure ``run``, row by row, with the laws that made it."""
    rows = observe(run)
    loads = _loads(run)
    energy = Energy(
        run.time,
        tuple(body.name for body in run.model.bodies),
        rows.linear,
        rows.rotational,
        rows.potential,
        loads.work.sum(axis=1),
        rows.elastic,
    )
    names = element_names(run.model)
    speed = _speed(run, energy)
    constraints = Constraints(run.time, names, rows.violation, rows.rate, rows.length, speed)
    reactions = _reactions(run)
    work = _joint_work(run, rows, reactions) if run.has_means else None
    return Measures(energy, loads, constraints, work, reactions, len(run.model.joints))


def element_names(model: Model) -> tuple[str, ...]:
    """Names of joints, couplings and motions: of all that has equations."""
    return tuple(e.name for e in (*model.joints, *model.couplings, *model.motions))


def _speed(run: Run, energy: Energy) -> float:
    """Largest speed of a mass centre [m/s]."""
    mass = np.array([body.mass for body in run.model.bodies])
    return float(np.sqrt(2.0 * energy.linear / mass).max())


def _loads(run: Run) -> Loads:
    names = workers(run.model)
    work, elastic = np.full((2, len(run.time), len(names)), np.nan)
    for i, name in enumerate(names):
        assert run.work is not None
        work[:, i] = run.work[f"{name}.work"]
        if f"{name}.energy" in run.work:
            elastic[:, i] = run.work[f"{name}.energy"]
    return Loads(names, work, elastic)


def _reactions(run: Run) -> Reactions:
    model, names = run.model, element_names(run.model)
    force, moment = np.full((2, len(run.time), len(names), 3), np.nan)
    load = np.full((len(run.time), len(names), 2), np.nan)
    turning = _turning(model)
    for e, name in enumerate(names):
        assert run.reactions is not None
        if e >= len(model.joints):
            load[:, e, turning[e]] = run.reactions[f"{name}.load"]
            continue
        force[:, e] = run.reactions[[f"{name}.{c}" for c in FORCE_COLUMNS]]
        if KINDS[model.joints[e].kind].moment:
            moment[:, e] = run.reactions[[f"{name}.{c}" for c in MOMENT_COLUMNS]]
    told = run.info.get("nonUniqueReactions", {})
    return Reactions(names, force, moment, load, tuple(tuple(told.get(n, ())) for n in names))


def _turning(model: Model) -> dict[int, int]:
    """By number of the element: 1 if its load is along an angle [N m], 0 if along a way [N]."""
    freedoms = [COORDINATES[coupling.kind][1] for coupling in model.couplings]
    freedoms += [m.coordinate if isinstance(m, JointMotion) else "slide" for m in model.motions]
    return {e: int(f == "angle") for e, f in enumerate(freedoms, start=len(model.joints))}


def _joint_work(run: Run, rows: Rows, reactions: Reactions) -> JointWork:
    joints = len(run.model.joints)
    force = np.ascontiguousarray(reactions.force[:, :joints])
    moment = np.nan_to_num(reactions.moment[:, :joints])
    return JointWork(
        run.time[1:],
        reactions.names[:joints],
        child_work(run, force),
        reaction_work(run.model, rows.history, force, moment),
    )
