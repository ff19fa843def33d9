"""Take the pictures of docs/viewer.md and docs/deck.md: pages in a browser, for a few decks.

Usage: python -m tools.docs.viewer_pictures

Needs Playwright and the system's Chromium (tests/support/browser.py).
"""

import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

from msahl.post.show.deck_page import show_deck
from msahl.post.view import show_run, viewer_page
from tests.support.browser import BROWSERS, FLAGS

ROOT = Path(__file__).parents[2]
IMAGES = ROOT / "docs" / "img"
QUALITY = 88
"""Of the WebP files, up to 100."""


@dataclass(frozen=True)
class Shot:
    """A picture ``name`` of the run of a ``deck`` at a time [s], after ``keys`` were pressed."""

    name: str
    deck: str
    time: float
    keys: str = ""
    theme: str = "light"
    other: tuple[str, ...] = ()  # options of a second run, which is overlaid


SHOTS = (
    Shot("viewer_four_bar", "mechanisms/four_bar", 0.7, "tr"),
    Shot("viewer_robot", "machines/robot", 0.9, "gt", theme="dark"),
    Shot("viewer_governor", "mechanisms/flyball_governor", 2.2, "gtn"),
    Shot("viewer_overlay", "thesis/triple_pendulum_89", 9.2, "gt", other=("--dt", "0.05")),
)


def run(deck: str, folder: Path, *options: str) -> None:
    """Run a deck of the repository."""
    program = Path(sys.executable).with_name("msahl")
    command = [str(program), "run", str(ROOT / "decks" / f"{deck}.xml"), "-q"]
    result = subprocess.run([*command, "-o", str(folder), *options], check=False)
    if result.returncode not in (0, 1):  # 1: the verdict
        raise SystemExit(f"{deck} could not be run")


def take(browser: Any, shot: Shot, folder: Path) -> None:
    """Write docs/img/NAME.webp."""
    folders = [folder / shot.name / Path(shot.deck).name]
    run(shot.deck, folders[0])
    if shot.other:
        folders.append(folder / shot.name / " ".join(shot.other).lstrip("-"))
        run(shot.deck, folders[1], *shot.other)
    path = folder / f"{shot.name}.html"
    path.write_text(viewer_page([show_run(each) for each in folders]), encoding="utf-8")
    viewport = {"width": 1100, "height": 700}
    page = browser.new_page(viewport=viewport, color_scheme=shot.theme)
    page.goto(path.as_uri())
    page.wait_for_selector("[data-state=ready]")
    for key in shot.keys:
        page.keyboard.press(key)
    page.evaluate(
        "t => { const s = document.querySelector('.scrub'); s.value = t;"
        " s.dispatchEvent(new Event('input')); }",
        shot.time,
    )
    save(page, shot.name)


def take_deck(browser: Any, name: str, deck: str, selected: str) -> None:
    """Write docs/img/NAME.webp: what msahl show makes of a deck, with a selected element."""
    with tempfile.NamedTemporaryFile(suffix=".html") as file:
        html = show_deck(ROOT / "decks" / f"{deck}.xml").html
        Path(file.name).write_text(html, encoding="utf-8")
        page = browser.new_page(viewport={"width": 1200, "height": 720})
        page.goto(Path(file.name).as_uri())
        page.wait_for_selector("[data-state=ready]")
        page.click(f".tree .what[title='{selected}']")
        page.mouse.move(0, 0)
        save(page, name)


def save(page: Any, name: str) -> None:
    """Write docs/img/NAME.webp from what a page shows, and close the page."""
    page.wait_for_timeout(500)
    picture = IMAGES / f"{name}.webp"
    with Image.open(BytesIO(page.screenshot())) as image:
        image.convert("RGB").save(picture, quality=QUALITY, method=6)
    page.close()
    print(picture.relative_to(ROOT))


def main() -> None:
    """Take all pictures."""
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        raise SystemExit("no Chromium on this machine")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        for shot in SHOTS:
            take(browser, shot, Path(folder))
        take_deck(browser, "show_engine", "machines/engine", "Rod")
        browser.close()


if __name__ == "__main__":
    main()
