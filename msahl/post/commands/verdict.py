"""Implement the subcommand ``msahl-post verdict``: the verdicts of many runs."""

from pathlib import Path

import click

from msahl.post.commands.shared import DIFFERENT, print_table, table_of_runs
from msahl.run.verdict import FAIL, WORDS
from msahl.terminal import echo


@click.command()
@table_of_runs
@click.option(
    "--only",
    multiple=True,
    type=click.Choice(WORDS),
    help="Show only runs with this verdict; may be repeated.",
)
@click.option("--names", "form", flag_value="names", help="Print the runs' folders only.")
def verdict(runs: tuple[Path, ...], form: str | None, only: tuple[str, ...]) -> None:
    """Print the verdicts on runs, with reasons.

    Exit status: 0, or 1 if the verdict on any run is FAIL, shown or not.

    Example: msahl-post verdict results/sweep/*/* --only FAIL
    """
    from msahl.post.run_verdicts import read_verdict, verdict_table

    found = [read_verdict(folder) for folder in runs]
    shown = [run for run in found if not only or run.word in only]
    if form == "names":
        echo("".join(f"{run.folder}\n" for run in shown), nl=False)
    else:
        print_table(verdict_table(shown), form)
    if any(run.word == FAIL for run in found):
        click.get_current_context().exit(DIFFERENT)
