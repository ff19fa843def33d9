"""Build the viewer: a page of its own, or a block of another page.

The data of a viewer, which ``viewer.js`` reads, is

    {
      "isPage": bool,                # whether it fills a page of its own
      "graph": [str],                # columns that the graph shows at first
      "runs": [{                     # one, or two that are overlaid
        "name": str, "note": str,    # the note says how exactly the motion is shown
        "scene": {...},              # of post/scene
        "motion": {...} or null,     # of ``pack_poses``; null: the scene does not move
        "columns": {...} or null,    # of ``pack_columns``
        "modes": {...} or null,      # of ``modes.py``, in place of a motion
        "happenings": {...},         # of ``happenings.py``: contacts and events, if there are some
        "isPartial": bool,           # whether the run stopped early
      }],
    }
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msahl.joints.coordinates import is_angle
from msahl.post.page.markup import element
from msahl.post.page.parts import Part, write_page
from msahl.post.scene import scene_of_run
from msahl.post.view.columns import columns_of_run, pack_columns
from msahl.post.view.happenings import happenings, loads_of_contacts
from msahl.post.view.poses import Poses, choose_keys, pack_poses, poses_of_run
from msahl.records import record
from msahl.results.read import read_events
from msahl.results.sample import Sample, read_sample
from msahl.run.tables import JOINTS, MARKERS

if TYPE_CHECKING:
    import pandas as pd

POSE_NUMBERS = 300_000
"""Most numbers of key poses of ten bodies, and in proportion of more: about 300 kB of the page."""
COLUMN_NUMBERS = 600_000
"""Most numbers of columns, of which each takes about a byte of the page."""
READ_NUMBERS = 3_000_000
"""Numbers that are read from the tables of a run, of which the reading takes a second."""
READ_ROWS = 1 << 16
"""Most rows that are read."""
CURVES = 3
"""Most columns that the graph shows at first."""

NO_SCRIPT = "This view in three dimensions needs JavaScript."


@record
class Shown:
    """What a viewer shows of one run, or of a model at rest: a scene, and the rest of it packed."""

    scene: Mapping[str, Any]
    name: str = ""
    note: str = ""
    motion: Mapping[str, Any] | None = None
    columns: Mapping[str, Any] | None = None
    is_partial: bool = False
    modes: Mapping[str, Any] | None = None
    happenings: Mapping[str, Any] | None = None


def show_run(folder: Path, patterns: tuple[str, ...] = ()) -> Shown:
    """Read a run for the viewer, with the columns that match a pattern (all without one)."""
    sample = read_sample(folder, READ_NUMBERS, READ_ROWS)
    return show_sample(sample, patterns, events=read_events(folder, sample.model))


def show_error(folder: Path, patterns: tuple[str, ...] = ()) -> list[Shown]:
    """Read a run, and run its model again with smaller steps: both are shown, so that the
    difference makes the error of the run visible.
    """
    from msahl.post.view.companion import companion_of  # a run needs what no view does

    sample = read_sample(folder, READ_NUMBERS, READ_ROWS)
    first = show_sample(sample, patterns, events=read_events(folder, sample.model))
    finer = show_sample(companion_of(sample), patterns)
    return [first, replace(finer, name=f"{first.name}, with smaller steps")]


def show_sample(
    sample: Sample,
    patterns: tuple[str, ...] = (),
    columns: bool = True,
    events: "pd.DataFrame | None" = None,
) -> Shown:
    """Return what a viewer shows of the output times that were read of a run, and of its
    ``events``.
    """
    scene = scene_of_run(sample)
    poses = poses_of_run(sample)
    size = max(2.0 * poses.reach, float(scene["size"]))
    most = POSE_NUMBERS * max(1.0, len(sample.model.bodies) / 10) / (7 * len(sample.model.bodies))
    keys = choose_keys(poses, size, int(most))
    packed = pack_columns(columns_of_run(sample, patterns), COLUMN_NUMBERS) if columns else None
    return Shown(
        scene=scene,
        name=sample.folder.resolve().name,
        note=_note(sample, poses, len(keys.rows), (keys.position, keys.orientation)),
        motion=pack_poses(poses, keys.rows),
        columns=packed,
        is_partial=sample.partial,
        happenings=happenings(sample.model, events, loads_of_contacts(sample)),
    )


def _note(sample: Sample, poses: Poses, keys: int, errors: tuple[float, float]) -> str:
    """Say how exactly the motion and the columns are shown."""
    read = len(poses.time)
    what = f"{sample.total} output times"
    if read < sample.total:
        what = f"every {sample.stride}th of {sample.total} output times was read; {keys} of them"
    else:
        what = f"{keys} of {what}" if keys < read else f"all {what}"
    sentences = f"Key poses: {what}. " + (
        f"Interpolated between them by polynomials of degree 3; the largest error at the output "
        f"times read is {errors[0]:.1e} m and {errors[1]:.1e} rad. "
        if keys < read
        else "Interpolated between them by polynomials of degree 3. "
    )
    return (
        f"{sentences}Poses are rounded to 1e-6 of the size of the motion, columns of the "
        "graph and arrows to 1/65535 of their range."
    )


def viewer_block(
    shown: Sequence[Shown], key: str = "viewer", graph: Sequence[str] = (), is_page: bool = False
) -> Part:
    """Return a viewer as a part of a page: one run or scene, or two that are overlaid.

    ``key`` distinguishes the viewers of a page; ``graph`` are columns that the graph shows at
    first (default: a few that are chosen by their tables).
    """
    columns = shown[0].columns
    data = {
        "isPage": is_page,
        "graph": list(graph) or (first_columns(columns) if columns else []),
        "runs": [
            {"name": s.name, "note": s.note, "isPartial": s.is_partial}
            | {"scene": s.scene, "motion": s.motion, "columns": s.columns, "modes": s.modes}
            | ({"happenings": s.happenings} if s.happenings else {})
            for s in shown
        ],
    }
    holder = element(
        "section", element("noscript", NO_SCRIPT), class_="viewer", tabindex=0, data_viewer=key
    )
    plots = any(s.columns for s in shown)
    return Part(
        holder,
        styles=("viewer.css", *(("uplot.min.css",) if plots else ())),
        modules=("viewer.js",),
        bundles=("three", *(("uplot",) if plots else ())),
        data={key: data},
    )


def viewer_page(shown: Sequence[Shown], graph: Sequence[str] = ()) -> str:
    """Return a viewer as a page of one HTML file."""
    title = shown[0].scene["title"] or shown[0].name or "msahl"
    page = write_page(title, viewer_block(shown, graph=graph, is_page=True))
    return page.replace("<body>", '<body class="viewer-page">', 1)


def first_columns(packed: Mapping[str, Any]) -> list[str]:
    """Choose columns for a first graph: coordinates of joints, else positions, of markers if there
    are some, of one unit, and only such as change.
    """
    moving = [
        (name, unit, table)
        for name, unit, table, step in zip(
            packed["names"], packed["units"], packed["tables"], packed["step"], strict=True
        )
        if step > 1e-12
    ]
    chosen = [c for c in moving if c[2] == JOINTS and is_angle(c[0].rpartition(".")[2])]
    chosen = chosen or [c for c in moving if c[2] == JOINTS and c[1] == "m"]
    chosen = chosen or [c for c in moving if c[2] == MARKERS and c[1] == "m"]
    chosen = chosen or [c for c in moving if c[1] == "m"] or moving
    return [name for name, unit, _ in chosen if unit == chosen[0][1]][:CURVES]
