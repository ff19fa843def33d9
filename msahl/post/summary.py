"""Tabulate the metrics of one or several runs, and explain metrics that are not available."""

from collections.abc import Iterable, Sequence

import numpy as np

from msahl.model import resolve
from msahl.post.metrics import Energy, LoadWork, Metrics, Reactions, Statistics
from msahl.post.table import Cell, Column, Table
from msahl.results.read import Run

NamedMetrics = Sequence[tuple[str, Metrics]]
"""The folder of each run, as the user gave it, and the run's metrics."""

RUN = Column("run", "run")
JOINT = Column("joint", "joint")


def _columns(key: str, group: str, form: str = ".2e", missing: str = "n/a") -> tuple[Column, ...]:
    """Return the columns of one ``Statistics``."""
    return tuple(
        Column(f"{key}_{kind}", label, group, form, missing)
        for kind, label in (("rms", "RMS"), ("mean", "mean"), ("max", "max"))
    )


def _cells(found: Statistics | None) -> tuple[Cell, ...]:
    return (None, None, None) if found is None else (found.rms, found.mean, found.max)


def energy_table(metrics: NamedMetrics) -> Table:
    """Return a table of runs: energy at the start, largest kinetic energy, balance error over both;
    elastic energy of springs and work done on the system, if there are any."""
    columns = (
        RUN,
        Column("energy_at_start", "E(1) [J]", form=".6g"),
        Column("largest_kinetic_energy", "max KE [J]", form=".6g"),
        Column("error_max", "max balance error [J]", form=".2e"),
        *_columns("error_over_start", "balance error over |E(1)|", missing="undefined"),
        *_columns("error_over_kinetic", "balance error over max KE", missing="undefined"),
        Column("elastic_energy_max", "max elastic energy [J]", form=".6g", missing=""),
        Column("work_at_end", "work at end [J]", form=".6g", missing=""),
    )
    return Table(columns, tuple((name, *_energy_cells(m)) for name, m in metrics))


def _energy_cells(metrics: Metrics) -> tuple[Cell, ...]:
    energy, loads = metrics.energy, metrics.loads
    springs = not np.isnan(loads.elastic).all()
    return (
        float(energy.total[0]),
        energy.largest_kinetic,
        energy.absolute_error.max,
        *_cells(energy.error_over_first),
        *_cells(energy.error_over_kinetic),
        float(np.abs(energy.elastic).max()) if springs else None,
        float(energy.work[-1]) if loads.names else None,
    )


def work_table(metrics: NamedMetrics) -> Table:
    """Return a table of joints: Hainge's virtual work and the work of the reaction over a step."""
    columns = (
        RUN,
        JOINT,
        *_columns("hainge", "Hainge's virtual work [J]", ".4e"),
        *_columns("reaction", "work of the reaction [J]"),
    )
    return Table(columns, tuple(row for name, m in metrics for row in _work_rows(name, m)))


def _work_rows(name: str, metrics: Metrics) -> Iterable[tuple[Cell, ...]]:
    work = metrics.work
    for k, joint in enumerate(metrics.constraints.names[: metrics.joints]):
        both = (work.hainge[:, k], work.reaction[:, k]) if work else None
        found = map(Statistics.of, both) if both else (None, None)
        yield (name, joint, *(cell for statistics in found for cell in _cells(statistics)))


UNITS = (("", "m"), ("_angle", "rad"))
"""Key suffixes and units of the two kinds of constraint violation."""
LEVELS = (("violation", "violation", ""), ("violation_rate", "violation rate", "/s"))
"""Keys, headers and units of the violation at position level and at velocity level."""


def constraints_table(metrics: NamedMetrics) -> Table:
    """Return a table of joints, couplings and motions: largest and RMS constraint violation at
    position and velocity level, blank if there is none of a unit."""
    columns = (
        RUN,
        JOINT,
        *(
            Column(f"{level}{suffix}_{kind}", label, f"{words} [{unit}{per}]", ".2e", "")
            for level, words, per in LEVELS
            for suffix, unit in UNITS
            for kind, label in (("max", "max"), ("rms", "RMS"))
        ),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, of_run in metrics:
        found = of_run.constraints
        for e, element in enumerate(found.names):
            series = [
                part[:, e, unit] for part in (found.violation, found.rate) for unit in range(2)
            ]
            rows.append((name, element, *(cell for values in series for cell in _peak(values))))
    return Table(columns, tuple(rows))


def _peak(values: np.ndarray) -> tuple[Cell, Cell]:
    """Return the largest value and the RMS of a series; ``None`` for a series of nan."""
    if np.isnan(values).any():
        return None, None
    found = Statistics.of(values)
    return found.max, found.rms


def reactions_table(reactions: Reactions) -> Table:
    """Return a table of joints, couplings and motions: the largest reactions, blank if there is
    none of a kind."""
    columns = (
        JOINT,
        Column("force_max", "max force [N]", form=".6g", missing=""),
        Column("moment_max", "max moment [N m]", form=".6g", missing=""),
        Column("load_max", "max load [N]", form=".6g", missing=""),
        Column("torque_max", "max load [N m]", form=".6g", missing=""),
        Column("unique", "unique"),
    )
    sizes = [np.sqrt((part * part).sum(axis=2)) for part in (reactions.force, reactions.moment)]
    sizes += [np.abs(reactions.load[:, :, unit]) for unit in range(2)]
    unique = [f"not {', '.join(names)}" if names else "yes" for names in reactions.not_unique]
    rows = [
        (name, *(_peak(size[:, e])[0] for size in sizes), unique[e])
        for e, name in enumerate(reactions.names)
    ]
    return Table(columns, tuple(rows))


def loads_table(loads: LoadWork) -> Table:
    """Return a table of loads and motions: work since t = 0, and largest energy of a spring."""
    columns = (
        Column("load", "load"),
        Column("work_at_end", "work at the end [J]", form=".6g"),
        Column("work_max", "largest |work| [J]", form=".6g"),
        Column("elastic_energy_max", "max elastic energy [J]", form=".6g", missing=""),
    )
    rows = [
        (name, float(work[-1]), float(np.abs(work).max()), _peak(elastic)[0])
        for name, work, elastic in zip(loads.names, loads.work.T, loads.elastic.T, strict=True)
    ]
    return Table(columns, tuple(rows))


def body_table(energy: Energy) -> Table:
    """Return a table of bodies: largest kinetic energies and the range of the potential energy."""
    columns = (
        Column("body", "body"),
        Column("linear_max", "max translational KE [J]", form=".6g"),
        Column("rotational_max", "max rotational KE [J]", form=".6g"),
        Column("potential_min", "min potential energy [J]", form=".6g"),
        Column("potential_max", "max potential energy [J]", form=".6g"),
    )
    extremes = (
        energy.linear.max(axis=0),
        energy.rotational.max(axis=0),
        energy.potential.min(axis=0),
        energy.potential.max(axis=0),
    )
    rows = zip(energy.bodies, *(map(float, values) for values in extremes), strict=True)
    return Table(columns, tuple(rows))


MOST_EVENTS = 50
"""Most events that a report lists."""


def events_table(run: Run) -> Table:
    """Return a table of what happened to contacts, and by events of the deck: the first ones."""
    columns = (
        Column("time", "time [s]", form=".9g"),
        Column("kind", "kind"),
        Column("element", "element"),
        Column("gapSpeedBefore", "gap's speed before", form=".4g"),
        Column("gapSpeedAfter", "after", form=".4g"),
        Column("impulse", "impulse", form=".4g"),
        Column("frictionImpulse", "of friction", form=".4g"),
        Column("energyLost", "energy lost [J]", form=".4g"),
        Column("event", "event"),
        Column("message", "message"),
    )
    if run.events is None:
        return Table(columns, ())
    shown = run.events[[column.key for column in columns]].head(MOST_EVENTS)
    table = Table(columns, tuple(shown.itertuples(index=False, name=None)))
    return table if run.model.events else table.without("event").without("message")


def no_work_note(run: Run) -> str:
    """Say why a run has no virtual work; empty if every step's mean reactions were written."""
    if run.has_means:
        return ""
    if run.instantaneous:
        again = (
            "with --scheme preserving"
            if resolve(run.model.simulation).degree
            else "without --reactions instantaneous"
        )
        return (
            "virtual work is not available: it needs the mean reactions over each step, but the "
            f"run has those at the output times; run the deck again {again}"
        )
    return (
        f"virtual work is not available: only one of {run.every} steps was written, but it "
        "needs the states before and after each step; run the deck again without --every"
    )


def partial_note(run: Run) -> str:
    """Say how far an incomplete run came; empty for a complete one."""
    status = run.info.get("status", "killed")
    if status == "completed" and not run.partial:
        return ""
    end = run.model.simulation.t_final
    message = run.info.get("message", "")
    reason = f": {message}" if message else ""
    return (
        f"the run is incomplete ({status}, results to t = {run.time[-1]:g} s of {end:g} s){reason}"
    )
