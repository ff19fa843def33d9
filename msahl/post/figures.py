"""Draw a run: linkage and paths, and its graphs (``run_graphs``)."""

from collections.abc import Iterator, Sequence

from matplotlib.figure import Figure

from msahl.post.draw import draw_group
from msahl.post.linkage.draw import lacks_motion, picture
from msahl.post.metrics import Metrics
from msahl.post.paths import lacks_space, paths, paths_in_space
from msahl.post.run_graphs import GRAPHS, Choice, chosen_bodies, chosen_elements
from msahl.results.read import ResultError, Run

SPATIAL = ("linkage", "path", "path3d")
"""Kinds of pictures that show the motion in space; all others are those of ``GRAPHS``."""


def figures(
    run: Run, metrics: Metrics, choice: Choice, kinds: Sequence[str] = ()
) -> Iterator[tuple[str, Figure]]:
    """Yield name and figure of each of ``kinds``, or of all kinds for which the run has data.

    Raises ``ResultError`` if a requested kind has no data, or the model lacks a requested name.
    """
    chosen_elements(metrics, choice)
    for kind in kinds or (*SPATIAL, *GRAPHS):
        # A linkage that hardly moves is no picture worth having, but one that can be asked for.
        if kind in SPATIAL:
            found = spatial_figure(run, kind, choice, asked=bool(kinds))
        else:
            group = GRAPHS[kind](run, metrics, choice)
            drawn = (kind, draw_group(group, run_title(run))) if group.graphs else None
            found = drawn or group.note
        if not isinstance(found, str):
            yield found
        elif kinds:
            raise ResultError(f"{run.folder}: no picture of {kind}: {found}")


def spatial_figure(
    run: Run, kind: str, choice: Choice, asked: bool = False
) -> tuple[str, Figure] | str:
    """Return name and figure of the linkage or of the paths, or why there is nothing to see; of a
    linkage that was ``asked`` for always the figure."""
    bodies = chosen_bodies(run, choice)
    if kind == "linkage":
        lacks = "" if asked else lacks_motion(run)
        return lacks or picture(run, choice.bodies, choice.plane)
    if kind == "path3d":
        return lacks_space([run], bodies) or paths_in_space([run], bodies)
    return paths([run], bodies, choice.plane)


def comparisons(
    runs: Sequence[Run], choice: Choice, kinds: Sequence[str] = ()
) -> Iterator[tuple[str, Figure]]:
    """Yield name and figure of each of ``kinds`` that several runs can share; by default of their
    paths. Raises ``ResultError`` for another kind, or a body that a run lacks."""
    bodies = chosen_bodies(runs[0], choice)
    for kind in kinds or ("path",):
        if kind == "path":
            yield paths(runs, bodies, choice.plane)
        elif kind == "path3d":
            yield paths_in_space(runs, bodies)
        else:
            raise ResultError(
                f"a picture of {kind} shows one run only; several runs can be compared by "
                "--columns, --phase, path and path3d"
            )


def run_title(run: Run) -> str:
    """Return the title of the model that was run, or the name of the run's folder."""
    return run.model.simulation.title or run.folder.resolve().name
