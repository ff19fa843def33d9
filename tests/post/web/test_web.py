"""Scripts, styles and data in a page of one file."""

import hashlib
import json
import re
import shutil
import subprocess
from importlib.resources import files

import pytest

from msahl.post import web
from tests.support.browser import Opener, wait_until

VENDORED = json.loads(web.source("vendor.json"))
PAYLOADS = (
    "</script><script>window.hit=1</script>",
    "<!--<script>",
    "<img src=x onerror=window.hit=1>",
    "\u2028window.hit=1//",
    "';window.hit=1;'",
    '" onload="window.hit=1',
    "${window.hit=1}",
    "javascript:window.hit=1",
)


@pytest.mark.parametrize("name", VENDORED)
def test_vendored_files_are_those_described(name: str) -> None:
    for file, digest in VENDORED[name]["sha256"].items():
        assert hashlib.sha256(web.source(file).encode()).hexdigest() == digest
    assert VENDORED[name]["licence"] == "MIT"
    assert "MIT" in web.source(f"{name}.LICENSE")


def test_modules_are_joined_in_the_order_of_their_imports() -> None:
    for entry in sorted(
        file.name
        for file in files("msahl.post.web").iterdir()
        if file.name.endswith(".js") and not file.name.endswith(".min.js")
    ):
        text = web.joined(entry)
        assert not re.search(r"^(import|export)\b", text, re.MULTILINE), entry
        names = re.findall(r"^(?:async )?(?:function\*?|class|const|let) (\w+)", text, re.MULTILINE)
        assert len(names) == len(set(names)), entry


@pytest.mark.slow
def test_joined_modules_are_a_program() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    for file in files("msahl.post.web").iterdir():
        if file.name.endswith(".js"):
            subprocess.run(
                [node, "--check", "--input-type=module", "-"],
                input=web.joined(file.name) if ".min." not in file.name else "",
                text=True,
                check=True,
            )


@pytest.mark.parametrize("end", ["</script>", "</SCRIPT >"])
def test_a_script_that_ends_its_element_is_refused(end: str) -> None:
    with pytest.raises(ValueError, match="script"):
        web.inline_script(f"let a = '{end}'")


def test_data_runs_no_script_and_comes_back(open_page: Opener, tmp_path) -> None:
    script = web.joined("bundles.js") + "window.got = readJson('data');"
    page = tmp_path / "page.html"
    page.write_text(
        '<!DOCTYPE html><meta charset="utf-8">'
        + web.content_policy([script], [])
        + web.json_data("data", PAYLOADS)
        + web.inline_script(script),
        encoding="utf-8",
    )
    opened = open_page(page)
    assert opened.evaluate("window.got") == list(PAYLOADS)
    assert opened.evaluate("window.hit") is None


def test_the_policy_stops_other_scripts(browser, tmp_path) -> None:
    page = tmp_path / "page.html"
    page.write_text(web.content_policy([], []) + "<script>window.hit = 1</script>")
    opened = browser.new_page()
    opened.goto(page.as_uri())
    assert opened.evaluate("window.hit") is None
    assert opened.evaluate("fetch('https://example.org').then(() => 1, () => 0)") == 0
    opened.close()


def test_a_bundle_runs(open_page: Opener, tmp_path) -> None:
    script = web.joined("bundles.js") + (
        "await Promise.all([loadBundle('three'), loadBundle('uplot'), loadBundle('three')]);"
        "window.got = [typeof THREE.WebGLRenderer, typeof uPlot];"
    )
    allowed = [script, web.source("three.min.js"), web.source("uplot.min.js")]
    page = tmp_path / "page.html"
    page.write_text(
        '<!DOCTYPE html><meta charset="utf-8">'
        + web.content_policy(allowed, [])
        + web.bundle("three")
        + web.bundle("uplot")
        + web.inline_script(script),
        encoding="utf-8",
    )
    opened = open_page(page)
    assert wait_until(opened, "window.got") == ["function", "function"]
