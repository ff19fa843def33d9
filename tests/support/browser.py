"""A headless Chromium of the system, driven by Playwright; tests without one are skipped.

Import the fixtures ``browser`` and ``open_page`` into a test module (or its conftest.py).
"""

import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
# WebGL by the processor: a machine of tests has no graphics card.
FLAGS = [
    "--no-sandbox",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
]

Opener = Callable[..., Any]


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Return a running browser; nothing is ever downloaded."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install 'msahl[test]'"
    )
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    with playwright.sync_playwright() as running:
        opened = running.chromium.launch(executable_path=path, args=FLAGS)
        yield opened
        opened.close()


@pytest.fixture
def open_page(browser: Any) -> Iterator[Opener]:
    """Return a function that opens a file in a new page; settings are those of a context.

    At the end of the test it fails if a page wrote an error to its console, an exception was not
    caught, or anything but the file itself was asked for.
    """
    contexts, faults = [], []

    def look(message: Any) -> None:
        if message.type == "error":
            faults.append(message.text)

    def request(asked: Any) -> None:
        if not asked.url.startswith(("file:", "data:", "blob:")):
            faults.append(f"asked for {asked.url}")

    def opened(file: Path, **settings: Any) -> Any:
        context = browser.new_context(**settings)
        contexts.append(context)
        page = context.new_page()
        page.on("console", look)
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("request", request)
        page.goto(file.resolve().as_uri())
        return page

    yield opened
    for context in contexts:
        context.close()
    assert faults == []
