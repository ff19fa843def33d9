"""Draw the pictures of docs/elastic.md from equilibria and runs of decks of beams.

    python -m tools.docs.pictures

draws them with those of all other pages; ``python -m tools.docs.beam_pictures`` draws them alone.
"""

import io
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D
from PIL import Image

import msahl

ROOT = Path(__file__).parents[2]
DECKS, IMAGES = ROOT / "decks" / "elastic", ROOT / "docs" / "img"
DPI = 100
COLOURS = 200
"""Colours of a file; fewer make it smaller."""
LOADS = (0.0, 150.0, 300.0, 450.0, 600.0)
"""Forces at the tip of the bend [N]."""
TIP = (47.15009624, 15.68468948, 53.47547800)
"""Of the bend at 600 N, by shooting the exact equations of the rod [m]."""
ELEMENTS = {1: (4, 8, 16, 32), 2: (2, 4, 8, 16), 3: (1, 2, 4, 8), 4: (1, 2, 3, 4, 6)}
"""Numbers of elements for each degree."""
MODES = ("1st flapping", "1st lagging", "2nd flapping", "3rd flapping")
"""Of the blade, in the order of their frequencies."""
PUBLISHED = (
    *((0.0, 3.5160), (1.0, 3.6816), (3.0, 4.7973), (6.0, 7.3604)),
    *((0.0, 22.0345), (1.0, 22.181), (3.0, 23.320), (6.0, 26.809)),
    *((0.0, 61.6972), (1.0, 61.842), (3.0, 62.985), (6.0, 66.684)),
)
"""Speeds and frequencies of flapping [rad/s]: Wright, Smith, Thresher and Wang, 1982."""
INSTANTS = 16
"""Shapes of the free rod."""
POINTS = 200
"""Points at which a line is drawn."""


def nodes_of(row: pd.Series, beam: str) -> np.ndarray:
    """Return the (n, 3) positions of a beam's nodes in a row of ``states.csv``."""
    count = sum(1 for c in row.index if c.startswith(f"{beam}.") and c.endswith(".x"))
    columns = [[f"{beam}.{k}.{axis}" for axis in "xyz"] for k in range(1, count + 1)]
    return np.array([row[names].to_numpy(float) for names in columns])


def shares_of(nodes: np.ndarray) -> np.ndarray:
    """Return the (n,) shares of the length at which nodes are, by their distances."""
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1))])
    return np.asarray(along / along[-1])


def bending(row: pd.Series, beam: str, shares: np.ndarray) -> np.ndarray:
    """Return the bending moment [N m] at ``shares`` from a row of ``beams.csv``."""
    names = [c.rsplit(".", 1)[0] for c in row.index if c.startswith(beam) and c.endswith(".m2")]
    size = [np.hypot(row[f"{name}.m2"], row[f"{name}.m3"]) for name in names]
    return np.interp(shares, [float(name.split("@")[1]) for name in names], size)


def draw_bend(axes: Axes3D) -> Line3DCollection:
    """Draw the bend under growing forces, coloured by its bending moment."""
    share, unloaded = np.linspace(0.0, 1.0, POINTS), None
    for load in LOADS:
        rest = msahl.load(DECKS / "bend45.xml", load=load).equilibrium()
        nodes = nodes_of(rest.frame("states").iloc[0], "Bend")
        unloaded = shares_of(nodes) if unloaded is None else unloaded
        line = np.column_stack([np.interp(share, unloaded, nodes[:, i]) for i in range(3)])
        pieces = np.stack([line[:-1], line[1:]], axis=1)
        moment = bending(rest.frame("beams").iloc[0], "Bend", share[:-1])
        drawn = Line3DCollection(pieces, cmap="viridis", linewidths=3.5)
        drawn.set_array(moment / 1000.0)
        drawn.set_clim(0.0, 30.0)
        axes.add_collection3d(drawn)
        axes.text(*(line[-1] + (2.0, 0.0, 1.0)), f"{load:.0f} N")
    axes.set(xlim=(0, 75), ylim=(0, 45), zlim=(0, 60), xlabel="x [m]", ylabel="y [m]")
    axes.set_yticks([0, 20, 40])
    axes.set_zlabel("z [m]")
    axes.set_box_aspect((75, 45, 60))
    axes.view_init(elev=22.0, azim=-70.0)
    return drawn


def draw_errors(axes: Axes) -> None:
    """Draw the error of the bend's tip against the number of nodes, for each degree."""
    for degree, counts in ELEMENTS.items():
        errors = []
        for n in counts:
            numbers = {"Bend.elements": n, "Bend.degree": degree}
            rest = msahl.load(DECKS / "bend45.xml", **numbers).equilibrium()
            found = np.array([rest[f"Tip.{axis}"] for axis in "xyz"])
            errors.append(np.linalg.norm(found - TIP) / np.linalg.norm(TIP))
        nodes = degree * np.array(counts) + 1
        axes.loglog(nodes, errors, "o-", ms=4, lw=1.2, label=f"degree {degree}, order {2 * degree}")
    axes.set(xlabel="nodes", ylabel="relative error of the tip's position")
    axes.set_xticks([2, 5, 10, 20, 33], labels=["2", "5", "10", "20", "33"])
    axes.minorticks_off()
    axes.grid(alpha=0.3)
    axes.legend(frameon=False)


def draw_shapes(axes: Axes) -> None:
    """Draw the shapes of the free rod at equal intervals of time."""
    states = msahl.load(DECKS / "spaghetti.xml").run(error="off").frame("states")
    end = float(states["time"].iloc[-1])
    colours = ScalarMappable(Normalize(0.0, end), "viridis_r")
    for i in np.linspace(0, len(states) - 1, INSTANTS).round().astype(int):
        nodes = nodes_of(states.iloc[i], "Rod")
        colour = colours.to_rgba(states["time"].iloc[i])
        axes.plot(nodes[:, 0], nodes[:, 1], lw=2.0, color=colour)
    axes.figure.colorbar(colours, ax=axes, label="time [s]", shrink=0.6)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")


def draw_blade(axes: Axes) -> None:
    """Draw the frequencies of the rotating blade over its speed, with published ones."""
    model = msahl.load(DECKS / "blade.xml")
    over = model.modes_over("speed", np.linspace(0.0, 12.0, 13).tolist()).frame
    for mode, name in enumerate(MODES, start=1):
        of = over[over["mode"] == mode]
        axes.plot(of["value"], of["imaginary"], "-", lw=1.4, label=name)
    axes.plot(*zip(*PUBLISHED, strict=True), "o", mfc="none", c="k", ms=6, label="Wright et al.")
    axes.plot([0.0, 12.0], [0.0, 12.0], ":", c="grey", lw=1.0, label="speed")
    axes.set(xlabel="speed [rad/s]", ylabel="frequency [rad/s]", xlim=(0, 12), ylim=(0, 90))
    axes.legend(frameon=False, ncols=2, fontsize=7, loc="upper left")


def save(figure: Figure, name: str) -> None:
    """Write a figure into the pictures of the pages, as a PNG of few colours."""
    raw = io.BytesIO()
    figure.savefig(raw, format="png")
    few = Image.open(raw).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    few.save(IMAGES / f"{name}.png", format="PNG", optimize=True)


def draw_beams() -> None:
    """Write all pictures of beams."""
    with mpl.rc_context({"font.size": 8, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=(6.0, 3.6), dpi=DPI)
        axes = figure.add_axes((-0.02, 0.0, 0.85, 1.0), projection="3d")
        assert isinstance(axes, Axes3D)
        drawn = draw_bend(axes)
        figure.colorbar(drawn, label="bending moment [kN m]", ax=axes, shrink=0.7, pad=0.08)
        save(figure, "beam_bend")
        for name, size, draw in (
            ("beam_errors", (4.8, 3.4), draw_errors),
            ("beam_shapes", (7.2, 2.2), draw_shapes),
            ("beam_blade", (4.8, 3.4), draw_blade),
        ):
            figure = Figure(figsize=size, dpi=DPI, layout="tight")
            draw(figure.add_subplot())
            save(figure, name)


if __name__ == "__main__":
    draw_beams()
