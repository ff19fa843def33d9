"""Implement the subcommands that draw: plot and report."""

from pathlib import Path

import click

from msahl.post.commands.shared import path_parameter, read_metrics
from msahl.terminal import echo

KINDS = ("path", "error", "energy", "work", "joints", "constraints", "reactions")
PLANES = ("xy", "xz", "yz", "yx", "zx", "zy")


@click.command()
@path_parameter("run", metavar="RUN")
@click.argument("kinds", metavar="[KIND]...", nargs=-1, type=click.Choice(KINDS))
@click.option(
    "--plane",
    type=click.Choice(PLANES),
    default=None,
    help="Draw the path in this plane (default: the one with the widest paths).",
)
@click.option(
    "--body", "bodies", multiple=True, metavar="NAME", help="Draw only this body; may be repeated."
)
@click.option(
    "--joint",
    "joints",
    multiple=True,
    metavar="NAME",
    help="Draw only this joint, coupling or motion; may be repeated.",
)
@click.option(
    "--format",
    "forms",
    multiple=True,
    type=click.Choice(["png", "svg"]),
    default=["png"],
    show_default=True,
    help="Set the file format; may be repeated.",
)
@path_parameter(
    "-o", "--output", metavar="DIR", help="Write the figures to DIR (default: RUN/plots)."
)
def plot(
    run: Path,
    kinds: tuple[str, ...],
    plane: str | None,
    bodies: tuple[str, ...],
    joints: tuple[str, ...],
    forms: tuple[str, ...],
    output: Path | None,
) -> None:
    """Draw figures of a run; print the files written.

    KIND is path, error, energy, work, joints, constraints or reactions (default: all for which RUN
    has data).

    Example: msahl-post plot results/top_1 path --plane xy --format png --format svg
    """
    from msahl.post.draw import save, style
    from msahl.post.figures import Choice, figures

    ((_, metrics),), (read,) = read_metrics((run,))
    choice = Choice(plane or "", bodies, joints)
    with style():
        for path in save(figures(read, metrics, choice, kinds), forms, output or run / "plots"):
            echo(str(path))


@click.command()
@path_parameter("run", metavar="RUN")
@path_parameter(
    "-o", "--output", metavar="DIR", help="Write the report to DIR (default: RUN/report)."
)
def report(run: Path, output: Path | None) -> None:
    """Write a report on a run.

    The report has its verdict, accuracy, figures and settings. Writes report.md with its pictures,
    and report.html, a single file with the pictures in it. Prints both paths.

    Example: msahl-post report results/double_pendulum_89
    """
    from msahl.post.report import write_report

    ((_, metrics),), (read,) = read_metrics((run,))
    for path in write_report(read, metrics, output or run / "report"):
        echo(str(path))
