"""Inverse dynamics in words, with a verdict, and as the tables of a run."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from msahl.analysis.inverse.solution import Solution
from msahl.joints.coordinates import ORIENTATION
from msahl.model import Model
from msahl.run.observed import ObservedTables
from msahl.run.report import COMPLETED, Report
from msahl.run.tables import ACCELERATIONS, REACTIONS, SIGNALS, STATES, WORK, tables_of_model
from msahl.run.verdict import FAIL, PASS, WARN, Finding, Verdict, describe_reactions
from msahl.system.names import (
    ENERGY,
    POWER_COLUMN,
    reaction_columns,
    signal_columns,
    work_columns,
)

ROUND_OFF = 1e-9
"""Missing force, over the largest of the balance, that is round-off."""
MISSING_FAIL = 0.01
"""Likewise, beyond its error bar, that fails."""
MISFIT, MISFIT_FAIL = 1e-6, 0.01
"""Misfit of given values, over the size of the model, that warns, and fails."""
ERROR, ERROR_FAIL = 0.01, 0.3
"""Error bar that warns, and fails, over the largest load of the same unit or, if that is larger,
the largest force of the balance, for torques times the size of the model."""
MOST_NAMED = 8


def lines(solution: Solution, shown_verdict: Verdict) -> list[str]:
    """Return the report on the loads."""
    motion, model = solution.motion, solution.model
    d, k = solution.degrees_of_freedom, len(solution.drives)
    redundant = f", {solution.redundant} redundant constraint equations"
    return [
        f"{model.simulation.title or 'model'}: loads of the motion in {motion.source}, "
        f"{motion.time.size} times to {motion.time[-1]:.6g} s",
        f"{d} {'degree' if d == 1 else 'degrees'} of freedom, {k} drive{'' if k == 1 else 's'}"
        f"{redundant if solution.redundant else ''}",
        f"given: {_given(solution)}",
        "",
        *_table(solution),
        "",
        *(f"{finding.word}: {finding.text}" for finding in shown_verdict.findings),
    ]


def _given(solution: Solution) -> str:
    """Return what the table gives, and how its derivatives are obtained."""
    tracks = solution.motion.tracks
    names = [track.name for track in tracks]
    bodies = len(solution.model.bodies)
    if len(names) == 4 * bodies and all(track.kind == "body" for track in tracks):
        names = [f"positions and orientations of all bodies ({bodies})"]
    shown = ", ".join(names[:MOST_NAMED])
    more = len(names) - MOST_NAMED
    shown += f" and {more} more" if more > 0 else ""
    if solution.noise > 0.0:
        return f"{shown}; smoothed by splines of degree 5, noise {solution.noise:g} m or rad"
    second = solution.motion.has_accelerations
    first = all(track.rates is not None for track in tracks)
    with_them = "rates and accelerations" if second else "rates" if first else ""
    text = f"{shown}, with {with_them}" if with_them else shown
    return text if second else f"{text}; splines of degree 5"


def _table(solution: Solution) -> list[str]:
    """Return the lines of the table of drives."""
    rows, time = solution.rows, solution.motion.time
    cells = [
        ["drive", "unit", "largest load", "at [s]", "error bar", "power [W]", "work [J]", "unique"]
    ]
    work = integrated(time, rows.power)
    for k, drive in enumerate(solution.drives):
        at = int(np.argmax(np.abs(rows.loads[:, k])))
        power = rows.power[int(np.argmax(np.abs(rows.power[:, k]))), k]
        cells.append([
            *(drive.name, drive.unit, f"{rows.loads[at, k]:.7g}", f"{time[at]:.4g}"),
            *(f"{rows.error[:, k].max():.1e}", f"{power:.5g}", f"{work[-1, k]:.6g}"),
            "yes" if solution.unique[k] else "no",
        ])  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if i < 2 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]


def verdict(solution: Solution) -> Verdict:
    """Return how good the loads are, and whether they produce the motion."""
    return Verdict((
        _produced(solution),
        *_unique(solution),
        _misfit(solution),
        *_errors(solution),
        *_energy(solution),
        *_reactions(solution),
    ))  # fmt: skip


def _produced(solution: Solution) -> Finding:
    """Whether the drives produce the motion."""
    rows, lacking = solution.rows, solution.degrees_of_freedom - solution.rank
    if lacking <= 0:
        text = f"the drives produce the motion: they act on all {solution.rank} degrees of freedom"
        if not solution.degrees_of_freedom:
            text = "there is no degree of freedom: the motion is that of prescribed motions"
        elif solution.rank == 1:
            text = "the drives produce the motion: they act on the only degree of freedom"
        return Finding("produced", PASS, text)
    at = int(np.argmax(rows.missing))
    missing, largest = float(rows.missing[at]), float(rows.largest.max())
    beyond = missing - float(rows.missing_error[at])
    share = missing / largest if largest else 0.0
    named = ", ".join(solution.undriven[:MOST_NAMED])
    text = (
        f"the drives act on {solution.rank} of {solution.degrees_of_freedom} degrees of freedom, "
        f"and not on some motions of {named}; the largest force that no drive produces is "
        f"{missing:.3g} N ({share:.1e} of the largest) at {solution.motion.time[at]:.4g} s, error "
        f"bar {rows.missing_error[at]:.1e} N"
    )
    if beyond <= ROUND_OFF * largest:
        return Finding("produced", PASS, f"{text}: the motion follows from the loads")
    word = FAIL if beyond > MISSING_FAIL * largest else WARN
    advice = ": this part of the motion cannot be produced; name more drives with --loads"
    return Finding("produced", word, text + advice)


def _unique(solution: Solution) -> Iterator[Finding]:
    """Which loads are unique."""
    if solution.unique.all():
        return
    shared = [
        d.name
        for d, is_unique in zip(solution.drives, solution.unique, strict=True)
        if not is_unique
    ]
    more = len(solution.drives) - solution.rank
    weighted = " times their weights" if np.any(solution.weights != 1.0) else ""
    text = (
        f"the loads of {', '.join(shared[:MOST_NAMED])} are not unique: {more} more "
        f"drive{'s' if more > 1 else ''} than needed; of all loads that produce the motion these "
        f"have the least sum of squares{weighted} [N, N m]"
    )
    yield Finding("uniqueLoads", PASS, text)


def _misfit(solution: Solution) -> Finding:
    """How far given values contradict the joints or each other."""
    misfit = np.abs(solution.rows.misfit)
    row, column = np.unravel_index(int(np.argmax(misfit)), misfit.shape)
    largest, size = float(misfit[row, column]), solution.size
    share = largest / size
    names = [t.name for t in solution.motion.tracks for _ in range(_width(t.coordinate))]
    redundant = misfit.shape[1] - solution.degrees_of_freedom
    text = f"the given values are met to {largest:.1e} m"
    if redundant > 0:
        text += f" ({redundant} more than needed, by least squares)"
    if share > MISFIT:
        text += (
            f", worst {names[column]} at {solution.motion.time[row]:.4g} s: they contradict the "
            "joints or each other"
        )
        kept = ", ".join(motion.name for motion in solution.driven.motions[:MOST_NAMED])
        text += f", or the prescribed motions that --loads does not name: {kept}" if kept else ""
    word = PASS if share <= MISFIT else WARN if share <= MISFIT_FAIL else FAIL
    return Finding("misfit", word, text)


def _width(coordinate: str) -> int:
    return 3 if coordinate == ORIENTATION else 1


def _errors(solution: Solution) -> Iterator[Finding]:
    """How large the error bars are, by the unit of the load."""
    for rotates in (False, True):
        chosen = [k for k, drive in enumerate(solution.drives) if drive.rotates == rotates]
        if not chosen:
            continue
        unit = solution.drives[chosen[0]].unit
        error = solution.rows.error[:, chosen].max(axis=1)
        load = float(np.abs(solution.rows.loads[:, chosen]).max())
        # Loads that are differences of larger forces are as accurate as these.
        force = float(solution.rows.largest.max()) * (solution.size if rotates else 1.0)
        at, scale = int(np.argmax(error)), max(load, force)
        share = float(error[at]) / scale if scale else 0.0
        by = "the largest load" if load >= force else "the largest force of the balance"
        text = (
            f"error bars at most {error[at]:.1e} {unit} ({share:.1e} of {by}), at "
            f"{solution.motion.time[at]:.4g} s; by other splines{_other_errors(solution)}"
        )
        word = PASS if share <= ERROR else WARN if share <= ERROR_FAIL else FAIL
        if word != PASS:
            text += "; give rates, more rows, or --smooth if the table is noisy"
            if solution.motion.error is not None:
                text += ", or run the deck with smaller steps"
        elif _lacks_run_error(solution):
            word = WARN
        yield Finding("errorMoments" if rotates else "errorForces", word, text)


def _lacks_run_error(solution: Solution) -> bool:
    """Return whether the motion is that of a run, whose error is unknown, by splines."""
    motion = solution.motion
    unknown = motion.error is not None and not motion.error.is_known
    return unknown and not solution.companion and not motion.has_accelerations


def _other_errors(solution: Solution) -> str:
    """Return which errors the error bars contain besides those of splines, and which not."""
    error = solution.motion.error
    if solution.companion:
        return f" and the table {solution.companion}"
    if error is None:
        return "; smooth errors of the table itself are not in them (--companion)"
    if error.is_known:
        return " and the estimated error of the run"
    remedy = "run it with --error, or with --accelerations yes, or give a --companion"
    return f"; the error of the run was not estimated and is not in them: {remedy}"


def _energy(solution: Solution) -> Iterator[Finding]:
    """How well the work of all loads agrees with the change of the energy: told only."""
    if solution.rank < solution.degrees_of_freedom:
        return
    powers = [solution.rows.power, _powers(solution)]
    time = solution.motion.time
    work = sum(integrated(time, part).sum(axis=1) for part in powers)
    change = solution.rows.energy - solution.rows.energy[0]
    left = float(np.abs(work - change).max())
    text = f"work of all loads less change of the energy: at most {left:.1e} J"
    scale = max(float(np.abs(work).max()), float(np.ptp(solution.rows.energy)))
    if scale > 0.0:
        text += f", {left / scale:.1e} of the largest"
    yield Finding("energyBalance", PASS, text)


def _reactions(solution: Solution) -> Iterator[Finding]:
    """Which reactions are not unique."""
    found = solution.non_unique_reactions
    if found:
        named = describe_reactions(dict(list(found.items())[:MOST_NAMED]))
        more = len(found) - MOST_NAMED
        text = f"these reactions are not unique: {named}"
        text += f"; and those of {more} more" if more > 0 else ""
        yield Finding("reactions", PASS, text)


def _powers(solution: Solution) -> np.ndarray:
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
    work = integrated(time, _powers(solution))
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
                "unique": bool(is_unique),
                "weight": float(weight),
                "errorMax": float(error),
            }
            for drive, is_unique, weight, error in zip(
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
