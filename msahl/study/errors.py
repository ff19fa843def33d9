"""Compute the errors of a run: against a reference, and from its own invariants.

    position                |r_B - r_ref|                               [m]      largest of all
    bodies orientation             angle of R_ref^T R                          [rad] velocity
    |R v - R_ref v_ref| of point B              [m/s] angular velocity        |R w - R_ref w_ref|
    [rad/s] mean reaction           |mean force over a step - force_ref(mid-step)|   [N]  largest of
    all joints instantaneous reaction  |force(state of the run) - force_ref|            [N]  at the
    output time

Energy, virtual work and constraint violation are those of ``post.metrics``. The root mean square
and the largest value of each are taken over the output times (in long runs over ``MOST_TIMES`` of
them, evenly spread) up to the horizon of the reference; those of the invariants over all output
times.
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import angles, rotations
from msahl.analysis.no_contacts import without_contacts
from msahl.post.metrics import Metrics, Statistics, compute_metrics
from msahl.records import record
from msahl.results.read import Run
from msahl.study.dynamics import Dynamics
from msahl.study.reference import Reference
from msahl.system.names import FORCE_COLUMNS

MOST_TIMES = 2000
GUIDES = 4000
"""Number of states of the reference that lead from one counted angle of a run to the next."""
METRES = 0
"""Index of the constraint violations in metres; index 1 has those in radians."""


@record
class ErrorMetric:
    """A kind of error: its ``key`` in CSV, its name and unit, and whether it needs a reference."""

    key: str
    name: str
    unit: str
    needs_reference: bool


METRICS = (
    ErrorMetric("position", "position", "m", True),
    ErrorMetric("orientation", "orientation", "rad", True),
    ErrorMetric("velocity", "velocity", "m/s", True),
    ErrorMetric("angular_velocity", "angular velocity", "rad/s", True),
    ErrorMetric("mean_reaction", "reaction, mean over the step", "N", True),
    ErrorMetric("instantaneous_reaction", "reaction, instantaneous", "N", True),
    ErrorMetric("energy_over_kinetic", "energy balance over max KE", "1", False),
    ErrorMetric("energy_over_first", "energy balance over |E(1)|", "1", False),
    ErrorMetric("work_hainge", "virtual work, Hainge", "J", False),
    ErrorMetric("work_reaction", "virtual work of reactions", "J", False),
    ErrorMetric("violation", "constraint violation", "m", False),
    ErrorMetric("violation_rate", "constraint violation rate", "m/s", False),
)
STATE_KEYS = ("position", "orientation", "velocity", "angular_velocity")
"""Keys of the metrics that need only the states."""
METRIC_OF = {metric.key: metric for metric in METRICS}


def sample_rows(run: Run) -> np.ndarray:
    """Return the indices of the output times, except t = 0, at which errors are taken."""
    n = len(run.time) - 1
    return np.unique(np.linspace(min(1, n), n, min(n, MOST_TIMES)).round().astype(int))


class Errors(NamedTuple):
    """``statistics`` of every metric by key (None if it is not known), and the errors against the
    reference over ``time`` [s]: ``series`` (m,) by key."""

    statistics: dict[str, Statistics | None]
    time: np.ndarray
    series: dict[str, np.ndarray]

    def within_until(self, key: str, target: float) -> float | None:
        """Return the time [s] up to which an error against the reference stays below ``target``."""
        if key not in self.series or not self.time.size:
            return None
        above = np.flatnonzero(self.series[key] > target)
        return float(self.time[max(above[0] - 1, 0)] if above.size else self.time[-1])


def compute_errors(run: Run, reference: Reference, dynamics: Dynamics | None = None) -> Errors:
    """Compute all errors of a run; ``dynamics`` of its model are built if they are not given."""
    states = compute_state_errors(run, reference)
    metrics = compute_metrics(run)
    energy, joints, work = metrics.energy, metrics.constraints, metrics.work
    time, known = _sampled(run, reference)
    series = states.series | _force_errors(
        run, metrics, reference, dynamics or Dynamics(run.model), known
    )
    statistics: dict[str, Statistics | None] = {
        **{key: _statistics(errors) for key, errors in series.items()},
        "energy_over_kinetic": energy.error_over_kinetic,
        "energy_over_first": energy.error_over_first,
        "work_hainge": _of_largest(work.hainge) if work else None,
        "work_reaction": _of_largest(work.reaction) if work else None,
        "violation": _of_largest(joints.violation[:, :, METRES]),
        "violation_rate": _of_largest(joints.rate[:, :, METRES]),
    }
    return Errors({m.key: statistics.get(m.key) for m in METRICS}, time, series)


def compute_state_errors(run: Run, reference: Reference) -> Errors:
    """Compute the errors of the states only, in a tenth of the time that all errors take."""
    times, rows = _sampled(run, reference)
    series = state_errors(run.states.to_numpy()[rows, 1:], reference.states(times))
    statistics = {key: _statistics(errors) for key, errors in series.items()}
    return Errors({m.key: statistics.get(m.key) for m in METRICS}, times, series)


def _of_largest(series: np.ndarray) -> Statistics | None:
    """Return the statistics of the largest absolute value of each row of ``series`` (m, k)."""
    known = np.abs(series[:, ~np.isnan(series).all(axis=0)])
    return Statistics.of(np.nanmax(known, axis=1)) if known.size else None


def _sampled(run: Run, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """Return times and indices of the sampled output times up to the horizon."""
    rows = sample_rows(run)
    rows = rows[run.time[rows] <= reference.horizon]
    return run.time[rows], rows


def _force_errors(
    run: Run, metrics: Metrics, reference: Reference, dynamics: Dynamics, rows: np.ndarray
) -> dict[str, np.ndarray]:
    """Return the errors (m,) of the reactions at the output times of these indices, by key; none
    with auxiliary states, and with contacts and events, which the table of states does not have.
    """
    if dynamics.state.auxiliary.size or without_contacts(dynamics.model):
        return {}
    # Components that redundant joints share are not unique: the reference has other ones.
    not_unique = metrics.reactions.not_unique[: metrics.joints]
    unique = np.array([[name not in names for name in FORCE_COLUMNS] for names in not_unique])
    if not unique.any():
        return {}
    times, shape = run.time[rows], (len(rows), -1, 3)
    errors = {}
    if not run.instantaneous:
        mids = 0.5 * (run.time[rows - 1] + times)
        published = metrics.reactions.force[rows, : len(unique)]
        mean = published - reference.forces(mids).reshape(shape)
        errors["mean_reaction"] = _largest_norm(mean * unique)
    forces = _forces_of_states(run.states.to_numpy()[rows, 1:], times, reference, dynamics)
    forces -= reference.forces(times)
    errors["instantaneous_reaction"] = _largest_norm(forces.reshape(shape) * unique)
    return errors


def _forces_of_states(
    table: np.ndarray, times: np.ndarray, reference: Reference, dynamics: Dynamics
) -> np.ndarray:
    """Return the joint forces that follow from a run's states ``table`` (m, 12 n) at ``times``."""
    if not dynamics.state.angle.size or not len(times):
        return dynamics.forces(times, table)
    # Angles are counted from state to state. Between distant output times a joint may rotate by
    # more than 180 degrees; the reference's states lead from one output time to the next.
    between = np.setdiff1d(np.linspace(0.0, times[-1], GUIDES), times)
    guides = reference.states(between)
    known = np.isfinite(guides).all(axis=1)
    order = np.argsort(np.concatenate([times, between[known]]), kind="stable")
    tables = np.concatenate([table, guides[known]])[order]
    forces = dynamics.forces(np.sort(np.concatenate([times, between[known]])), tables)
    return np.asarray(forces[np.argsort(order)[: len(times)]])


def _statistics(series: np.ndarray) -> Statistics | None:
    """Return the statistics of the values at which the reference is known (others are NaN)."""
    known = series[np.isfinite(series)]
    return Statistics.of(known) if known.size else None


def state_errors(table: np.ndarray, true: np.ndarray) -> dict[str, np.ndarray]:
    """Return the errors (m,) of published states (m, 12 n) by key, the largest of all bodies."""
    a, b = (t.reshape(len(t), -1, 4, 3) for t in (table, true))
    (x, p, v, w), (x0, p0, v0, w0) = (np.moveaxis(t, 2, 0) for t in (a, b))
    R, R0 = rotations(p), rotations(p0)
    velocity = np.einsum("mnij,mnj->mni", R, v) - np.einsum("mnij,mnj->mni", R0, v0)
    angular_velocity = np.einsum("mnij,mnj->mni", R, w) - np.einsum("mnij,mnj->mni", R0, w0)
    return {
        "position": _largest_norm(x - x0),
        "orientation": angles(p, p0).max(axis=1),
        "velocity": _largest_norm(velocity),
        "angular_velocity": _largest_norm(angular_velocity),
    }


def _largest_norm(vectors: np.ndarray) -> np.ndarray:
    """Return the largest norm (m,) of the n vectors (m, n, 3) at each time."""
    return np.asarray(np.sqrt((vectors**2).sum(axis=2)).max(axis=1))
