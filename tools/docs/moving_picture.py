"""Make the pictures of the README: mechanisms in motion, and the report on a run.

The viewer and the report are opened in a headless Chromium and photographed; `make readme`.
"""

import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from PIL import Image
from playwright.sync_api import Browser, sync_playwright

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "img"
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
FRAMES, SECONDS = 48, 3.2
PANEL = (300, 290)
"""Width and height of one mechanism in the picture, in pixels."""
VIEWPORT = (1000, 800)
SEEK = "(t) => document.dispatchEvent(new CustomEvent('msahl-seek', {detail: t}))"


class Shot(NamedTuple):
    """A deck, the part of its time that is shown [s], and the part of the view: centre and width,
    relative to the view's width and height."""

    deck: str
    begin: float
    end: float
    x: float
    y: float
    width: float


SHOTS = (
    Shot("machines/engine", 0.1, 0.2, 0.53, 0.47, 0.42),
    Shot("machines/robot", 0.0, 3.0, 0.52, 0.44, 0.5),
    Shot("mechanisms/flyball_governor", 0.0, 3.2, 0.51, 0.5, 0.46),
)
REPORT = "machines/robot"


def main() -> None:
    """Write ``motion.webp`` and ``report.webp`` to ``docs/img``."""
    path = shutil.which("chromium") or shutil.which("google-chrome")
    if path is None:
        sys.exit("no Chromium on this machine: apt-get install chromium")
    with TemporaryDirectory() as folder, sync_playwright() as running:
        browser = running.chromium.launch(executable_path=path, args=FLAGS)
        columns = [_filmed(browser, shot, Path(folder)) for shot in SHOTS]
        frames = [_side_by_side(panels) for panels in zip(*columns, strict=True)]
        frames[0].save(
            IMAGES / "motion.webp",
            save_all=True,
            append_images=frames[1:],
            duration=round(1000 * SECONDS / FRAMES),
            loop=0,
            quality=60,
            method=6,
        )
        _photographed(browser, Path(folder)).save(IMAGES / "report.webp", quality=80, method=6)
        browser.close()


def _run(command: str, *words: str) -> None:
    """Run a command of the environment that runs this program."""
    subprocess.run([str(Path(sys.executable).with_name(command)), *words], cwd=ROOT, check=True)


def _simulated(deck: str, folder: Path) -> Path:
    """Return the folder of a run of the deck."""
    run = folder / Path(deck).name
    if not run.exists():
        _run("msahl", "run", f"decks/{deck}.xml", "-o", str(run), "-q")
    return run


def _filmed(browser: Browser, shot: Shot, folder: Path) -> list[Image.Image]:
    """Return the frames of one mechanism."""
    page_file = folder / "view.html"
    _run("msahl-post", "view", str(_simulated(shot.deck, folder)), "-o", str(page_file))
    page = _opened(browser, page_file, VIEWPORT)
    page.wait_for_selector(".viewer[data-state=ready]")
    frames = []
    for k in range(FRAMES):
        page.evaluate(SEEK, shot.begin + (shot.end - shot.begin) * k / FRAMES)
        page.wait_for_timeout(40)
        frames.append(_cropped(page.locator(".view3d").screenshot(), shot))
    page.close()
    return frames


def _opened(browser: Browser, path: Path, size: tuple[int, int]) -> Any:
    page = browser.new_page(viewport={"width": size[0], "height": size[1]}, color_scheme="light")
    page.goto(path.resolve().as_uri())
    return page


def _cropped(data: bytes, shot: Shot) -> Image.Image:
    image = Image.open(BytesIO(data)).convert("RGB")
    wide = shot.width * image.width
    high = wide * PANEL[1] / PANEL[0]
    x, y = shot.x * image.width, shot.y * image.height
    left, upper = round(x - wide / 2), round(y - high / 2)
    return image.crop((left, upper, left + round(wide), upper + round(high))).resize(
        PANEL, Image.Resampling.LANCZOS
    )


def _side_by_side(panels: tuple[Image.Image, ...]) -> Image.Image:
    frame = Image.new("RGB", (PANEL[0] * len(panels), PANEL[1]))
    for k, panel in enumerate(panels):
        frame.paste(panel, (k * PANEL[0], 0))
    return frame


def _photographed(browser: Browser, folder: Path) -> Image.Image:
    """Return the first screen of a report."""
    run = _simulated(REPORT, folder)
    _run("msahl-post", "report", str(run))
    page = _opened(browser, run / "report" / "report.html", (1100, 1000))
    page.wait_for_selector(".viewer[data-state=ready]")
    page.wait_for_selector(".plot canvas")
    page.evaluate(SEEK, 0.8)
    page.wait_for_timeout(1500)
    return Image.open(BytesIO(page.screenshot())).convert("RGB")


if __name__ == "__main__":
    main()
