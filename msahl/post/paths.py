"""Draw the paths of bodies' reference points B, in a plane or in space, of one run or several.

The plane is the one in which the paths extend most, with gravity pointing down; scales are equal.
Colours are those of bodies, and line styles those of runs.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.axes3d import Axes3D

from msahl.post.draw import COLOURS, LINES, folded, legend, looks, new_figure, plain
from msahl.post.histories import run_labels, title
from msahl.results.read import ResultError, Run

AXES = "xyz"
SPATIAL = 0.02
"""Paths are spatial if they extend this far in the third direction, relative to the first."""
POINTS_IN_PLANE = 50_000
"""Points of a path in a plane above which every second, third, ... is drawn: a picture shows no
more, and a long run has millions."""
POINTS = 4000
"""Most points of a path in space, where the drawing library does not simplify lines."""
ELEVATION, AZIMUTH = 22.0, -58.0
"""Direction of view of pictures in space: above the horizon and about the vertical [deg]."""

Drawn = tuple[np.ndarray, str, dict[str, Any]]
"""Points (m, 3) [m], label and look of one path."""


def paths(runs: Sequence[Run], bodies: Sequence[str], plane: str = "") -> tuple[str, Figure]:
    """Draw the paths of ``bodies`` (names) in a ``plane``, by default the one that shows most."""
    tracks = list(_tracks(runs, bodies))
    plane = plane or widest_plane(np.concatenate([points for points, _, _ in tracks]))
    i, j = map(AXES.index, plane)
    what = f"paths in the {plane} plane (dot: start)"
    figure, (axes,) = new_figure(1, 5.4, title(runs, what))
    for points, label, look in tracks:
        shown = points[:: max(1, len(points) // POINTS_IN_PLANE)]
        (line,) = axes.plot(shown[:, i], shown[:, j], label=plain(label), **look)
        axes.plot(*points[0, [i, j]], "o", color=line.get_color(), markersize=5)
    axes.set(xlabel=f"{plane[0]} [m]", ylabel=f"{plane[1]} [m]", aspect="equal")
    axes.set_adjustable("datalim")
    axes.margins(0.06)
    if runs[0].model.gravity[j] > 0.0:
        axes.invert_yaxis()
    legend(figure, axes)
    return f"path-{plane}", figure


def paths_in_space(runs: Sequence[Run], bodies: Sequence[str]) -> tuple[str, Figure]:
    """Draw the paths of ``bodies`` in three dimensions, at equal scales, gravity down."""
    tracks = list(_tracks(runs, bodies))
    spans = np.ptp(np.concatenate([points for points, _, _ in tracks]), axis=0)
    vertical = vertical_axis(runs[0])
    # A flat box needs less height.
    tall = min(1.0, float(spans[vertical] / max(spans.max(), 1e-300)))
    figure = Figure(figsize=(8.0, 4.0 + 2.5 * tall))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(projection="3d")
    assert isinstance(axes, Axes3D)
    for points, label, look in tracks:
        shown = points[:: max(1, len(points) // POINTS)]
        (line,) = axes.plot(*shown.T, label=plain(label), **look)
        axes.plot(*points[:1].T, "o", color=line.get_color(), markersize=5)
    limits = np.array([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()])
    ranges = np.ptp(limits, axis=1)
    axes.set_box_aspect(np.maximum(ranges, 1e-3 * ranges.max()), zoom=1.25 - 0.3 * tall)
    axes.view_init(ELEVATION, AZIMUTH, vertical_axis=AXES[vertical])
    if runs[0].model.gravity[vertical] > 0.0:
        getattr(axes, f"invert_{AXES[vertical]}axis")()
    for name in AXES:
        getattr(axes, f"set_{name}label")(f"{name} [m]", labelpad=9.0)
    axes.locator_params(nbins=5)
    figure.suptitle(
        plain(folded(title(runs, "paths (dot: start)"), 80)), x=0.01, ha="left", size=11
    )
    legend(figure, axes)
    return "path3d", figure


def lacks_space(runs: Sequence[Run], bodies: Sequence[str]) -> str:
    """Say why there is no picture in space; empty if paths are spatial."""
    spans = np.ptp(np.concatenate([points for points, _, _ in _tracks(runs, bodies)]), axis=0)
    least, _, most = sorted(spans)
    return "" if least > SPATIAL * most else "the paths lie in a plane; draw them with: path"


def vertical_axis(run: Run) -> int:
    """Return the index of the axis nearest to gravity's; of z where there is none."""
    gravity = np.abs(run.model.gravity)
    return int(gravity.argmax()) if gravity.any() else 2


def widest_plane(points: np.ndarray) -> str:
    """Return the two axes along which ``points`` (n, 3) extend most, in alphabetical order."""
    spans = np.ptp(points, axis=0)
    # Ties (a model at rest, a motion along one line) go to x and z, the pendulum's plane.
    order = sorted(range(3), key=lambda axis: (-spans[axis], axis == 1))
    return "".join(AXES[axis] for axis in sorted(order[:2]))


def _tracks(runs: Sequence[Run], bodies: Sequence[str]) -> Iterator[Drawn]:
    """Yield the paths of ``bodies`` in all runs."""
    labels = run_labels(runs)
    for k, run in enumerate(runs):
        for i, (name, look) in enumerate(zip(bodies, looks(), strict=False)):
            columns = [f"{name}.{axis}" for axis in AXES]
            if not set(columns) <= set(run.states.columns):
                raise ResultError(f"{run.folder}: no body '{name}', which {runs[0].folder} has")
            several = {"color": COLOURS[i % len(COLOURS)], "linestyle": LINES[k % len(LINES)]}
            label = f"{name}, {labels[k]}" if len(runs) > 1 else name
            yield run.states[columns].to_numpy(), label, several if len(runs) > 1 else dict(look)
