"""The figures of one or several runs as tables, and what must be said beside them."""

from collections.abc import Iterable, Sequence

import numpy as np

from msahl.model import resolve
from msahl.post.metrics import Energy, Loads, Measures, Reactions, Spread
from msahl.post.table import Cell, Column, Table
from msahl.results.read import Run

Measured = Sequence[tuple[str, Measures]]
"""Runs by the name the user gave them, measured."""

RUN = Column("run", "run")
JOINT = Column("joint", "joint")


def _spread(key: str, group: str, form: str = ".2e", missing: str = "n/a") -> tuple[Column, ...]:
    """Columns of one ``Spread``."""
    return tuple(
        Column(f"{key}_{figure}", label, group, form, missing)
        for figure, label in (("rms", "RMS"), ("mean", "mean"), ("max", "max"))
    )


def _cells(spread: Spread | None) -> tuple[Cell, ...]:
    return (None, None, None) if spread is None else (spread.rms, spread.mean, spread.max)


def energy_table(measured: Measured) -> Table:
    """One row a run: energy at the start, largest kinetic energy, error by both measures; where
    there are any, elastic energy of springs and work done on the scene."""
    columns = (
        RUN,
        Column("energy_at_start", "E(1) [J]", form=".6g"),
        Column("largest_kinetic_energy", "max KE [J]", form=".6g"),
        Column("error_max", "max error [J]", form=".2e"),
        *_spread("error_over_start", "error over |E(1)|", missing="undefined"),
        *_spread("error_over_kinetic", "error over max KE", missing="undefined"),
        Column("elastic_energy_max", "max elastic [J]", form=".6g", missing=""),
        Column("work_at_end", "work at end [J]", form=".6g", missing=""),
    )
    return Table(columns, tuple((name, *_energy_row(m)) for name, m in measured))


def _energy_row(measures: Measures) -> tuple[Cell, ...]:
    energy, loads = measures.energy, measures.loads
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


def work_table(measured: Measured) -> Table:
    """One row a joint: virtual work over a step, by Hainge's measure and the sharp one."""
    columns = (
        RUN,
        JOINT,
        *_spread("hainge", "Hainge's measure [J]", ".4e"),
        *_spread("sharp", "work of the reaction [J]"),
    )
    return Table(columns, tuple(row for name, m in measured for row in _work_rows(name, m)))


def _work_rows(name: str, measures: Measures) -> Iterable[tuple[Cell, ...]]:
    work = measures.work
    for k, joint in enumerate(measures.constraints.names[: measures.joints]):
        both = (work.hainge[:, k], work.sharp[:, k]) if work else None
        spreads = map(Spread.of, both) if both else (None, None)
        yield (name, joint, *(cell for spread in spreads for cell in _cells(spread)))


UNITS = (("", "m"), ("_angle", "rad"))
"""Keys and units of the two parts of a gap."""


def constraints_table(measured: Measured) -> Table:
    """One row a joint, coupling or motion: largest and RMS gap and gap rate, blank where none."""
    groups = [
        (f"{what}{key}", f"{words} [{unit}{per}]")
        for what, words, per in (("gap", "gap", ""), ("rate", "gap rate", "/s"))
        for key, unit in UNITS
    ]
    columns = (
        RUN,
        JOINT,
        *(
            Column(f"{key}_{figure}", figure, words, ".2e", "")
            for key, words in groups
            for figure in ("max", "rms")
        ),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, measures in measured:
        found = measures.constraints
        for e, element in enumerate(found.names):
            series = [
                part[:, e, unit] for part in (found.violation, found.rate) for unit in range(2)
            ]
            rows.append((name, element, *(cell for values in series for cell in _peak(values))))
    return Table(columns, tuple(rows))


def _peak(values: np.ndarray) -> tuple[Cell, Cell]:
    """Largest and RMS of a series, nothing of one that is not there."""
    if np.isnan(values).any():
        return None, None
    spread = Spread.of(values)
    return spread.max, spread.rms


def reactions_table(reactions: Reactions) -> Table:
    """One row a joint, coupling or motion: the largest it bears, blank where it bears none."""
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
    unique = [f"not {', '.join(columns)}" if columns else "yes" for columns in reactions.shared]
    rows = [
        (name, *(_peak(size[:, e])[0] for size in sizes), unique[e])
        for e, name in enumerate(reactions.names)
    ]
    return Table(columns, tuple(rows))


def loads_table(loads: Loads) -> Table:
    """One row a load or motion: its work since t = 0, and the largest energy a spring stores."""
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
    """One row a body: largest kinetic energies and the range of the potential energy."""
    columns = (
        Column("body", "body"),
        Column("linear_max", "max translational [J]", form=".6g"),
        Column("rotational_max", "max rotational [J]", form=".6g"),
        Column("potential_min", "least potential [J]", form=".6g"),
        Column("potential_max", "largest potential [J]", form=".6g"),
    )
    dt2 = (
        energy.linear.max(axis=0),
        energy.rotational.max(axis=0),
        energy.potential.min(axis=0),
        energy.potential.max(axis=0),
    )
    figures = zip(energy.bodies, *(map(float, values) for values in dt2), strict=True)
    return Table(columns, tuple(figures))


def no_work_note(run: Run) -> str:
    """Why a run has no virtual work; empty for one with every step's row and mean reactions."""
    if run.has_means:
        return ""
    if run.instantaneous:
        again = (
            "with --scheme preserving"
            if resolve(run.model.simulation).degree
            else "without --reactions instantaneous"
        )
        return (
            "virtual work is not available: it takes mean reactions over steps, and the run has "
            f"those at the rows; run the deck again {again}"
        )
    return (
        f"virtual work is not available: only every {run.every}th step was kept, and it takes the "
        "row before and after each step; run the deck again without --every"
    )


def partial_note(run: Run) -> str:
    """How far a run came that did not reach its end; empty for a whole one."""
    status = run.info.get("status", "cut off by force")
    if status == "completed" and not run.partial:
        return ""
    end = run.model.simulation.t_final
    message = run.info.get("message", "")
    told = f": {message}" if message else ""
    return f"the run is not whole ({status}, {_reach(run.time)} of {end:g} s){told}"


def _reach(time: np.ndarray) -> str:
    return f"rows to t = {time[-1]:g}"
