"""Errors of a run: against a reference, and by its own invariants.

    position       |r_B - r_ref|                            [m]     largest of all bodies
    orientation    angle of R_ref^T R                       [rad]
    velocity       |R v - R_ref v_ref| of point B           [m/s]
    spin           |R w - R_ref w_ref|                      [rad/s]
    mean reaction  |mean force over a step - force_ref(mid-step)|   [N]   largest of all joints
    station reaction   |force(run's own state) - force_ref|         [N]   at the row's time

Energy, virtual work and gaps are those of ``post.measure``. Each is a root mean square and a
largest value over the rows (of long runs over ``MOST_ROWS`` of them, evenly spread) up to the
reference's horizon; invariants are over all rows.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import angles, rotations
from msahl.post.metrics import Metrics, Statistics, compute_metrics
from msahl.results.read import Run
from msahl.study.dynamics import Dynamics
from msahl.study.reference import Reference
from msahl.system.names import FORCE_COLUMNS

MOST_ROWS = 2000
GUIDES = 4000
"""States of the reference by which the angles of a run are counted."""
METRES = 0
"""Of the two units that gaps come in."""


@dataclass(frozen=True, slots=True)
class Measure:
    """A kind of error: its ``key`` in CSV, its name and unit; ``true`` if it needs a reference."""

    key: str
    name: str
    unit: str
    true: bool


MEASURES = (
    Measure("position", "position", "m", True),
    Measure("orientation", "orientation", "rad", True),
    Measure("velocity", "velocity", "m/s", True),
    Measure("angular_velocity", "angular velocity", "rad/s", True),
    Measure("mean_reaction", "reaction, mean at mid-step", "N", True),
    Measure("instantaneous_reaction", "reaction, at the row", "N", True),
    Measure("energy_over_kinetic", "energy over max KE", "1", False),
    Measure("energy_over_first", "energy over |E(1)|", "1", False),
    Measure("work_hainge", "virtual work, Hainge's measure", "J", False),
    Measure("work_sharp", "virtual work, force . change of gap", "J", False),
    Measure("gap", "gap of the joints", "m", False),
    Measure("gap_rate", "gap rate of the joints", "m/s", False),
)
STATE_KEYS = ("position", "orientation", "velocity", "angular_velocity")
"""Those of the states alone."""
BY_KEY = {measure.key: measure for measure in MEASURES}


def sample_rows(run: Run) -> np.ndarray:
    """Rows of a ``run``, without the first, at which errors are taken."""
    n = len(run.time) - 1
    return np.unique(np.linspace(min(1, n), n, min(n, MOST_ROWS)).round().astype(int))


class Errors(NamedTuple):
    """Figures of every measure by key (None where there are none), and the errors against the
    reference in time: ``time`` [s] and ``series`` (m,) by key."""

    figures: dict[str, Statistics | None]
    time: np.ndarray
    series: dict[str, np.ndarray]

    def kept_to(self, key: str, target: float) -> float | None:
        """Time [s] up to which an error against the reference stays within ``target``."""
        if key not in self.series or not self.time.size:
            return None
        above = np.flatnonzero(self.series[key] > target)
        return float(self.time[max(above[0] - 1, 0)] if above.size else self.time[-1])


def measure_errors(run: Run, reference: Reference, dynamics: Dynamics | None = None) -> Errors:
    """All errors of a run; ``dynamics`` are those of its model, built if they are not given."""
    states = state_figures(run, reference)
    metrics = compute_metrics(run)
    energy, joints, work = metrics.energy, metrics.constraints, metrics.work
    time, known = _rows_known(run, reference)
    series = states.series | _force_errors(
        run, metrics, reference, dynamics or Dynamics(run.model), known
    )
    figures: dict[str, Statistics | None] = {
        **{key: _figures(errors) for key, errors in series.items()},
        "energy_over_kinetic": energy.error_over_kinetic,
        "energy_over_first": energy.error_over_first,
        "work_hainge": _widest(work.hainge) if work else None,
        "work_sharp": _widest(work.reaction) if work else None,
        "gap": _widest(joints.violation[:, :, METRES]),
        "gap_rate": _widest(joints.rate[:, :, METRES]),
    }
    return Errors({m.key: figures.get(m.key) for m in MEASURES}, time, series)


def state_figures(run: Run, reference: Reference) -> Errors:
    """The errors of a run's states alone: they take a tenth of the time of all."""
    times, rows = _rows_known(run, reference)
    series = state_errors(run.states.to_numpy()[rows, 1:], reference.states(times))
    figures = {key: _figures(errors) for key, errors in series.items()}
    return Errors({m.key: figures.get(m.key) for m in MEASURES}, times, series)


def _widest(series: np.ndarray) -> Statistics | None:
    """Figures of the largest absolute value of each row of ``series`` (m, k), of those known."""
    known = np.abs(series[:, ~np.isnan(series).all(axis=0)])
    return Statistics.of(np.nanmax(known, axis=1)) if known.size else None


def _rows_known(run: Run, reference: Reference) -> tuple[np.ndarray, np.ndarray]:
    """Times and numbers of the sampled rows up to the horizon."""
    rows = sample_rows(run)
    rows = rows[run.time[rows] <= reference.horizon]
    return run.time[rows], rows


def _force_errors(
    run: Run, metrics: Metrics, reference: Reference, dynamics: Dynamics, rows: np.ndarray
) -> dict[str, np.ndarray]:
    """Errors (m,) of the reactions in these ``rows``, by key."""
    # Components that redundant joints share are not unique: no reference has the same.
    shared = metrics.reactions.not_unique[: metrics.joints]
    own = np.array([[column not in columns for column in FORCE_COLUMNS] for columns in shared])
    if not own.any():
        return {}
    times, shape = run.time[rows], (len(rows), -1, 3)
    errors = {}
    if not run.instantaneous:
        mids = 0.5 * (run.time[rows - 1] + times)
        published = metrics.reactions.force[rows, : len(own)]
        mean = published - reference.forces(mids).reshape(shape)
        errors["mean_reaction"] = _length(mean * own)
    forces = _own_forces(run.states.to_numpy()[rows, 1:], times, reference, dynamics)
    forces -= reference.forces(times)
    errors["instantaneous_reaction"] = _length(forces.reshape(shape) * own)
    return errors


def _own_forces(
    table: np.ndarray, times: np.ndarray, reference: Reference, dynamics: Dynamics
) -> np.ndarray:
    """Joint forces of a run's states ``table`` (m, 12 n) at their ``times``."""
    if not dynamics.state.angle.size or not len(times):
        return dynamics.forces(times, table)
    # Angles are counted from state to state. Between rows of long steps a joint may turn by more
    # than half a turn; the reference's states lead from one row to the next.
    between = np.setdiff1d(np.linspace(0.0, times[-1], GUIDES), times)
    guides = reference.states(between)
    known = np.isfinite(guides).all(axis=1)
    order = np.argsort(np.concatenate([times, between[known]]), kind="stable")
    tables = np.concatenate([table, guides[known]])[order]
    forces = dynamics.forces(np.sort(np.concatenate([times, between[known]])), tables)
    return np.asarray(forces[np.argsort(order)[: len(times)]])


def _figures(series: np.ndarray) -> Statistics | None:
    """Figures of the rows that the reference knows (the others are NaN)."""
    known = series[np.isfinite(series)]
    return Statistics.of(known) if known.size else None


def state_errors(table: np.ndarray, true: np.ndarray) -> dict[str, np.ndarray]:
    """Errors (m,) of published states (m, 12 n), the largest of all bodies."""
    a, b = (t.reshape(len(t), -1, 4, 3) for t in (table, true))
    (x, p, v, w), (x0, p0, v0, w0) = (np.moveaxis(t, 2, 0) for t in (a, b))
    R, R0 = rotations(p), rotations(p0)
    return {
        "position": _length(x - x0),
        "orientation": angles(p, p0).max(axis=1),
        "velocity": _length(np.einsum("mnij,mnj->mni", R, v) - np.einsum("mnij,mnj->mni", R0, v0)),
        "angular_velocity": _length(
            np.einsum("mnij,mnj->mni", R, w) - np.einsum("mnij,mnj->mni", R0, w0)
        ),
    }


def _length(vectors: np.ndarray) -> np.ndarray:
    """(m,) length of the longest of each row's vectors (m, n, 3)."""
    return np.asarray(np.sqrt((vectors**2).sum(axis=2)).max(axis=1))
