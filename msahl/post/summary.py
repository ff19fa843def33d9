"""The figures of one or several runs as tables, and what must be said beside them."""

from collections.abc import Iterable, Sequence

import numpy as np

from msahl.post.measure import Energy, Measures, Spread
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
    """One row a run: energy at the start, largest kinetic energy, error by both measures."""
    columns = (
        RUN,
        Column("energy_at_start", "E(1) [J]", form=".6g"),
        Column("largest_kinetic_energy", "max KE [J]", form=".6g"),
        Column("error_max", "max error [J]", form=".2e"),
        *_spread("error_over_start", "error over |E(1)|", missing="undefined"),
        *_spread("error_over_kinetic", "error over max KE", missing="undefined"),
    )
    return Table(columns, tuple((name, *_energy_row(m.energy)) for name, m in measured))


def _energy_row(energy: Energy) -> tuple[Cell, ...]:
    return (
        float(energy.total[0]),
        energy.largest_kinetic,
        energy.absolute_error.max,
        *_cells(energy.error_over_first),
        *_cells(energy.error_over_kinetic),
    )


def work_table(measured: Measured) -> Table:
    """One row a joint: virtual work over a step, by Hainge's measure and the sharp one."""
    columns = (
        RUN,
        JOINT,
        *_spread("hainge", "Hainge's measure [J]", ".4e"),
        *_spread("sharp", "force . change of gap [J]"),
    )
    return Table(columns, tuple(row for name, m in measured for row in _work_rows(name, m)))


def _work_rows(name: str, measures: Measures) -> Iterable[tuple[Cell, ...]]:
    work = measures.work
    for k, joint in enumerate(measures.constraints.joints):
        both = (work.hainge[:, k], work.sharp[:, k]) if work else None
        spreads = map(Spread.of, both) if both else (None, None)
        yield (name, joint, *(cell for spread in spreads for cell in _cells(spread)))


def constraints_table(measured: Measured) -> Table:
    """One row a joint: largest and RMS gap and gap rate."""
    columns = (
        RUN,
        JOINT,
        *(Column(f"gap_{key}", key, "gap [m]", ".2e") for key in ("max", "rms")),
        *(Column(f"rate_{key}", key, "gap rate [m/s]", ".2e") for key in ("max", "rms")),
    )
    rows: list[tuple[Cell, ...]] = []
    for name, measures in measured:
        joints = measures.constraints
        for joint, gap, rate in zip(joints.joints, joints.gap.T, joints.rate.T, strict=True):
            spreads = (Spread.of(gap), Spread.of(rate))
            rows.append((name, joint, *(value for s in spreads for value in (s.max, s.rms))))
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
    reach = (
        energy.linear.max(axis=0),
        energy.rotational.max(axis=0),
        energy.potential.min(axis=0),
        energy.potential.max(axis=0),
    )
    figures = zip(energy.bodies, *(map(float, values) for values in reach), strict=True)
    return Table(columns, tuple(figures))


def thinned_note(run: Run) -> str:
    """Why a thinned run has no virtual work; empty for a run with every step's row."""
    if run.every == 1:
        return ""
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
