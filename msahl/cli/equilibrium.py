"""The command ``msahl equilibrium``: where a deck's model is in equilibrium."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from msahl.cli.compiling import computing
from msahl.cli.console import NOT_CONVERGED, print_report, say, stop, writing
from msahl.cli.decks import job_of
from msahl.cli.options import DECK, NumberType, output_option, quiet_option, set_option
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    import numpy as np

    from msahl.analysis.equilibria.equilibrium import Solution
    from msahl.analysis.linearised.point import Point
    from msahl.results.job import Job

COARSE = 1e-3
"""Error in space, over the size of the model, above which a warning states it."""


@click.command(short_help="Find equilibria of a deck's model.")
@click.argument("deck", type=DECK)
@output_option("none; nothing is written")
@set_option
@click.option(
    "--starts",
    type=click.IntRange(1, 10_000),
    metavar="N",
    default=1,
    help="Search from N configurations: the deck's and N - 1 drawn at random (default: 1).",
)
@click.option(
    "--rotation",
    type=NumberType(),
    nargs=3,
    metavar="WX WY WZ",
    default=(0.0, 0.0, 0.0),
    help="Let the complete model rotate steadily with this angular velocity in rad/s, inertial "
    "axes (default: 0 0 0, at rest).",
)
@click.option(
    "--load-path",
    type=NumberType(),
    metavar="END",
    help="Follow the equilibria at rest while gravity and loads grow from zero to END times those "
    "of the deck, through limit points and bifurcations (default: not; only the deck's loads).",
)
@quiet_option
def equilibrium(
    deck: Path,
    output: Path | None,
    settings: tuple[str, ...],
    starts: int,
    rotation: tuple[float, float, float],
    load_path: float | None,
    quiet: bool,
) -> None:
    """Find the places at which all forces on the model of DECK are balanced.

    The search begins where the deck starts the model and finds the equilibrium to which the forces
    lead, which is stable, and the nearest of any kind. Reports each with its stability. Velocities
    of the deck do not count. With -o, writes states.csv and reactions.csv, one row for each
    equilibrium, and decks that begin there: equilibrium1.xml and so on. Exits with status 3 if
    there is none. Of beams, states the error in space, by twice the elements. With --load-path,
    reports the path of equilibria under growing loads instead.

    Example: msahl equilibrium decks/mechanisms/suspension.xml
    """
    job = job_of(deck, {}, settings)
    if load_path is not None:
        if starts != 1 or any(rotation):
            raise click.UsageError("--load-path goes with neither --starts nor --rotation")
        _follow_loads(job, load_path, output, quiet)
        return
    _find(job, starts, rotation, output, quiet)


def _find(
    job: "Job",
    starts: int,
    rotation: tuple[float, float, float],
    output: Path | None,
    quiet: bool,
) -> None:
    """Report the equilibria found from ``starts`` configurations, and write them."""
    import numpy as np

    from msahl.analysis.equilibria.equilibrium import held_motions, search_start
    from msahl.analysis.equilibria.equilibrium_lines import lines
    from msahl.analysis.equilibria.search import all_equilibria, unresisted
    from msahl.analysis.equilibria.slipping import slipping

    with computing(job.source.path, quiet):
        point = search_start(job.model)
        found = all_equilibria(point, np.array(rotation), starts)
    if not found:
        where, many = unresisted(point, np.array(rotation)), f"{starts} configurations"
        remedy = "search from more with --starts, or start the deck nearer to one"
        if point.model.beams:
            remedy = f"follow the growing loads with --load-path 1, {remedy}"
        if why := slipping(point):
            remedy = why
        elif where:
            remedy = f"nothing resists what acts on {where}; attach the body, or omit the load"
        stop(
            f"{shown_path(job.source.path)}: no equilibrium was found from "
            f"{many if starts > 1 else 'one configuration'}; {printable(remedy)}",
            NOT_CONVERGED,
        )
    for name in held_motions(job.model):
        say(f"WARN: motion '{printable(name)}' is held where it begins, but moves at t = 0")
    in_space = _in_space(job, found[0].place.point, np.array(rotation))
    print_report(lambda: lines(point, found, in_space), (), quiet)
    if output is not None:
        _write(output, job, point, found)


def _in_space(job: "Job", found: "Point", rotation: "np.ndarray") -> list[str]:
    """Return a line with the error in space of an equilibrium of beams, and warn if it is large."""
    if not found.model.beams:
        return []
    from msahl.analysis.equilibria.equilibrium import size_of
    from msahl.deck.finer_beams import RefinementError
    from msahl.study.more_elements import equilibrium_error

    try:
        error = equilibrium_error(job.source, job.text, found, rotation)
    except RefinementError as fault:
        say(f"WARN: the error in space is not known: {printable(str(fault))}")
        return []
    if error > COARSE * size_of(found):
        say(
            f"WARN: the elements of the beams are too few: the error in space is {error:.1e} m; "
            "increase their number or degree"
        )
    return [f"  error in space: {error:.1e} m, by an equilibrium with twice the elements"]


def _follow_loads(job: "Job", end: float, output: Path | None, quiet: bool) -> None:
    """Report the path of equilibria up to a load factor ``end``, and write its tables; a path that
    cannot be followed to its end, as far as it goes.
    """
    from msahl.analysis.equilibria.equilibrium import search_start
    from msahl.analysis.equilibria.load_path import Path as LoadPath
    from msahl.analysis.equilibria.load_path_tables import lines, tables
    from msahl.jit.announced import announced
    from msahl.jit.progress import CompileError
    from msahl.results.write import write_tables
    from msahl.start.velocities import StartError

    points, fault = [], ""
    try:
        with announced(not quiet):
            start = search_start(job.model)
            for point in LoadPath(start).to(end):
                points.append(point)
    except (StartError, CompileError) as error:
        fault = f"{shown_path(job.source.path)}: {printable(str(error))}"
    if points and not quiet:
        echo("\n".join(lines(points)))
    if points and output is not None:
        with writing(output):
            write_tables(output, tables(start, points))
    if fault:
        stop(fault, NOT_CONVERGED)


def _write(folder: Path, job: "Job", start: "Point", found: "list[Solution]") -> None:
    """Write the tables and the decks that begin at the equilibria into the ``folder``."""
    from msahl.analysis.equilibria.begin import deck_at
    from msahl.analysis.equilibria.tables import tables
    from msahl.deck import DeckError
    from msahl.results.write import write_tables
    from msahl.start.velocities import StartError

    try:
        with writing(folder):
            write_tables(folder, tables(found))
            for number, solution in enumerate(found, start=1):
                text = deck_at(start, solution)
                (folder / f"equilibrium{number}.xml").write_bytes(text)
    except (DeckError, StartError) as error:
        stop(f"{shown_path(job.source.path)}: {printable(str(error))}", NOT_CONVERGED)
