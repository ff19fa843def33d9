"""Draw a small picture of every deck, and those of other pages, for the documentation site.

Usage: python -m tools.docs.pictures [--results FOLDER] [DECK...]

Runs each deck (or reads its results from FOLDER/<family>/<deck>) and writes
docs/examples/pictures/<family>/<deck>.png. A picture shows the linkage at a few instants, light to
dark, with the names of its bodies and the paths of their mass centres. Where nothing moves off a
line it shows angular velocities, displacements or velocities against time. The same results give
the same bytes.
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
from msahl.model.model import Model
from msahl.post.linkage.draw import Look, draw_linkage
from msahl.post.linkage.motion import Motion, instants, moves, view
from msahl.post.scene import build_scene
from tools.docs.beam_pictures import draw_beams
from tools.docs.machine_pictures import PANELS, draw_machine

ROOT = Path(__file__).parents[2]
PICTURES = ROOT / "docs" / "examples" / "pictures"
IMAGES = ROOT / "docs" / "img"
SIZE, DPI = (3.6, 2.7), 100
INSTANTS = 5
"""Instants at which the bodies are drawn."""
LOOK = Look(width=1.6, pin=4.5, letters=7.0)
COLOURS = 32
"""Colours of the file; fewer make it smaller."""
MAP_COLOURS = 160
"""Colours of a picture with a scale of colours."""


def draw_motion(axes: Axes, model: Model, states: pd.DataFrame) -> bool:
    """Draw the bodies at a few instants; return False, with nothing drawn, if no point moves off a
    line.
    """
    motion = Motion.of(build_scene(model), states)
    frame, _ = view(motion)
    if not moves(motion, frame):
        return False
    draw_linkage(axes, motion, frame, instants(motion, INSTANTS), LOOK)
    axes.axis("off")
    return True


def draw_against_time(axes: Axes, states: pd.DataFrame) -> None:
    """Draw the angular velocities that are largest, or else displacements or velocities."""
    rates = states[[c for c in states.columns if c.endswith((".wx", ".wy", ".wz"))]]
    places = states[[c for c in states.columns if c.endswith((".x", ".y", ".z"))]]
    values, unit = rates, "angular velocity [rad/s]"
    change = np.ptp(rates.to_numpy(), axis=0).max() * states["time"].iloc[-1]
    if change < 0.01 and np.ptp(places.to_numpy(), axis=0).max() > 1e-9:
        values, unit = places - places.iloc[0], "displacement [m]"
    elif change == 0.0:
        values = states[[c for c in states.columns if c.endswith((".vx", ".vy", ".vz"))]]
        unit = "velocity [m/s]"
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
        raw = io.BytesIO()
        figure.savefig(raw, format="png")
    return packed(Image.open(raw))


def packed(image: Image.Image, colours: int = COLOURS) -> bytes:
    """Return a picture as a PNG of few colours."""
    stream = io.BytesIO()
    few = image.convert("RGB").quantize(colours, dither=Image.Dither.NONE)
    few.save(stream, format="PNG", optimize=True)
    return stream.getvalue()


def draw_pages(folder: Path) -> None:
    """Write the pictures of pages other than the examples, as ``msahl-post plot`` draws them."""
    results = run(ROOT / "decks" / "mechanisms" / "four_bar.xml", folder / "four_bar")
    plot = [sys.executable, "-m", "msahl.post.cli", "plot", str(results), "reactions"]
    subprocess.run([*plot, "--joint", "Motor", "-o", str(folder)], check=True, capture_output=True)
    IMAGES.mkdir(parents=True, exist_ok=True)
    shutil.copyfile(folder / "reactions.png", IMAGES / "four_bar_motor.png")
    linkage = [sys.executable, "-m", "msahl.post.cli", "plot", str(results), "linkage"]
    subprocess.run([*linkage, "-o", str(folder)], check=True, capture_output=True)
    (IMAGES / "four_bar_linkage.png").write_bytes(packed(Image.open(folder / "linkage.png")))
    picture = Image.open(draw_sweep(folder / "sweep"))
    (IMAGES / "sweep_map.png").write_bytes(packed(picture, MAP_COLOURS))
    for name, over in (("bicycle", "v=0:10:81"), ("rotor", "speed=0:600:61")):
        picture = Image.open(draw_modes(name, over, folder / f"modes_{name}"))
        (IMAGES / f"campbell_{name}.png").write_bytes(packed(picture))
    for name in PANELS:
        deck = ROOT / "decks" / "machines" / f"{name}.xml"
        draw_machine(name, run(deck, folder / name))
    draw_beams()


def draw_sweep(folder: Path) -> Path:
    """Return the path of the map of a sweep over length and initial angle of a rod."""
    deck = str(ROOT / "decks" / "basics" / "parameters.xml")
    lists = ["--set", "L=40:120:9 cm", "--set", "start=10:170:9 deg"]
    measure = ["--measure", "Hinge.F absmax", "-q", "-o", str(folder)]
    msahl = [sys.executable, "-c", "from msahl.cli.main import main; main()"]
    subprocess.run([*msahl, "sweep", deck, *lists, *measure], check=False)
    post = [sys.executable, "-m", "msahl.post.cli", "sweep", str(folder)]
    subprocess.run(post, check=True, capture_output=True)
    return folder / "report" / "map-1.png"


def draw_modes(name: str, over: str, folder: Path) -> Path:
    """Return the path of the Campbell diagram of a mechanism's deck."""
    deck = str(ROOT / "decks" / "mechanisms" / f"{name}.xml")
    msahl = [sys.executable, "-c", "from msahl.cli.main import main; main()"]
    words = ["modes", deck, "--over", over, "-q", "-o", str(folder)]
    subprocess.run([*msahl, *words], check=True)
    post = [sys.executable, "-m", "msahl.post.cli", "modes", str(folder)]
    subprocess.run(post, check=True, capture_output=True)
    return folder / "campbell.png"


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
