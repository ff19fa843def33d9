"""Draw a small picture of every deck, and those of other pages, for the documentation site.

Usage: python -m tools.docs.pictures [--results FOLDER] [DECK...]

Runs each deck (or reads its results from FOLDER/<family>/<deck>) and writes
docs/examples/pictures/<family>/<deck>.png. A picture shows the bodies at equal intervals of time,
as lines from the mass centre to the attachment points, light to dark, and the paths of their
reference points. Where nothing moves off a line it shows angular velocities or displacements
against time. The same results give the same bytes.
"""

import argparse
import io
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image

from msahl.deck import read_deck
from msahl.model.bodies import RigidBody
from msahl.model.model import Model
from tools.docs.machine_pictures import PANELS, draw_machine

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "examples" / "pictures"
IMAGES = ROOT / "docs" / "img"
SIZE, DPI = (3.6, 2.7), 100
INSTANTS = 11
"""Instants at which the bodies are drawn."""
SHARE = 0.61
"""Share of the run over which these are spread; periods of decks do not divide it."""
COLOURS = 24
"""Colours of the file; fewer make it smaller."""

Points = dict[str, np.ndarray]
"""Attachment points (n, 3) [m] by body, from the reference point B in body axes."""


def attachment_points(model: Model) -> tuple[Points, np.ndarray]:
    """Return the points of each body at which joints and loads act, with its mass centre, and
    those of the ground.
    """
    points: dict[str, list[tuple[float, ...]]] = {
        body.name: [body.r_BG] for body in model.bodies if isinstance(body, RigidBody)
    }
    ground: list[tuple[float, ...]] = []
    for part in [*model.joints, *model.loads]:
        for end, place in (("parent", "parent_point"), ("child", "child_point"), ("body", "point")):
            name, point = getattr(part, end, None), getattr(part, place, None)
            if point is not None:
                points.get(str(name), ground).append(point)
    arrays = {name: np.unique(np.array(each), axis=0) for name, each in points.items()}
    return arrays, np.array(ground or np.zeros((0, 3)))


def rotations(parameters: np.ndarray) -> np.ndarray:
    """Return the matrices (n, 3, 3) from body to inertial axes of Wiener-Milenkovic parameters."""
    p0 = 2.0 - (parameters * parameters).sum(axis=1)[:, None, None] / 8.0
    cross = np.zeros((len(parameters), 3, 3))
    x, y, z = parameters.T
    cross[:, 0, 1], cross[:, 0, 2], cross[:, 1, 2] = -z, y, -x
    cross -= cross.transpose(0, 2, 1)
    return np.eye(3) + (2.0 * p0 * cross + 2.0 * cross @ cross) / (4.0 - p0) ** 2


def projection(places: np.ndarray) -> np.ndarray:
    """Return the matrix (2, 3) of the view: along an axis if the motion is planar, else oblique."""
    extent = np.ptp(places, axis=0)
    axis = int(np.argmin(extent))
    if extent[axis] < 0.05 * extent.max():
        across = [i for i in range(3) if i != axis]
        return np.eye(3)[across]
    azimuth, elevation = np.radians(-55.0), np.radians(20.0)
    right = [-np.sin(azimuth), np.cos(azimuth), 0.0]
    up = [
        -np.sin(elevation) * np.cos(azimuth),
        -np.sin(elevation) * np.sin(azimuth),
        np.cos(elevation),
    ]
    return np.array([right, up])


def draw_motion(axes: Axes, model: Model, states: pd.DataFrame) -> bool:
    """Draw bodies and paths; return False, with nothing drawn, if no point moves off a line."""
    points, ground = attachment_points(model)
    origins = {name: states[[f"{name}.{c}" for c in "xyz"]].to_numpy() for name in points}
    frames = {
        name: rotations(states[[f"{name}.P{i}" for i in (1, 2, 3)]].to_numpy()) for name in points
    }
    places = {
        name: origins[name][:, None] + np.einsum("tij,kj->tki", frames[name], points[name])
        for name in points
    }
    everything = np.concatenate([each.reshape(-1, 3) for each in [*places.values(), ground]])
    moved = max(np.ptp(each, axis=0).max() for each in places.values())
    view = projection(everything)
    extent = np.ptp(everything @ view.T, axis=0)
    if extent.min() < 0.03 * extent.max() or moved < max(1e-3 * extent.max(), 1e-9):
        return False
    instants = np.unique(np.linspace(0, SHARE * (len(states) - 1), INSTANTS).astype(int))
    for number, name in enumerate(points):
        colour = f"C{number % 6}"
        path = origins[name] @ view.T
        axes.plot(*path.T, color=colour, lw=0.5, alpha=0.5, zorder=1)
        for shade, k in zip(np.linspace(0.2, 1.0, len(instants)), instants, strict=True):
            centre = origins[name][k] + frames[name][k] @ np.array(mass_centre(model, name))
            for place in places[name][k]:
                line = np.array([centre, place]) @ view.T
                axes.plot(
                    *line.T, color=colour, lw=1.2, alpha=shade, solid_capstyle="round", zorder=2
                )
            size = 5 if len(places[name][k]) > 1 else 9
            axes.plot(*(view @ centre), ".", color=colour, ms=size, alpha=shade, mew=0, zorder=3)
    if len(ground):
        axes.plot(*(ground @ view.T).T, "^", color="0.3", ms=4, mew=0, zorder=4)
    axes.set_aspect("equal", adjustable="datalim")
    axes.axis("off")
    return True


def mass_centre(model: Model, name: str) -> tuple[float, float, float]:
    """Return the mass centre of the body [m], from B in body axes."""
    (body,) = [each for each in model.bodies if isinstance(each, RigidBody) and each.name == name]
    return body.r_BG


def draw_against_time(axes: Axes, states: pd.DataFrame) -> None:
    """Draw the angular velocities that are largest, or else the displacements that are."""
    rates = states[[c for c in states.columns if c.endswith((".wx", ".wy", ".wz"))]]
    places = states[[c for c in states.columns if c.endswith((".x", ".y", ".z"))]]
    values, unit = rates, "[rad/s]"
    change = np.ptp(rates.to_numpy(), axis=0).max() * states["time"].iloc[-1]
    if change < 0.01 and np.ptp(places.to_numpy(), axis=0).max() > 1e-9:
        values, unit = places - places.iloc[0], "displacement [m]"
    sizes = values.abs().max().sort_values(ascending=False)
    for column in sorted(sizes.index[: max(1, (sizes > 0.01 * sizes.iloc[0]).sum())][:3]):
        axes.plot(states["time"], values[column], lw=0.9, label=column)
    axes.ticklabel_format(useOffset=False)
    top = 1.2 * sizes.iloc[0] or 1.0
    if np.ptp(values.to_numpy(), axis=0).max() < 1e-3 * top:
        axes.set_ylim(-top if values.to_numpy().min() < 0.0 else 0.0, top)
    axes.set_xlabel("time [s]")
    axes.set_ylabel(unit)
    axes.legend(frameon=False)


def draw(deck: Path, results: Path) -> bytes | None:
    """Return the picture of a deck from the tables of its run, as a PNG of few colours; None if
    nothing moves.
    """
    states = pd.read_csv(results / "states.csv")
    states = states.iloc[:: max(1, len(states) // 1000)]
    if np.ptp(states.drop(columns="time").to_numpy(), axis=0).max() < 1e-9:
        return None
    with mpl.rc_context({"font.size": 7, "axes.spines.top": False, "axes.spines.right": False}):
        figure = Figure(figsize=SIZE, dpi=DPI, layout="tight")
        axes = figure.add_subplot()
        if not draw_motion(axes, read_deck(deck), states):
            draw_against_time(axes, states)
        raw, packed = io.BytesIO(), io.BytesIO()
        figure.savefig(raw, format="png")
    image = Image.open(raw).convert("RGB").quantize(COLOURS, dither=Image.Dither.NONE)
    image.save(packed, format="PNG", optimize=True)
    return packed.getvalue()


def draw_pages(folder: Path) -> None:
    """Write the pictures of pages other than the examples, as ``msahl-post plot`` draws them."""
    results = run(ROOT / "decks" / "mechanisms" / "four_bar.xml", folder / "four_bar")
    plot = [sys.executable, "-m", "msahl.post.cli", "plot", str(results), "reactions"]
    subprocess.run([*plot, "--joint", "Motor", "-o", str(folder)], check=True, capture_output=True)
    IMAGES.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "reactions.png", IMAGES / "four_bar_motor.png")
    for name in PANELS:
        deck = ROOT / "decks" / "machines" / f"{name}.xml"
        draw_machine(name, run(deck, folder / name))


def run(deck: Path, folder: Path) -> Path:
    """Run a deck; return the folder of its results."""
    msahl = [sys.executable, "-c", "from msahl.cli.main import main; main()"]
    options = [str(deck), "-q", "--error", "off", "-o", str(folder)]
    subprocess.run([*msahl, "run", *options], check=False)
    return folder


def main(arguments: Iterable[str] | None = None) -> None:
    """Write the pictures of the decks given, or of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--results", type=Path, help="read results from FOLDER/<family>/<deck>")
    parser.add_argument("decks", nargs="*", type=Path, help="decks (default: all of decks/)")
    options = parser.parse_args(None if arguments is None else list(arguments))
    if not options.decks:
        with tempfile.TemporaryDirectory() as temporary:
            draw_pages(Path(temporary))
    for deck in options.decks or sorted((ROOT / "decks").glob("*/*.xml")):
        family, name = deck.resolve().parent.name, deck.stem
        with tempfile.TemporaryDirectory() as temporary:
            given = options.results and options.results / family / name
            results = given or run(deck, Path(temporary) / name)
            picture = PICTURES / family / f"{name}.png"
            picture.parent.mkdir(parents=True, exist_ok=True)
            picture.unlink(missing_ok=True)
            if drawn := draw(deck, results):
                picture.write_bytes(drawn)


if __name__ == "__main__":
    main()
