"""Implement the subcommands that print tables: energy, work, constraints, reactions, events."""

from pathlib import Path

import click

from msahl.post.commands.shared import (
    path_parameter,
    print_note,
    print_table,
    read_metrics,
    table_format,
    table_of_runs,
)
from msahl.terminal import echo


@click.command()
@table_of_runs
def energy(runs: tuple[Path, ...], form: str | None) -> None:
    """Print energy balance errors of runs.

    The error is E(t) - E(0) - work done on the system. It is divided by |E(1)|, as in Hainge (2010,
    eq. 3.11), which is meaningless if E(1) is near zero, and by the largest kinetic energy. RMS,
    mean and max are over the output times.

    Example: msahl-post energy results/double_*
    """
    from msahl.post.summary import energy_table

    metrics, _ = read_metrics(runs)
    print_table(energy_table(metrics), form)


@click.command()
@table_of_runs
def work(runs: tuple[Path, ...], form: str | None) -> None:
    """Print the virtual work of joints over a step.

    Hainge's virtual work (2010, eq. 3.16-3.18) is joint force . child's mean velocity . step size;
    it is not zero if the joint exchanges energy between translation and rotation. The work of the
    reaction, force and moment, on both bodies is zero for an ideal joint. Both need the results of
    every step (msahl run without --every).

    Example: msahl-post work results/top_1 --csv > work.csv
    """
    from msahl.post.summary import no_work_note, work_table

    metrics, read = read_metrics(runs)
    for run in read:
        print_note(run, no_work_note(run))
        print_note(run, "" if run.model.joints else "the model has no joints")
    print_table(work_table(metrics), form)


@click.command()
@table_of_runs
def constraints(runs: tuple[Path, ...], form: str | None) -> None:
    """Print constraint violations.

    The violation of each joint, coupling and motion is given at position level [m, rad] and at
    velocity level [m/s, rad/s].

    Example: msahl-post constraints results/triple_pendulum_135 --json
    """
    from msahl.post.summary import constraints_table

    metrics, read = read_metrics(runs)
    for run in read:
        print_note(run, "" if run.reactions is not None else "the model has no joints")
    print_table(constraints_table(metrics), form)


@click.command()
@path_parameter("run", metavar="RUN")
def reactions(run: Path) -> None:
    """Print reactions in the joints' own axes as CSV.

    The z axis is the joint's axis. In reactions.csv they are in inertial axes. The joint's axes are
    those of its parent, halfway through the step over which the reaction is the mean.

    Example: msahl-post reactions results/four_bar > own_axes.csv
    """
    from msahl.post.joint_axes import in_joint_axes
    from msahl.results.read import ResultError, read_run

    read = read_run(run)
    if not read.model.joints:
        raise ResultError(f"{run}: the model has no joints, so there are no reactions")
    columns, rows = in_joint_axes(read)
    echo(",".join(columns))
    for row in rows.tolist():
        echo(",".join(map(repr, row)))


@click.command()
@table_format
@click.option(
    "--at",
    "level",
    type=float,
    metavar="VALUE",
    help="Find when COLUMN passes VALUE (default: when it has a maximum or minimum).",
)
@path_parameter("run", metavar="RUN")
@click.argument("column", metavar="COLUMN")
def events(run: Path, column: str, level: float | None, form: str | None) -> None:
    """Print when a column has a value or an extremum.

    COLUMN is a column of RUN's tables. Values are interpolated between the output times. The
    uncertainty of each time is that of the interpolation; the error of the computed motion is not
    part of it (see: msahl-post verdict).

    Example: msahl-post events results/double_pendulum_89 Bob1.x --at 0
    """
    from msahl.post.events import crossings, events_table, extrema
    from msahl.results.read import read_run

    read = read_run(run)
    found = extrema(read, column) if level is None else crossings(read, column, level)
    print_table(events_table(found), form)
