"""How wrong a run is: energy balance, virtual work of the joints, gaps of the joints.

    E     = sum over bodies of  m v_G.v_G/2 + w.J w/2 - m g.x_G         (3.5)-(3.10)
    error = E(t) - E(0) - work of the loads since t = 0
    RMS   = sqrt(mean of squares) over the rows                        (3.12)

    virtual work of a joint over step k
    Hainge's measure    lam_k . C_k (V_{k-1} + V_k)/2 dt               (3.16)-(3.18)
    sharp measure       lam_k . (g_k - g_{k-1})

All are zero for the exact motion but for Hainge's measure: the velocity it takes is the
child's, not the joint's, so it shows what the joint moves between translation and rotation.
Equation numbers: Hainge 2010.
"""

from dataclasses import dataclass

import numpy as np

from msahl.post.rows import child_work, joint_forces, observe
from msahl.results.read import Run

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
    """Energies [J] of m rows and n bodies, arrays (m, n); ``time`` [s] and ``work`` [J] (m,)."""

    time: np.ndarray
    bodies: tuple[str, ...]
    linear: np.ndarray
    rotational: np.ndarray
    potential: np.ndarray
    work: np.ndarray

    @property
    def kinetic(self) -> np.ndarray:
        """(m,) kinetic energy of all bodies [J] (3.8)."""
        kinetic: np.ndarray = (self.linear + self.rotational).sum(axis=1)
        return kinetic

    @property
    def total(self) -> np.ndarray:
        """(m,) kinetic and potential energy of all bodies [J] (3.9), (3.10)."""
        total: np.ndarray = self.kinetic + self.potential.sum(axis=1)
        return total

    @property
    def error(self) -> np.ndarray:
        """(m,) E(t) - E(0) - work of the loads since t = 0 [J]."""
        total = self.total
        error: np.ndarray = total - total[0] - (self.work - self.work[0])
        return error

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
        largest = max(self.largest_kinetic, float(np.abs(self.potential).max()))
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
class JointWork:
    """Virtual work [J] of k joints over each of m - 1 steps; arrays (m - 1, k).

    ``hainge``: lam_k . C_k (V_{k-1} + V_k)/2 dt, lam the mean force on the child over the step, V
    the velocity of the child's B in body axes, C that of the row at the step's end (the source does
    not say which row's). ``sharp``: lam_k . (g_k - g_{k-1}), the work of the joint on both of its
    bodies. ``time`` [s] is the end of each step.
    """

    time: np.ndarray
    joints: tuple[str, ...]
    hainge: np.ndarray
    sharp: np.ndarray


@dataclass(frozen=True, slots=True)
class Constraints:
    """Sizes of the gap [m] and of the gap's rate [m/s] of k joints; arrays (m, k), ``time`` [s].

    To compare them with: ``length`` [m], the longest arm or radius of gyration in the scene, and
    ``speed`` [m/s], the largest of a mass centre.
    """

    time: np.ndarray
    joints: tuple[str, ...]
    gap: np.ndarray
    rate: np.ndarray
    length: float
    speed: float


@dataclass(frozen=True, slots=True)
class Measures:
    """All of a run. ``work`` is ``None`` for a thinned run: it takes every step's row.

    ``forces`` (m, k, 3) [N] are the published reactions, inertial axes.
    """

    energy: Energy
    constraints: Constraints
    work: JointWork | None
    forces: np.ndarray


def measure(run: Run) -> Measures:
    """Measure ``run``, row by row, with the laws that made it."""
    rows = observe(run)
    joints = tuple(joint.name for joint in run.model.joints)
    energy = Energy(
        run.time,
        tuple(body.name for body in run.model.bodies),
        rows.linear,
        rows.rotational,
        rows.potential,
        _load_work(run),
    )
    gap, rate = (np.sqrt((a * a).sum(axis=2)) for a in (rows.gap, rows.rate))
    constraints = Constraints(run.time, joints, gap, rate, rows.length, _speed(run, energy))
    forces = joint_forces(run)
    return Measures(energy, constraints, _joint_work(run, forces, rows.gap), forces)


def _speed(run: Run, energy: Energy) -> float:
    """Largest speed of a mass centre [m/s]."""
    mass = np.array([body.mass for body in run.model.bodies])
    return float(np.sqrt(2.0 * energy.linear / mass).max())


def _load_work(run: Run) -> np.ndarray:
    """(m,) work of all loads since t = 0 [J]."""
    if run.work is None:
        return np.zeros(len(run.time))
    work: np.ndarray = run.work.to_numpy()[:, 1:].sum(axis=1)
    return work


def _joint_work(run: Run, forces: np.ndarray, gap: np.ndarray) -> JointWork | None:
    if run.every > 1:
        return None
    joints = tuple(joint.name for joint in run.model.joints)
    sharp = (forces[1:] * np.diff(gap, axis=0)).sum(axis=2)
    return JointWork(run.time[1:], joints, child_work(run), sharp)
