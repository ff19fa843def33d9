"""A headless Chromium of the system, driven by Playwright; tests without one are skipped.

Every test has the fixtures ``browser`` and ``open_page``: tests/conftest.py imports them.
"""

import atexit
import shutil
import time
from collections.abc import Callable, Iterator
from functools import cache
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

PATIENCE = 20.0
"""Seconds to wait for a page on a busy machine."""

Opener = Callable[..., Any]


@cache
def _launched(path: str) -> Any:
    """Return the browser of this process: Playwright can be started once only."""
    from playwright.sync_api import sync_playwright

    playwright = sync_playwright().start()
    opened = playwright.chromium.launch(executable_path=path, args=FLAGS)
    atexit.register(playwright.stop)
    atexit.register(opened.close)  # before the line above: the last registered is called first
    return opened


@pytest.fixture(scope="session")
def browser() -> Any:
    """Return a running browser; nothing is ever downloaded."""
    pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install 'msahl[test]'"
    )
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    return _launched(path)


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


def wait_until(page: Any, expression: str) -> Any:
    """Return the value of an expression of the page as soon as it is true.

    Playwright's own ``wait_for_function`` evaluates texts in the page, which its content policy
    forbids.
    """
    end = time.monotonic() + PATIENCE
    while not (value := page.evaluate(expression)):
        assert time.monotonic() < end, f"{expression} did not become true"
        page.wait_for_timeout(20)
    return value


def next_picture(page: Any) -> None:
    """Wait until what is known now has been drawn: the frame under way and the next one."""
    page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
