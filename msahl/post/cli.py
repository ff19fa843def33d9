"""The command ``msahl-post``: arguments in, exit status out; all that the room prints.

Exit status: 0 good, 1 a comparison found a difference or a verdict is FAIL, 2 not a run, not
comparable, or bad usage.
Modules are imported where a command needs them: tables start without matplotlib.
"""

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

import msahl
from msahl.post.tolerance import ATOL, RTOL, Tolerance
from msahl.printable import printable, shown_path
from msahl.run.verdict import FAIL, WORDS
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.post.compare import Comparison
    from msahl.post.summary import Measured
    from msahl.post.table import Table
    from msahl.results.read import Run

DIFFERENT, BAD_INPUT = 1, 2
KINDS = ("path", "error", "energy", "work", "constraints", "reactions")
PLANES = ("xy", "xz", "yz", "yx", "zx", "zy")

Command = TypeVar("Command", bound=Callable[..., Any])


class Commands(click.Group):
    """A group whose commands end with one clear line when what they are given is no run."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; exit with ``BAD_INPUT`` on a fault of what it was given."""
        try:
            return super().invoke(ctx)
        except Exception as error:
            if isinstance(error, click.ClickException | click.exceptions.Exit | click.Abort):
                raise
            message = _input_fault(error)
            if not message:
                raise
            echo(f"msahl-post: {printable(message)}", err=True)
            ctx.exit(BAD_INPUT)


def _input_fault(error: Exception) -> str:
    """One line on a fault of the input; empty for a fault of ours."""
    from msahl.deck import DeckError
    from msahl.results.read import ResultError

    if isinstance(error, DeckError):
        more = f" (and {len(error.faults) - 1} more)" if len(error.faults) > 1 else ""
        return f"{error.faults[0]}{more}"
    if isinstance(error, OSError) and error.filename:  # without one: a closed pipe, left to click
        return f"{error.filename}: {error.strerror}"
    return str(error) if isinstance(error, ResultError) else ""


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(msahl.__version__, prog_name="msahl-post")
def main() -> None:
    """Read what msahl wrote: how wrong is a run, what does it look like, is it the same as before.

    RUN is a folder that msahl run made. A good first command:

    \b
        msahl-post report RUN
    """


def _folder(*names: str, **settings: Any) -> Callable[[Command], Command]:
    """An argument or option that takes a path."""
    kind = click.option if names[0].startswith("-") else click.argument
    return kind(*names, type=click.Path(path_type=Path), **settings)


def _table_command(command: Command) -> Command:
    """Arguments and options shared by the commands that print a table."""
    for decorate in (
        click.option("--csv", "form", flag_value="csv", help="Print CSV, every digit."),
        click.option("--json", "form", flag_value="json", help="Print JSON, every digit."),
        _folder("runs", metavar="RUN...", nargs=-1, required=True),
    ):
        command = decorate(command)
    return command


@main.command()
@_table_command
def energy(runs: tuple[Path, ...], form: str | None) -> None:
    """How well each run kept its energy balance: E(t) - E(0) - work done on the scene.

    The error is given over |E(1)|, as Hainge (2010, eq. 3.11) has it, which means nothing where
    E(1) is near zero, and over the largest kinetic energy reached. RMS, mean and max are over rows.

    Example: msahl-post energy results/double_*
    """
    from msahl.post.summary import energy_table

    measured, _ = _measure(runs)
    _print(energy_table(measured), form)


@main.command()
@_table_command
def work(runs: tuple[Path, ...], form: str | None) -> None:
    """Virtual work of each joint over a step; zero says that the joint does no work.

    Hainge's measure (2010, eq. 3.16-3.18) is joint force . child's mean velocity . step: it is not
    zero where the joint moves energy between translation and rotation. The work of the reaction,
    force and moment, on both bodies is. Both need every step's row (msahl run without --every).

    Example: msahl-post work results/top_1 --csv > work.csv
    """
    from msahl.post.summary import no_work_note, work_table

    measured, read = _measure(runs)
    for run in read:
        _note(run, no_work_note(run))
        _note(run, "" if run.model.joints else "the scene has no joints")
    _print(work_table(measured), form)


@main.command()
@click.option("--csv", "form", flag_value="csv", help="Print CSV, every digit.")
@click.option("--json", "form", flag_value="json", help="Print JSON, every digit.")
@click.option("--at", "level", type=float, metavar="VALUE", help="The value that is passed.")
@_folder("run", metavar="RUN")
@click.argument("column", metavar="COLUMN")
def events(run: Path, column: str, level: float | None, form: str | None) -> None:
    """When a COLUMN of the tables passes a value, or turns (without --at), between the rows.

    Each time comes with how well it is known, of rows as dense as these; how well the motion is
    known is another matter (verdict).

    Example: msahl-post events results/double_pendulum_89 Bob1.x --at 0
    """
    from msahl.post.events import events_table, passages, turns
    from msahl.results.read import read_run

    read = read_run(run)
    found = turns(read, column) if level is None else passages(read, column, level)
    _print(events_table(found), form)


@main.command()
@_table_command
def constraints(runs: tuple[Path, ...], form: str | None) -> None:
    """How far each joint, coupling and motion opens [m, rad] and how fast [m/s, rad/s].

    Example: msahl-post constraints results/triple_pendulum_135 --json
    """
    from msahl.post.summary import constraints_table

    measured, read = _measure(runs)
    for run in read:
        _note(run, "" if run.reactions is not None else "the scene has no joints")
    _print(constraints_table(measured), form)


@main.command()
@_table_command
@click.option("--only", multiple=True, type=click.Choice(WORDS), help="Only runs of this verdict; "
              "may be repeated.")  # fmt: skip
@click.option("--names", "form", flag_value="names", help="Print the runs' folders alone.")
def verdict(runs: tuple[Path, ...], form: str | None, only: tuple[str, ...]) -> None:
    """The verdict on each run, PASS, WARN or FAIL, with its figures and reasons.

    Exit status: 0, or 1 if a run is FAIL, shown or not.

    Example: msahl-post verdict results/sweep/*/* --only FAIL
    """
    from msahl.post.run_verdicts import read_judged, verdict_table

    judged = [read_judged(folder) for folder in runs]
    shown = [run for run in judged if not only or run.word in only]
    if form == "names":
        echo("".join(f"{run.folder}\n" for run in shown), nl=False)
    else:
        _print(verdict_table(shown), form)
    if any(run.word == FAIL for run in judged):
        click.get_current_context().exit(DIFFERENT)


@main.command()
@_folder("run", metavar="RUN")
def reactions(run: Path) -> None:
    """Print RUN's reactions in each joint's own axes (z: the joint's axis) as CSV.

    reactions.csv has them in the inertial axes. The frame is the parent's, halfway through the step
    whose mean a row is.

    Example: msahl-post reactions results/four_bar > own_axes.csv
    """
    from msahl.post.axes import in_joint_axes
    from msahl.results.read import ResultError, read_run

    read = read_run(run)
    if not read.model.joints:
        raise ResultError(f"{run}: the scene has no joints, so there are no reactions")
    columns, rows = in_joint_axes(read)
    echo(",".join(columns))
    for row in rows.tolist():
        echo(",".join(map(repr, row)))


@main.command()
@_folder("run", metavar="RUN")
@click.argument("kinds", metavar="[KIND]...", nargs=-1, type=click.Choice(KINDS))
@click.option(
    "--plane",
    type=click.Choice(PLANES),
    default=None,
    help="Plane of the path (default: the one that shows most).",
)
@click.option(
    "--body", "bodies", multiple=True, metavar="NAME", help="Only this body; may be repeated."
)
@click.option(
    "--joint",
    "joints",
    multiple=True,
    metavar="NAME",
    help="Only this joint, coupling or motion; may be repeated.",
)
@click.option(
    "--format",
    "forms",
    multiple=True,
    type=click.Choice(["png", "svg"]),
    default=["png"],
    show_default=True,
    help="May be given twice.",
)
@_folder("-o", "--output", metavar="DIR", help="Folder of the pictures (default: RUN/plots).")
def plot(
    run: Path,
    kinds: tuple[str, ...],
    plane: str | None,
    bodies: tuple[str, ...],
    joints: tuple[str, ...],
    forms: tuple[str, ...],
    output: Path | None,
) -> None:
    """Draw RUN: path, error, energy, work, constraints, reactions (default: all there is data for).

    Prints the files written.

    Example: msahl-post plot results/top_1 path --plane xy --format png --format svg
    """
    from msahl.post.draw import save, style
    from msahl.post.figures import Choice, figures

    ((_, measures),), (read,) = _measure((run,))
    choice = Choice(plane or "", bodies, joints)
    with style():
        for path in save(figures(read, measures, choice, kinds), forms, output or run / "plots"):
            echo(str(path))


@main.command()
@_folder("run", metavar="RUN")
@_folder("-o", "--output", metavar="DIR", help="Folder of the report (default: RUN/report).")
def report(run: Path, output: Path | None) -> None:
    """Write a report on RUN: what ran, how wrong it is, in words, tables and pictures.

    Makes report.md with its pictures beside it, and report.html, one file that holds everything.
    Prints both.

    Example: msahl-post report results/double_pendulum_89
    """
    from msahl.post.report import write_report

    ((_, measures),), (read,) = _measure((run,))
    for path in write_report(read, measures, output or run / "report"):
        echo(str(path))


@main.command()
@_folder("run", metavar="RUN")
@_folder("reference", metavar="REFERENCE")
@click.option("--rtol", type=click.FloatRange(min=0), default=RTOL, show_default=True)
@click.option(
    "--atol",
    type=click.FloatRange(min=0),
    default=ATOL,
    show_default=True,
    help="In the unit of the column.",
)
@click.option(
    "--columns",
    metavar="GLOB,...",
    default="",
    help="Only columns that match, such as 'Bob.?,*.Fz'.",
)
@click.option("--until", type=float, metavar="T", help="Leave out rows after T seconds.")
def compare(
    run: Path, reference: Path, rtol: float, atol: float, columns: str, until: float | None
) -> None:
    """Are the numbers of RUN those of REFERENCE? Both are folders of runs, or single CSV files.

    Values a of RUN and b of REFERENCE are the same if |a - b| <= atol + rtol |b|. Rows are matched
    by time; REFERENCE may hold fewer rows than RUN, of the same times to 1e-9 of the span.

    Exit status: 0 same, 1 different (the first and the worst difference are printed), 2 not
    comparable (different columns, or times RUN does not have).

    Example: msahl-post compare results/top_1 reference/top_1 --rtol 1e-7
    """
    from msahl.post.compare import compare as compare_tables

    if math.isnan(rtol) or math.isnan(atol):
        raise click.BadParameter("a tolerance is a number")
    patterns = tuple(pattern.strip() for pattern in columns.split(",") if pattern.strip())
    found = compare_tables(run, reference, Tolerance(rtol, atol), patterns, until)
    for comparison in found:
        echo(_verdict(comparison))
    if any(comparison.first for comparison in found):
        click.get_current_context().exit(DIFFERENT)


def _verdict(comparison: "Comparison") -> str:
    where = f"{comparison.rows} rows of {comparison.columns} columns"
    if comparison.first is None:
        return f"{comparison.name}: same ({where}, largest difference {comparison.largest:.3g})"
    return (
        f"{comparison.name}: different ({comparison.differing} numbers in {where})\n"
        f"  first: {comparison.first}\n  worst: {comparison.worst}"
    )


def _measure(folders: Sequence[Path]) -> tuple["Measured", list["Run"]]:
    """Read and measure the runs; say on stderr which of them are not whole."""
    from msahl.post.metrics import measure
    from msahl.post.summary import partial_note
    from msahl.results.read import read_run

    runs = [read_run(folder) for folder in folders]
    for run in runs:
        _note(run, partial_note(run))
    return [(str(run.folder), measure(run)) for run in runs], runs


def _note(run: "Run", text: str) -> None:
    if text:
        echo(f"{shown_path(run.folder)}: {text}", err=True)


def _print(table: "Table", form: str | None) -> None:
    from msahl.post.table import as_csv, as_json, as_text

    write = {"csv": as_csv, "json": as_json, None: as_text}[form]
    if table.rows or form:
        echo(write(table), nl=False)


if __name__ == "__main__":
    main()
