"""Implement the subcommand ``msahl-post view``: a run in three dimensions, as one HTML file."""

from pathlib import Path

import click

from msahl.post.commands.shared import path_parameter, tell_notes
from msahl.printable import shown_path
from msahl.terminal import echo, writing


@click.command(short_help="Write an HTML file that shows the motion.")
@path_parameter("run", metavar="RUN")
@path_parameter("other", metavar="[RUN2]", required=False)
@path_parameter("-o", "--output", metavar="FILE", help="Write to FILE (default: RUN/view.html).")
@click.option(
    "--companion",
    is_flag=True,
    help="Run the model of RUN again with half the step size (or a thousandth of the local "
    "tolerance) and show both: their difference is about the error of RUN.",
)
@click.option("--open", "is_opened", is_flag=True, help="Open the file in a browser.")
@click.option(
    "--columns",
    metavar="GLOB,...",
    default="",
    help="Include only columns that match a pattern, such as 'Crank.*,*.Fz' (default: all).",
)
@click.option(
    "--graph",
    metavar="COLUMN,...",
    default="",
    help="Show these columns in the graph at first (default: coordinates of joints).",
)
def view(
    run: Path,
    other: Path | None,
    output: Path | None,
    companion: bool,
    is_opened: bool,
    columns: str,
    graph: str,
) -> None:
    """Write an HTML file that shows the motion of a run in three dimensions.

    The file needs no network and no other file. It plays the motion at any speed, with paths,
    forces, names and a graph of the columns. With RUN2 both runs are shown, the second one
    translucent: the same model before and after a change, or with other steps. --companion shows
    the run beside one with smaller steps.

    Example: msahl-post view results/four_bar --open
    """
    if other and companion:
        raise click.UsageError("give RUN2 or --companion, not both")
    from msahl.post.view import show_error, show_run, viewer_page
    from msahl.results.read import ResultError
    from msahl.results.write import replace_file

    patterns, first = _listed(columns), _listed(graph)
    if companion:
        from msahl.jit.announced import announced

        with announced(True):
            shown = show_error(run, patterns)
    else:
        shown = [show_run(folder, patterns) for folder in (run, other) if folder]
    names = shown[0].columns["names"] if shown[0].columns else ()
    for name in first:
        if name not in names:
            raise ResultError(f"{shown_path(run)}: --graph: no column '{name}' is shown")
    path = output or run / "view.html"
    page = viewer_page(shown, graph=first).encode()
    with writing(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        replace_file(path, page)
    for folder, one in zip((run, other), shown, strict=False):
        if folder:  # a companion has the meshes of its run
            tell_notes(folder, one.scene["notes"])
    echo(str(path))
    if is_opened:
        click.launch(str(path))


def _listed(text: str) -> tuple[str, ...]:
    return tuple(part.strip() for part in text.split(",") if part.strip())
