"""Print a table of the time and the errors of the runs of many sweeps. Arguments: their folders.

Energy errors are RMS over the run, relative to the largest kinetic energy and (as in Hainge 2010)
to the energy at the start. Virtual work is the RMS over the run at the joint with the largest, in
Hainge's definition and that of the reaction. The constraint violation is the largest one [m].
Seconds of the loop are those of the steps, apart from those of preparing the run (system and
initial state) and of its output.
"""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from msahl.post.metrics import Statistics, compute_metrics
from msahl.results.read import read_run

COLUMNS = (
    "deck",
    "h",
    "steps",
    "seconds_loop",
    "seconds_prepare",
    "seconds_output",
    "energy_rms_over_kinetic",
    "energy_rms_over_start",
    "virtual_work_hainge_rms",
    "virtual_work_reaction_rms",
    "constraint_violation",
)


def row(folder: Path) -> tuple[str | float, ...]:
    """Return the columns of one run."""
    run = read_run(folder)
    metrics = compute_metrics(run)
    energy, work = metrics.energy, metrics.work
    violation = metrics.constraints.violation[:, :, 0]  # [m]
    by_measure = [values.T for values in (work.hainge, work.reaction)] if work else [(), ()]
    seconds = run.info["seconds"]
    return (
        Path(run.info["deck"]["path"]).stem,
        run.info["options"]["dt"],
        run.info["steps"],
        *(round(seconds[phase], 4) for phase in ("loop", "prepare", "output")),
        energy.error_over_kinetic.rms if energy.error_over_kinetic else "",
        energy.error_over_first.rms if energy.error_over_first else "",
        *(max((Statistics.of(joint).rms for joint in joints), default="") for joints in by_measure),
        float(np.fmax.reduce(violation, axis=None, initial=0.0)),  # nan where there is no such unit
    )


def runs_of(sweep: Path) -> list[Path]:
    """Return the folders of the completed runs of a sweep, in the order of its plan."""
    with (sweep / "runs.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    return [sweep / "runs" / row["key"] for row in rows if row["status"] == "completed"]


def main(sweeps: Sequence[str]) -> None:
    """Print the table."""
    write = csv.writer(sys.stdout, lineterminator="\n").writerow
    write(COLUMNS)
    for sweep in sweeps:
        for folder in runs_of(Path(sweep)):
            write(row(folder))


if __name__ == "__main__":
    main(sys.argv[1:])
