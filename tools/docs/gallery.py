"""Make the gallery of the documentation site: the motion of every deck, and a picture of it.

Usage: python -m tools.docs.gallery [--results FOLDER] [DECK...]

Runs each deck (or reads its results from FOLDER/<family>/<deck>) and writes two small files that
are kept in the repository: docs/examples/motions/<family>/<deck>.json, the data of the viewer with
poses that are exact to a pixel or so, and docs/examples/thumbs/<family>/<deck>.webp, what the
viewer shows of it. The pictures need Playwright and the system's Chromium. A deck whose run fails
is shown at its start.

The page that plays all of them, ``player_page``, is made when the site is built: it holds the
viewer once, and takes the motion that its address names (view.html?mechanisms/four_bar).
"""

import argparse
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import orjson
from PIL import Image

import msahl
from msahl.deck import read_deck
from msahl.post.scene import build_scene
from msahl.post.view.poses import Accuracy, choose_keys, pack_poses, poses_of_run
from msahl.post.view.viewer import Shown, viewer_page
from msahl.results.info import ResultError
from msahl.results.sample import read_sample

ROOT = Path(__file__).parents[2]
MOTIONS, THUMBS = (ROOT / "docs" / "examples" / name for name in ("motions", "thumbs"))
ACCURACY = Accuracy(tolerance=3e-4, length=2.0**-12, euler=2.0**-12)
"""Of the poses: a third of a pixel of a picture of a thousand."""
NUMBERS = 9000
"""Most numbers of key poses of a motion, of which each takes about a byte."""
READ = 300_000
"""Numbers that are read from the tables of a run."""
SIZE, QUALITY = (400, 280), 72
"""Of a thumbnail: pixels, and WebP's measure up to 100."""
CENTRE = 0.94
"""Part of the view that a thumbnail shows: the viewer leaves a margin."""
SHOWN = 0.3
"""Time that a thumbnail shows, divided by that of the run."""
DIGITS = 5
POLICY = re.compile(r'<meta http-equiv="Content-Security-Policy"[^>]*>')
DATA = re.compile(r'<script type="application/json" id="viewer">.*?</script>', re.DOTALL)
CHOOSE = """<script>
// The motion that the address names, such as view.html?mechanisms/four_bar.
const chosen = location.search.slice(1);
const script = `<script src="motions/${chosen}.js"></` + "script>";
if (/^[a-z]+\\/[\\w-]+$/.test(chosen)) document.write(script);
</script>"""
PLAY = """<script>
document.querySelector("[data-viewer]").addEventListener("msahl-ready", ({ detail: viewer }) => {
  document.title = viewer.runs[0].scene.title || document.title;
  if (viewer.player.end > 0) viewer.player.play();
});
</script>"""


def player_page() -> str:
    """Return the page that plays the motion which its address names."""
    page = viewer_page([Shown(scene={"title": "msahl"})])
    page = POLICY.sub("", page)  # which forbids other files
    return DATA.sub(lambda _: PLAY + CHOOSE, page)


def as_script(motion: str) -> str:
    """Return the script that gives a motion to the player: a page that was opened from a folder may
    load scripts, but no other files."""
    text = motion.replace("</", "<\\/")
    return (
        'const held = document.createElement("script");\n'
        'held.type = "application/json";\nheld.id = "viewer";\n'
        f"held.textContent = JSON.stringify({text});\n"
        "document.currentScript.after(held);\n"
    )


def motion_of(deck: Path, results: Path) -> dict[str, Any]:
    """Return the data of the viewer: the scene of a deck and the motion of its run."""
    scene, motion = build_scene(read_deck(deck), deck.stem, [deck.parent]), None
    try:
        sample = read_sample(results, READ, READ)
        poses = poses_of_run(sample)
        size = max(2.0 * poses.reach, float(scene["size"]))
        most = NUMBERS // (7 * len(sample.model.bodies))
        keys = choose_keys(poses, size, max(most, 24), ACCURACY)
        if len(keys.rows) > 1:
            motion = pack_poses(poses, keys.rows, ACCURACY) | {"outputs": None}
    except ResultError:
        pass  # the run did not start
    scene["notes"] = []
    # Deformations are mostly smaller than 0.1 % of the motion.
    scene["elastic"] = [
        one | {"carriers": [], "rest": [], "shapes": []} for one in scene["elastic"]
    ]
    run: dict[str, Any] = {
        "name": deck.stem,
        "note": "Poses are shown to about 0.1 % of the motion.",
    }
    run |= {"scene": _rounded(scene), "motion": motion, "columns": None}
    run |= {"modes": None, "isPartial": False}
    return {"isPage": True, "graph": [], "runs": [run]}


def _rounded(value: Any) -> Any:
    """Return data with numbers of few digits."""
    if isinstance(value, dict):
        return {key: _rounded(of) for key, of in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [_rounded(of) for of in value]
    if isinstance(value, float):
        short = float(f"{value:.{DIGITS}g}")
        return int(short) if short.is_integer() and abs(short) < 1e6 else short
    return value


def run(deck: Path, folder: Path) -> Path:
    """Run a deck; return the folder of its results, which is empty if it could not be run."""
    try:
        msahl.load(deck).run(error="off").write(folder)
    except (msahl.DeckError, msahl.StartError) as error:
        print(f"{deck.name}: {error}")
    return folder


def take_pictures(names: Iterable[str]) -> Iterator[str]:
    """Write the thumbnails of motions; yield the names of those that were taken."""
    from playwright.sync_api import sync_playwright

    from tests.support.browser import BROWSERS, FLAGS

    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SystemExit("no Chromium on this machine")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        (Path(folder) / "view.html").write_text(player_page(), encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for name in names:
            script = Path(folder) / "motions" / f"{name}.js"
            script.parent.mkdir(parents=True, exist_ok=True)
            script.write_text(as_script((MOTIONS / f"{name}.json").read_text()), encoding="utf-8")
            _take(browser, f"{(Path(folder) / 'view.html').as_uri()}?{name}", name)
            yield name
        browser.close()


def _take(browser: Any, address: str, name: str) -> None:
    """Write the thumbnail of the motion that an address shows."""
    page = browser.new_page(viewport={"width": SIZE[0] * 5 // 4, "height": SIZE[1] * 5 // 4})
    page.goto(address)
    page.wait_for_selector("[data-state=ready]")
    page.add_style_tag(content=".top, .bar, .gizmo, .overlay { display: none !important; }")
    page.evaluate(
        "part => { const s = document.querySelector('.scrub'); if (!s) return;"
        " s.value = part * window.msahl.end; s.dispatchEvent(new Event('input')); }",
        SHOWN,
    )
    page.keyboard.press("t")  # paths
    page.wait_for_timeout(300)
    picture = THUMBS / f"{name}.webp"
    picture.parent.mkdir(parents=True, exist_ok=True)
    with Image.open(BytesIO(page.screenshot())) as image:
        left, top = ((1.0 - CENTRE) / 2 * side for side in image.size)
        box = (left, top, image.width - left, image.height - top)
        small = image.convert("RGB").resize(SIZE, Image.Resampling.LANCZOS, box)
        small.save(picture, quality=QUALITY, method=6)
    page.close()


def main() -> None:
    """Write the motions and the pictures of the decks given, or of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--results", type=Path, help="read results from FOLDER/<family>/<deck>")
    parser.add_argument("decks", nargs="*", type=Path, help="decks (default: all of decks/)")
    options = parser.parse_args()
    names = []
    for deck in options.decks or sorted((ROOT / "decks").glob("*/*.xml")):
        names.append(f"{deck.resolve().parent.name}/{deck.stem}")
        with tempfile.TemporaryDirectory() as temporary:
            given = options.results and options.results / names[-1]
            motion = motion_of(deck, given or run(deck, Path(temporary) / deck.stem))
        print(names[-1], flush=True)
        path = MOTIONS / f"{names[-1]}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(orjson.dumps(motion) + b"\n")
    for name in take_pictures(names):
        print(f"docs/examples/thumbs/{name}.webp")


if __name__ == "__main__":
    main()
