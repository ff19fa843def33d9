"""Draw the linkage of a motion at a few instants, with joints, ground and labels."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from matplotlib.patheffects import withStroke

from msahl.post.draw import COLOURS, folded, plain, shortened
from msahl.post.linkage.motion import Motion, instants, moves, view
from msahl.post.linkage.parts import GROUND, Parts, Scene, outline
from msahl.post.scene import build_scene
from msahl.post.scene.build import LONG
from msahl.records import record
from msahl.results.read import Run

COUNT = 5
"""Instants of a picture."""
LIGHTEST = 0.22
"""Opacity of the first instant."""
MOST_LABELS = 10
"""Bodies up to which each has its name beside it."""
LONGEST_PATH = 25.0
"""Length of a path, relative to the extent of the picture, up to which it is drawn for the complete
run; else for the time of the instants."""
TIP_UP = 6
"""The library's marker of a triangle with its tip at the point."""
COILS = 6
DAMPER = tuple(
    (np.array(place), np.array(swing))
    for place, swing in (
        ((0.0, 0.15, 0.3), (0.0, 0.0, 0.0)),
        ((0.7, 0.3, 0.3, 0.7), (1.0, 1.0, -1.0, -1.0)),
        ((0.54, 0.54), (0.8, -0.8)),
        ((0.54, 0.85, 1.0), (0.0, 0.0, 0.0)),
    )
)
"""Lines of a damper, its cylinder open to the piston: places along it from 0 to 1, and across."""
SMALL = 0.02
"""Size of an outline, relative to the picture, below which a dot is drawn as well."""


@record(slots=False)
class Look:
    """Widths of lines and sizes of signs and letters in points; ``labels``: whether there are any;
    ``bodies`` to draw, by index (None: all)."""

    width: float = 2.2
    pin: float = 6.0
    letters: float = 9.0
    labels: bool = True
    bodies: tuple[int, ...] | None = None

    def draws(self, body: int) -> bool:
        """Return whether a body is drawn."""
        return self.bodies is None or body in self.bodies


def picture(run: Run, bodies: Sequence[str] = (), plane: str = "") -> tuple[str, Figure]:
    """Return the picture of a run: its ``bodies`` (names; none means all) at a few instants, in a
    ``plane`` ("" means the one that the motion's extent suggests)."""
    scene = build_scene(run.model, run.folder.name)
    motion = Motion.of(scene, run.states)
    frame, plane = view(motion, plane)
    chosen = instants(motion, COUNT)
    names = [body["name"] for body in scene["bodies"]]
    look = Look(bodies=tuple(map(names.index, bodies)) if bodies else None)
    figure = Figure(figsize=(8.0, 6.3))
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    draw_linkage(axes, motion, frame, chosen, look)
    times = ", ".join(f"{motion.time[k]:.3g}" for k in chosen)
    shown = f"at t = {times} s" + (", faint to strong" if len(chosen) > 1 else "")
    axes.set_title(plain(folded(f"{scene['title']}: {shown}", 90)))
    if plane:
        across, up = ("xyz"[int(np.argmax(np.abs(row)))] for row in frame)
        axes.set(xlabel=f"{across} [m]", ylabel=f"{up} [m]")
        if frame[1].min() < -0.5:  # the axis points down
            ticks = axes.get_yticks()
            axes.set_yticks(ticks, [f"{-tick:g}" for tick in ticks])
    else:
        axes.axis("off")
        _triad(axes, frame)
        _scale(axes)
    return "linkage", figure


def lacks_motion(run: Run) -> str:
    """Say why there is no picture of the linkage; empty if there is one."""
    motion = Motion.of(build_scene(run.model), run.states)
    frame, _ = view(motion)
    return "" if moves(motion, frame) else "the bodies move little, or along one line only"


def draw_linkage(
    axes: Axes, motion: Motion, frame: np.ndarray, chosen: np.ndarray, look: Look
) -> None:
    """Draw the bodies of a motion at the ``chosen`` output times, seen in the ``frame`` (2, 3):
    unit vectors to the right and up."""
    shades = np.linspace(LIGHTEST, 1.0, len(chosen)) if len(chosen) > 1 else [1.0]
    _draw_paths(axes, motion, frame, chosen, look)
    _draw_guides(axes, motion, frame, int(chosen[-1]), look)
    size = float(np.ptp(motion.corners().reshape(-1, 3) @ frame.T, axis=0).max())
    for number, (shade, k) in enumerate(zip(shades, chosen, strict=True)):
        pen = Pen(float(shade), number, k == chosen[-1], size)
        for index, part in enumerate(motion.parts):
            if look.draws(index):
                # Later instants lie above earlier ones.
                _draw_body(axes, _in_picture(motion, index, part, k, frame), index, pen, look)
        _draw_beams(axes, motion, frame, int(k), pen, look)
    _draw_springs(axes, motion, frame, int(chosen[-1]), look)
    if len(motion.ground):
        points = motion.ground @ frame.T
        axes.plot(
            *points.T, marker=TIP_UP, ls="", color="0.35", ms=1.4 * look.pin, mew=0, zorder=50
        )
    _draw_pins(axes, motion, frame, int(chosen[-1]), look)
    if look.labels and len(motion.parts) <= MOST_LABELS:
        _label(axes, motion, frame, int(chosen[-1]), look)
    axes.set_aspect("equal", adjustable="datalim")
    axes.margins(0.08)


@record(slots=False)
class Pen:
    """How an instant is drawn: opacity, its place in the order, whether it is the last one, and
    the ``size`` of the picture [m]."""

    shade: float
    order: int
    last: bool
    size: float


@dataclass
class Flat:
    """The parts of one body in the picture: lines, outlines, spokes and dots, each (n, 2)."""

    lines: list[np.ndarray]
    faces: list[np.ndarray]
    spokes: list[np.ndarray]
    dots: list[np.ndarray]


def _in_picture(motion: Motion, body: int, part: Parts, k: int, frame: np.ndarray) -> Flat:
    def flat(points: np.ndarray) -> np.ndarray:
        return np.asarray(motion.placed(body, np.atleast_2d(points), k) @ frame.T)

    return Flat(
        [flat(line) for line in part.lines],
        [outline(flat(face)) for face in part.faces],
        [flat(line) for line in part.spokes],
        [flat(dot) for dot in part.dots],
    )


def _draw_body(axes: Axes, flat: Flat, index: int, pen: "Pen", look: Look) -> None:
    """Draw one body at one instant."""
    colour, above, shade = COLOURS[index % len(COLOURS)], 10 + pen.order, pen.shade
    for face in flat.faces:
        if np.ptp(face, axis=0).max() < SMALL * pen.size:
            axes.plot(
                *face.mean(axis=0), "o", color=colour, ms=look.pin, alpha=shade, mew=0, zorder=above
            )
        if len(face) > 2:
            # Outlines of earlier instants hide little of each other.
            style = {"facecolor": colour, "edgecolor": "none", "alpha": 0.3 if pen.last else 0.06}
            axes.add_patch(Polygon(face, closed=True, zorder=above, **style))
        closed = np.concatenate([face, face[:1]])
        axes.plot(*closed.T, color=colour, lw=0.5 * look.width, alpha=shade, zorder=above)
    for line in flat.spokes:
        axes.plot(*line.T, color=colour, lw=0.5 * look.width, alpha=shade, zorder=above)
    for line in flat.lines:
        axes.plot(
            *line.T, color=colour, lw=look.width, alpha=shade, solid_capstyle="round", zorder=above
        )
    for dot in flat.dots:
        axes.plot(*dot.T, "o", color=colour, ms=look.pin, alpha=shade, mew=0, zorder=above)


def _draw_paths(
    axes: Axes, motion: Motion, frame: np.ndarray, chosen: np.ndarray, look: Look
) -> None:
    """Draw the paths of the bodies' mass centres."""
    for index, body in enumerate(motion.scene["bodies"]):
        if not look.draws(index) or _is_inner(motion.scene, index):
            continue
        track = motion.paths(index, np.array([body["centre"]]))[:, 0] @ frame.T
        length = np.sqrt((np.diff(track, axis=0) ** 2).sum(axis=1)).sum()
        if length > LONGEST_PATH * motion.scene["size"]:
            track = track[: chosen[-1] + 1]
        colour = COLOURS[index % len(COLOURS)]
        axes.plot(*track.T, color=colour, lw=0.3 * look.width, alpha=0.6, zorder=2)


def _is_inner(scene: Scene, index: int) -> bool:
    """Return whether a body is a node of a beam other than its last, or hidden."""
    if scene["bodies"][index]["hidden"]:
        return True
    beam = scene["bodies"][index]["beam"]
    return beam is not None and scene["beams"][beam]["nodes"][-1] != index


def _draw_guides(axes: Axes, motion: Motion, frame: np.ndarray, k: int, look: Look) -> None:
    """Draw the lines along which joints slide: through the joint, as long as the displacement."""
    for joint in motion.scene["joints"]:
        if joint["glyph"] not in ("slide", "cylinder", "thread", "line") or not joint["axis"]:
            continue
        ends = motion.placed(joint["parent"], np.array([joint["parentPoint"]]), k)
        child = motion.paths(joint["child"], np.array([joint["childPoint"]]))[:, 0]
        axis = np.array(joint["axis"])
        if joint["parent"] != GROUND:
            parent = motion.paths(joint["parent"], np.array([joint["parentPoint"]]))[:, 0]
            axes_of_parent = motion.frames[:, joint["parent"]]
            slides = np.einsum("ti,tij,j->t", child - parent, axes_of_parent, axis)
            axis = motion.frames[k, joint["parent"]] @ axis
        else:
            slides = (child - ends[0]) @ axis
        margin = 0.06 * motion.scene["size"]
        along = np.array([slides.min() - margin, slides.max() + margin])[:, None] * axis
        line = (ends + along) @ frame.T
        axes.plot(*line.T, color="0.45", lw=0.4 * look.width, ls=(0, (8, 3, 2, 3)), zorder=3)


def _draw_beams(
    axes: Axes, motion: Motion, frame: np.ndarray, k: int, pen: "Pen", look: Look
) -> None:
    """Draw beams as the lines through their nodes, smooth within each element."""
    for beam in motion.scene["beams"]:
        if not all(look.draws(body) for body in beam["nodes"]):
            continue
        origin = np.zeros((1, 3))
        nodes = np.concatenate([motion.placed(body, origin, k) for body in beam["nodes"]])
        p = beam["degree"]
        parts = [
            np.array(beam["rings"]) @ nodes[e * p : e * p + p + 1]
            for e in range(len(beam["lengths"]))
        ]
        line = np.concatenate(parts) @ frame.T
        axes.plot(
            *line.T, color=beam["colour"], lw=look.width, alpha=pen.shade,
            solid_capstyle="round", zorder=10 + pen.order,
        )  # fmt: skip


def _draw_springs(axes: Axes, motion: Motion, frame: np.ndarray, k: int, look: Look) -> None:
    """Draw springs between two points as zigzags, dampers as cylinders with pistons."""
    for spring in motion.scene["springs"]:
        if spring["glyph"] not in LONG:
            continue
        a, b = (
            motion.placed(spring[end], np.array([spring[f"{end}Point"]]), k)[0] @ frame.T
            for end in "ab"
        )
        along = b - a
        across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-300)
        wide = 0.02 * motion.scene["size"] * across
        # Of a spring with a damper both are drawn beside each other.
        aside = float(spring["glyph"] == "strut")
        drawn = [] if spring["glyph"] == "damper" else [(*_zigzag(), 1.4 * aside)]
        drawn += [] if spring["glyph"] == "coil" else [(*line, -1.4 * aside) for line in DAMPER]
        for place, swing, shift in drawn:
            beside = swing + np.where((place == 0.0) | (place == 1.0), 0.0, shift)
            line = a + place[:, None] * along + beside[:, None] * wide
            axes.plot(*line.T, color="0.35", lw=0.45 * look.width, zorder=40)


def _zigzag() -> tuple[np.ndarray, np.ndarray]:
    """Return the line of a spring: places along it from 0 to 1, and across it from -1 to 1."""
    place = np.concatenate([[0.0], np.linspace(0.15, 0.85, 2 * COILS + 1), [1.0]])
    swing = np.zeros(len(place))
    swing[2:-2] = np.where(np.arange(2 * COILS - 1) % 2, -1, 1)
    return place, swing


def _draw_pins(axes: Axes, motion: Motion, frame: np.ndarray, k: int, look: Look) -> None:
    """Draw joints as circles, at the last instant."""
    for index, part in enumerate(motion.parts):
        if len(part.pins) and look.draws(index):
            points = motion.placed(index, part.pins, k) @ frame.T
            axes.plot(
                *points.T, "o", mfc="white", mec="0.2", mew=0.35 * look.width,
                ms=0.8 * look.pin, zorder=60,
            )  # fmt: skip


def _label(axes: Axes, motion: Motion, frame: np.ndarray, k: int, look: Look) -> None:
    """Write the name of every body beside it, away from the middle of the picture."""
    middles = []
    for index, part in enumerate(motion.parts):
        points = part.points()
        points = points if len(points) else np.array([motion.scene["bodies"][index]["centre"]])
        middles.append(motion.placed(index, points, k).mean(axis=0) @ frame.T)
    centre = np.mean(middles, axis=0)
    near = 0.05 * float(np.ptp(motion.corners().reshape(-1, 3) @ frame.T, axis=0).max())
    for index, middle in enumerate(middles):
        if not look.draws(index) or motion.scene["bodies"][index]["hidden"]:
            continue
        away = middle - centre
        away = away / max(float(np.hypot(*away)), 1e-300)
        shift = 1.2 * look.letters
        # Names of bodies at the same place stand below each other.
        below = sum(np.hypot(*(middle - other)) < near for other in middles[:index])
        axes.annotate(
            plain(shortened(motion.scene["bodies"][index]["name"])),
            middle,
            xytext=(shift * float(away[0]), shift * float(away[1] - below)),
            textcoords="offset points",
            ha="left" if away[0] > 0.3 else "right" if away[0] < -0.3 else "center",
            va="bottom" if away[1] > 0.0 else "top",
            color=COLOURS[index % len(COLOURS)],
            fontsize=look.letters,
            zorder=70,
            path_effects=[withStroke(linewidth=2.5, foreground="white")],
        )


def _triad(axes: Axes, frame: np.ndarray) -> None:
    """Draw the directions of x, y and z in a corner of an oblique view."""
    for axis, name in enumerate("xyz"):
        arrow = {"arrowstyle": "<|-", "color": "0.4", "shrinkA": 0, "shrinkB": 0}
        tip = (26.0 * float(frame[0, axis]), 26.0 * float(frame[1, axis]))
        axes.annotate(
            name, (0.07, 0.09), xytext=tip, xycoords="axes fraction", textcoords="offset points",
            ha="center", va="center", color="0.3", arrowprops=arrow,
        )  # fmt: skip


def _scale(axes: Axes) -> None:
    """Draw a length of 1, 2 or 5 times a power of ten [m] in a corner."""
    axes.autoscale_view()
    width = float(np.diff(axes.get_xlim())[0])
    exact = 0.2 * width
    power = 10.0 ** np.floor(np.log10(exact))
    length = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= exact)
    share = length / width
    bar: dict[str, Any] = {"transform": axes.transAxes, "color": "0.3"}
    axes.plot([0.97 - share, 0.97], [0.03, 0.03], lw=2.0, clip_on=False, **bar)
    axes.text(0.97 - 0.5 * share, 0.045, f"{length:g} m", ha="center", **bar)
