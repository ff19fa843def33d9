"""Inverse dynamics as the tables of a run with ``drives.csv``, and what ``run.json`` says of it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from msahl.analysis.inverse.solution import Solution
from msahl.model import Model
from msahl.run.observed import ObservedTables
from msahl.run.report import COMPLETED, Report
from msahl.run.tables import ACCELERATIONS, REACTIONS, SIGNALS, STATES, WORK, tables_of_model
from msahl.run.verdict import Verdict
from msahl.system.names import (
    ENERGY,
    POWER_COLUMN,
    reaction_columns,
    signal_columns,
    work_columns,
)


def powers(solution: Solution) -> np.ndarray:
    """(m, w) powers of loads and prescribed motions of the model that have a law."""
    driven, tables = solution.driven, solution.tables
    columns = reaction_columns(driven)[1:]
    motions = [columns.index(f"{motion.name}.{POWER_COLUMN}") for motion in driven.motions]
    loads = tables.work[:, : len(driven.loads)]
    return np.concatenate([loads, tables.reactions[:, motions]], axis=1)


def integrated(time: np.ndarray, power: np.ndarray) -> np.ndarray:
    """(m, k) work since the first time [J]: the integral of the spline of degree 5."""
    from scipy.interpolate import make_interp_spline

    integral = make_interp_spline(time, power, k=5).antiderivative()
    return np.asarray(integral(time) - integral(time[0]))


def drive_columns(solution: Solution) -> list[str]:
    """Header of ``drives.csv``: of each drive its load, error bar, power and work; at last the
    largest force that no drive produces [N].
    """
    ends = ("load", "error", "power", "work")
    return ["time", *(f"{d.name}.{end}" for d in solution.drives for end in ends), "missingForce"]


def drive_rows(solution: Solution) -> np.ndarray:
    """(m, columns) of ``drives.csv``."""
    rows, time = solution.rows, solution.motion.time
    parts = (rows.loads, rows.error, rows.power, integrated(time, rows.power))
    of_drives = np.stack(parts, axis=2).reshape(time.size, -1)
    return np.column_stack([time, of_drives, rows.missing])


def tables(solution: Solution, model: Model) -> dict[str, np.ndarray]:
    """Return the tables of a run of the ``model``, the deck's with settings of its own."""
    time, found = solution.motion.time, solution.tables
    columns = tables_of_model(model)
    values = _values(solution)
    result = {
        STATES: np.column_stack([time, found.states]),
        ACCELERATIONS: np.column_stack([time, found.accelerations]),
        WORK: _chosen(time, values, work_columns(model)),
    }
    observed = ObservedTables(model).rows(result)
    result |= observed
    for name in (REACTIONS, SIGNALS):
        if name in columns:
            result[name] = _chosen(time, values, columns[name])
    return {name: result[name] for name in columns}


def _chosen(time: np.ndarray, values: dict[str, np.ndarray], columns: Sequence[str]) -> np.ndarray:
    """(m, columns) with the time first; what is not known is zero (the work of a scheme)."""
    return np.column_stack([time, *(values.get(name, np.zeros(time.size)) for name in columns[1:])])


def _values(solution: Solution) -> dict[str, np.ndarray]:
    """Return the columns of reactions, work and signals by name."""
    driven, found, time = solution.driven, solution.tables, solution.motion.time
    values = dict(zip(reaction_columns(driven)[1:], found.reactions.T, strict=True))
    values |= dict(zip(signal_columns(driven)[1:], found.signals.T, strict=True))
    names = [*(load.name for load in driven.loads), *(motion.name for motion in driven.motions)]
    work = integrated(time, powers(solution))
    values |= {f"{name}.work": column for name, column in zip(names, work.T, strict=True)}
    springs = [name for name in work_columns(driven) if name.endswith(f".{ENERGY}")]
    first = found.work.shape[1] - len(springs)
    values |= dict(zip(springs, found.work[:, first:].T, strict=True))
    done = integrated(time, solution.rows.power)
    for k, drive in enumerate(solution.drives):
        values[f"{drive.name}.load"] = solution.rows.loads[:, k]
        values[f"{drive.name}.power"] = solution.rows.power[:, k]
        values[f"{drive.name}.work"] = done[:, k]
    return values


def report(solution: Solution, shown: Verdict, seconds: float) -> Report:
    """Return the report that ``run.json`` contains."""
    model, time = solution.model, solution.motion.time
    names = {element.name for element in (*model.joints, *model.couplings, *model.motions)}
    return Report(
        status=COMPLETED,
        output_times=time.size,
        steps=0,
        time=float(time[-1]),
        joints=len(model.joints) + len(model.couplings),
        subsystems=1,
        degrees_of_freedom={"byRank": solution.degrees_of_freedom},
        non_unique_reactions={
            name: columns
            for name, columns in solution.non_unique_reactions.items()
            if name in names
        },
        warnings=["inverse dynamics: the motion was given, and no step was taken"],
        seconds={"total": seconds},
        verdict=shown.as_json(),
    )


def about(solution: Solution) -> dict[str, Any]:
    """Return what ``run.json`` says of the drives."""
    return {
        "motion": solution.motion.source,
        "companion": solution.companion or None,
        "smooth": solution.noise or None,
        "drives": {
            drive.name: {
                "unit": drive.unit,
                "unique": bool(own),
                "weight": float(weight),
                "errorMax": float(error),
            }
            for drive, own, weight, error in zip(
                solution.drives,
                solution.unique,
                solution.weights,
                solution.rows.error.max(axis=0),
                strict=True,
            )
        },
        "missingForceMax": float(solution.rows.missing.max()),
        "misfitMax": float(np.abs(solution.rows.misfit).max()),
    }
