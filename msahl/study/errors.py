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

from msahl.model import Model
from msahl.post.measure import Measures, Spread, measure
from msahl.results.read import Run
from msahl.rotations import angles, rotations
from msahl.run import Grid
from msahl.study.dynamics import Dynamics
from msahl.study.reference import Reference
from msahl.system.names import FORCE_COLUMNS

MOST_ROWS = 2000
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
    Measure("spin", "angular velocity", "rad/s", True),
    Measure("mean_reaction", "reaction, mean at mid-step", "N", True),
    Measure("station_reaction", "reaction, at the row", "N", True),
    Measure("energy_over_kinetic", "energy over max KE", "1", False),
    Measure("energy_over_first", "energy over |E(1)|", "1", False),
    Measure("work_hainge", "virtual work, Hainge's measure", "J", False),
    Measure("work_sharp", "virtual work, force . change of gap", "J", False),
    Measure("gap", "gap of the joints", "m", False),
    Measure("gap_rate", "gap rate of the joints", "m/s", False),
)
BY_KEY = {measure.key: measure for measure in MEASURES}


def sample_rows(model: Model) -> np.ndarray:
    """Rows of a run of ``model``, the first left out, at which errors are taken."""
    n = Grid.of(model.simulation).n
    return np.unique(np.linspace(1, n, min(n, MOST_ROWS)).round().astype(int))


def sample_times(model: Model) -> np.ndarray:
    """All times at which errors of a run of ``model`` ask for the reference."""
    grid = Grid.of(model.simulation)
    ends = np.array([[grid.time(int(k) - 1), grid.time(int(k))] for k in sample_rows(model)])
    return np.union1d(ends[:, 1], ends.mean(axis=1))


class Errors(NamedTuple):
    """Figures of every measure by key (None where there are none), and the errors against the
    reference in time: ``time`` [s] and ``series`` (m,) by key."""

    figures: dict[str, Spread | None]
    time: np.ndarray
    series: dict[str, np.ndarray]

    def kept_to(self, key: str, target: float) -> float | None:
        """Time [s] up to which an error against the reference stays within ``target``."""
        if key not in self.series or not self.time.size:
            return None
        above = np.flatnonzero(self.series[key] > target)
        return float(self.time[max(above[0] - 1, 0)] if above.size else self.time[-1])


def measure_errors(run: Run, reference: Reference) -> Errors:
    """The errors of a run."""
    measures = measure(run)
    energy, joints, work = measures.energy, measures.constraints, measures.work
    time, series = _true_errors(run, measures, reference)
    figures: dict[str, Spread | None] = {
        **{key: _figures(errors) for key, errors in series.items()},
        "energy_over_kinetic": energy.error_over_kinetic,
        "energy_over_first": energy.error_over_first,
        "work_hainge": _widest(work.hainge) if work else None,
        "work_sharp": _widest(work.sharp) if work else None,
        "gap": _widest(joints.gap[:, :, METRES]),
        "gap_rate": _widest(joints.rate[:, :, METRES]),
    }
    return Errors({m.key: figures.get(m.key) for m in MEASURES}, time, series)


def _widest(series: np.ndarray) -> Spread | None:
    """Figures of the largest absolute value of each row of ``series`` (m, k), of those known."""
    known = np.abs(series[:, ~np.isnan(series).all(axis=0)])
    return Spread.of(np.nanmax(known, axis=1)) if known.size else None


def _true_errors(
    run: Run, measures: Measures, reference: Reference
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times of the sampled rows up to the horizon, and errors there (m,) by key."""
    rows = sample_rows(run.model)
    rows = rows[rows < len(run.time)]
    rows = rows[run.time[rows] <= reference.horizon]
    times, mids = run.time[rows], 0.5 * (run.time[rows - 1] + run.time[rows])
    table = run.states.to_numpy()[rows, 1:]
    errors = state_errors(table, reference.states(times))
    # Components that redundant joints share are not unique: no reference has the same.
    shared = measures.reactions.shared[: measures.joints]
    own = np.array([[column not in columns for column in FORCE_COLUMNS] for columns in shared])
    if own.any():
        shape = (len(rows), -1, 3)
        published = measures.reactions.force[rows, : len(own)]
        forces = Dynamics(run.model).forces(times, table) - reference.forces(times)
        if not run.at_rows:
            mean = published - reference.forces(mids).reshape(shape)
            errors["mean_reaction"] = _length(mean * own)
        errors["station_reaction"] = _length(forces.reshape(shape) * own)
    return times, errors


def _figures(series: np.ndarray) -> Spread | None:
    """Figures of the rows that the reference knows (the others are NaN)."""
    known = series[np.isfinite(series)]
    return Spread.of(known) if known.size else None


def state_errors(table: np.ndarray, true: np.ndarray) -> dict[str, np.ndarray]:
    """Errors (m,) of published states (m, 12 n), the largest of all bodies."""
    a, b = (t.reshape(len(t), -1, 4, 3) for t in (table, true))
    (x, p, v, w), (x0, p0, v0, w0) = (np.moveaxis(t, 2, 0) for t in (a, b))
    R, R0 = rotations(p), rotations(p0)
    return {
        "position": _length(x - x0),
        "orientation": angles(p, p0).max(axis=1),
        "velocity": _length(np.einsum("mnij,mnj->mni", R, v) - np.einsum("mnij,mnj->mni", R0, v0)),
        "spin": _length(np.einsum("mnij,mnj->mni", R, w) - np.einsum("mnij,mnj->mni", R0, w0)),
    }


def _length(vectors: np.ndarray) -> np.ndarray:
    """(m,) length of the longest of each row's vectors (m, n, 3)."""
    return np.asarray(np.sqrt((vectors**2).sum(axis=2)).max(axis=1))
