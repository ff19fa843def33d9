"""Define what subcommands share: arguments, exit status, reading of runs, printing of tables."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.post.summary import NamedMetrics
    from msahl.post.table import Table
    from msahl.results.read import Run

DIFFERENT, BAD_INPUT = 1, 2
"""Exit status of a comparison that found a difference or a verdict FAIL, and of bad input."""

Command = TypeVar("Command", bound=Callable[..., Any])


def path_parameter(*names: str, **settings: Any) -> Callable[[Command], Command]:
    """Return the decorator of an argument or option that takes a path."""
    kind = click.option if names[0].startswith("-") else click.argument
    return kind(*names, type=click.Path(path_type=Path), **settings)


def table_format(command: Command) -> Command:
    """Add the options that choose the format of a printed table."""
    for decorate in (
        click.option("--csv", "form", flag_value="csv", help="Print CSV with all digits."),
        click.option("--json", "form", flag_value="json", help="Print JSON with all digits."),
    ):
        command = decorate(command)
    return command


def picture_formats(command: Command) -> Command:
    """Add the option that chooses the formats of pictures."""
    return click.option(
        "--format",
        "forms",
        multiple=True,
        type=click.Choice(["png", "svg", "pdf"]),
        default=["png"],
        show_default=True,
        help="Set the file format of the pictures; may be repeated.",
    )(command)


def table_of_runs(command: Command) -> Command:
    """Add the arguments and options of a command that prints a table of runs."""
    return path_parameter("runs", metavar="RUN...", nargs=-1, required=True)(table_format(command))


def read_metrics(folders: Sequence[Path]) -> tuple["NamedMetrics", list["Run"]]:
    """Read runs and compute their metrics; say on stderr which runs are incomplete."""
    from msahl.jit.announced import announced
    from msahl.post.metrics import compute_metrics
    from msahl.post.summary import partial_note
    from msahl.results.read import read_run

    runs = [read_run(folder) for folder in folders]
    for run in runs:
        print_note(run, partial_note(run))
    with announced(True):
        return [(str(run.folder), compute_metrics(run)) for run in runs], runs


def print_note(run: "Run", text: str) -> None:
    """Print a note on a run to stderr, if the text is not empty."""
    if text:
        echo(f"{shown_path(run.folder)}: {text}", err=True)


def tell_notes(run: Path, notes: Sequence[str]) -> None:
    """Print to stderr what is wrong with files of meshes of a run."""
    for note in notes:
        echo(f"{shown_path(run)}: {printable(note)}; the shape is omitted", err=True)


def print_table(table: "Table", form: str | None) -> None:
    """Print a table as text, "csv" or "json"; nothing for an empty table as text."""
    from msahl.post.table import as_csv, as_json, as_text

    write = {"csv": as_csv, "json": as_json, None: as_text}[form]
    if table.rows or form:
        echo(write(table), nl=False)
