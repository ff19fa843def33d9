"""The viewer in a browser: the motion of a run's folder, and what its controls do."""

import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation_arrays import quaternions
from msahl.cli.main import main as msahl
from msahl.post.cli import main as msahl_post
from msahl.post.view import Shown, show_run, viewer_page
from msahl.post.view.viewer import first_columns
from msahl.results.read import read_run
from tests.post.web.test_web import PAYLOADS
from tests.support import run_folders
from tests.support.browser import Opener, next_picture, wait_until

ROOT = Path(__file__).parents[3]
SCRUB = "t => { const s = document.querySelector('.scrub'); s.value = t;"
SCRUB += " s.dispatchEvent(new Event('input')); }"


@pytest.fixture(scope="module")
def chain(tmp_path_factory) -> Path:
    """A chain of ten bodies, 10 s."""
    folder = tmp_path_factory.mktemp("view") / "chain"
    deck = ROOT / "decks/extreme/long_chain.xml"
    result = CliRunner().invoke(
        msahl, ["run", str(deck), "--t-final", "10", "-q", "-o", str(folder)]
    )
    assert result.exit_code in (0, 1), result.output  # 1: a chaotic motion
    return folder


@pytest.fixture
def pendulum(tmp_path) -> Path:
    run_folders.write(tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def view(open_page: Opener, tmp_path) -> Iterator[Any]:
    """Return a function that opens a viewer of runs."""

    def opened(*shown: Shown, graph: tuple[str, ...] = (), **settings: Any) -> Any:
        path = tmp_path / "view.html"
        path.write_text(viewer_page(shown, graph), encoding="utf-8")
        settings.setdefault("viewport", {"width": 1000, "height": 700})
        page = open_page(path, **settings)
        page.wait_for_selector("[data-state=ready]")
        return page

    return opened


@pytest.fixture
def inside(browser: Any, tmp_path) -> Iterator[Any]:
    """Return a function that opens a viewer of runs, with its objects in ``window.viewer``."""
    pages = []

    def opened(*shown: Shown, graph: tuple[str, ...] = ()) -> Any:
        path = tmp_path / "inside.html"
        path.write_text(viewer_page(shown, graph), encoding="utf-8")
        pages.append(page := browser.new_page())
        page.add_init_script(
            "document.addEventListener('msahl-ready', (e) => (window.viewer = e.detail), true);"
        )
        page.goto(path.as_uri())
        page.wait_for_selector("[data-state=ready]")
        return page

    yield opened
    for page in pages:
        page.close()


def pixels(page: Any) -> np.ndarray:
    """What is seen of the three-dimensional view, as (height, width, 3)."""
    from matplotlib.image import imread

    picture = page.locator(".view3d").screenshot()
    return np.asarray(imread(io.BytesIO(picture)))[..., :3]


def scrub(page: Any, time: float) -> None:
    page.evaluate(SCRUB, time)
    wait_until(page, f"Math.abs(window.msahl.time - {time!r}) < 1e-9")
    next_picture(page)


def test_scrubbing_lands_on_the_poses_of_the_table(view, chain) -> None:
    run = read_run(chain)
    states = run.states.to_numpy()
    page = view(show_run(chain))
    size = np.ptp(states[:, 1::12], axis=0).max()
    bodies = len(run.model.bodies)
    for row in np.random.default_rng(7).integers(0, len(states), 12):
        scrub(page, float(states[row, 0]))
        found = np.array(page.evaluate("window.msahl.poses()"))
        given = states[row, 1:].reshape(bodies, 12)
        assert np.abs(found[:, :3] - given[:, :3]).max() <= 1e-6 * size
        same = np.abs((found[:, 3:] * quaternions(given[:, 3:6])).sum(axis=1))
        # The cosine of half the angle between the two: 1 - angle^2/8.
        assert (1.0 - same).max() <= 1e-12 / 8 + 4e-16
    assert page.evaluate("window.msahl.steps") == states[:, 0].tolist()


def test_ten_bodies_for_ten_seconds_take_less_than_a_megabyte(chain) -> None:
    page = viewer_page([show_run(chain)])
    assert len(page.encode()) <= 1_000_000


def test_the_picture_shows_something_that_moves(view, pendulum) -> None:
    page = view(show_run(pendulum))
    first = pixels(page)
    assert np.ptp(first, axis=(0, 1)).max() > 0.3
    scrub(page, 0.2)
    moved = np.abs(pixels(page) - first).max(axis=2) > 0.1
    assert 0.0005 < moved.mean() < 0.5  # the pendulum, not the view itself
    scrub(page, 0.0)
    assert np.abs(pixels(page) - first).max() < 0.02


def test_keys(view, pendulum) -> None:
    page = view(show_run(pendulum))

    def press(*keys: str) -> float:
        for key in keys:
            page.keyboard.press(key)
        return float(page.evaluate("window.msahl.time"))

    dt = run_folders.DT
    assert press("ArrowRight", "ArrowRight") == pytest.approx(2 * dt)
    assert press("Shift+ArrowRight") == pytest.approx(12 * dt)
    assert press("ArrowLeft") == pytest.approx(11 * dt)
    assert press("End") == pytest.approx(40 * dt)
    assert press("Home") == 0.0
    assert press("-", "-") == 0.0
    assert page.evaluate("window.msahl.speed") == 0.2
    press(*15 * "+")
    assert page.evaluate("window.msahl.speed") == 100
    press(*15 * "-")
    assert page.evaluate("window.msahl.speed") == 0.01
    press("Space")
    assert page.evaluate("window.msahl.isPlaying")
    wait_until(page, "window.msahl.time > 0")
    press("Space")
    assert not page.evaluate("window.msahl.isPlaying")
    for key, text in (("n", "Names"), ("a", "Axes"), ("t", "Paths"), ("r", "Forces")):
        button = page.locator(".switches button", has_text=text)
        assert button.get_attribute("aria-pressed") == "false"
        press(key)
        next_picture(page)
        assert button.get_attribute("aria-pressed") == "true"
    assert page.locator(".overlay .name").first.text_content() == "Bob"
    assert page.locator(".overlay .name").first.is_visible()


def test_after_a_click_the_keys_belong_to_the_viewer(view, pendulum) -> None:
    page = view(show_run(pendulum))
    names = page.locator(".switches button", has_text="Names")
    names.click()
    page.keyboard.press("Space")
    assert page.evaluate("window.msahl.isPlaying")
    next_picture(page)
    assert names.get_attribute("aria-pressed") == "true"
    page.keyboard.press("Space")
    page.keyboard.press("Shift+L")  # as "l": the motion ends
    page.keyboard.press("Space")
    wait_until(page, "!window.msahl.isPlaying")


def test_a_short_motion_is_played_slowly(inside, tmp_path) -> None:
    deck = ROOT / "decks/thesis/single_pendulum_45.xml"
    options = ("--dt", "1e-5", "--t-final", "2e-3", "--error", "off", "-q")
    result = CliRunner().invoke(msahl, ["run", str(deck), *options, "-o", str(tmp_path / "run")])
    assert result.exit_code == 0, result.output
    page = inside(show_run(tmp_path / "run"))
    assert page.evaluate("window.msahl.speed") == 0.01
    ticks = wait_until(page, "viewer.graph.plot?.axes[0]._values")
    assert len(set(ticks)) == len(ticks) > 3


def test_equal_forces_of_two_runs_have_equal_arrows(inside, pendulum, tmp_path) -> None:
    states, reactions = run_folders.conical_rows()
    reactions[:, 1:] *= 3.0
    run_folders.write(tmp_path / "other", states, reactions)
    page = inside(show_run(pendulum), show_run(tmp_path / "other"))
    page.keyboard.press("r")
    tips = "viewer.arrows.map(({ entries }) => entries[0].arrow)"
    tips += ".map(({ heads: [head] }) => head.position.y + 0.5 * 0.035 * head.scale.x * SIZE)"
    size = page.evaluate("viewer.models[0].scene.size")
    wait_until(page, "viewer.arrows[0].entries[0].arrow.shaft.scale.y !== 1")
    first, second = page.evaluate(tips.replace("SIZE", repr(size)))
    assert second == pytest.approx(3.0 * first, rel=1e-3)


def test_a_run_that_stopped_early_says_so(view, pendulum) -> None:
    (pendulum / "states.csv").rename(pendulum / "states.csv.part")
    (pendulum / "reactions.csv").rename(pendulum / "reactions.csv.part")
    page = view(show_run(pendulum))
    assert "stopped early" in page.locator(".titles .warning").text_content()


def test_a_motion_that_is_played_ends_or_begins_again(view, pendulum) -> None:
    page = view(show_run(pendulum))
    page.keyboard.press("l")
    page.keyboard.press("Space")
    wait_until(page, "!window.msahl.isPlaying")
    assert page.evaluate("window.msahl.time === window.msahl.end")


def test_the_graph_has_a_cursor_that_moves_the_time(view, pendulum) -> None:
    page = view(show_run(pendulum), graph=("Bob.x", "Pivot.Fx"))
    page.wait_for_selector(".uplot")
    names = page.locator(".graph-values button span").all_text_contents()
    assert names == ["Bob.x", "Pivot.Fx"]
    over = page.locator(".u-over").bounding_box()
    middle = over["x"] + 0.5 * over["width"], over["y"] + 0.5 * over["height"]
    page.mouse.click(*middle)
    end = page.evaluate("window.msahl.end")
    # Half of the time, to the nearest output time and the nearest pixel.
    assert page.evaluate("window.msahl.time") == pytest.approx(end / 2, abs=1.01 * run_folders.DT)
    at = page.evaluate("window.msahl.time")
    x = run_folders.RADIUS * math.cos(run_folders.OMEGA * at)
    # Four digits are shown, of a value to 1/65535 of the range.
    value = "Number(document.querySelector('.graph-values b').textContent)"
    wait_until(page, f"Math.abs({value} - {x}) < 1e-3")
    page.locator(".graph-head select").select_option("Bob.vx")
    wait_until(page, "document.querySelectorAll('.graph-values button').length === 3")


def test_two_runs_are_overlaid(view, pendulum, tmp_path) -> None:
    states, reactions = run_folders.conical_rows()
    ahead = states.copy()
    ahead[:-4, 1:] = states[4:, 1:]
    run_folders.write(tmp_path / "other", ahead, reactions)
    page = view(show_run(pendulum), show_run(tmp_path / "other"))
    assert page.evaluate("window.msahl.runs") == 2
    scrub(page, 0.1)
    first, second = (page.evaluate(f"window.msahl.poses({run})")[0] for run in (0, 1))
    assert first[:3] == pytest.approx(states[10, 1:4], abs=1e-5)
    assert second[:3] == pytest.approx(states[14, 1:4], abs=1e-5)
    assert page.locator(".run-name").all_text_contents() == ["run", "other"]


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_light_and_dark(view, pendulum, theme) -> None:
    page = view(show_run(pendulum), color_scheme=theme)
    bright = pixels(page)[5:15].mean()
    assert bright > 0.8 if theme == "light" else bright < 0.3
    page.locator("button.theme").click()
    next_picture(page)
    assert (pixels(page)[5:15].mean() > 0.8) == (theme == "dark")


def test_a_phone(view, pendulum) -> None:
    page = view(show_run(pendulum), viewport={"width": 360, "height": 700}, has_touch=True)
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    for part in (".play", ".scrub", ".clock", ".speed", ".view3d", ".buttons > *"):
        box = page.locator(part).last.bounding_box()
        assert box["x"] >= 0
        assert box["x"] + box["width"] <= 360
        assert box["y"] + box["height"] <= 700
    assert page.locator(".view3d").bounding_box()["height"] > 300


def test_a_scene_without_motion(view, pendulum) -> None:
    shown = show_run(pendulum)
    page = view(Shown(shown.scene))
    assert page.locator(".bar").count() == 0
    assert page.evaluate("window.msahl.poses()")[0] == pytest.approx(
        shown.scene["bodies"][0]["pose"], abs=1e-12
    )
    page.keyboard.press("Space")
    assert not page.evaluate("window.msahl.isPlaying")


@pytest.mark.slow
@pytest.mark.parametrize("payload", PAYLOADS)
def test_hostile_names_run_no_script(view, pendulum, payload) -> None:
    shown = show_run(pendulum)
    scene = dict(shown.scene, title=payload)
    for kind in ("bodies", "joints"):
        scene[kind] = [dict(entry, name=payload) for entry in scene[kind]]
    columns = dict(shown.columns, names=[f"{payload}.x", *shown.columns["names"][1:]])
    page = view(Shown(scene, payload, payload, shown.motion, columns), graph=(f"{payload}.x",))
    page.keyboard.press("n")
    page.keyboard.press("?")
    page.mouse.move(600, 250)
    page.wait_for_timeout(50)
    assert page.evaluate("window.hit") is None
    assert page.locator(".tree li .what").first.text_content() == payload


@pytest.mark.slow
def test_a_picture_and_a_film_are_saved(view, pendulum, tmp_path) -> None:
    page = view(show_run(pendulum))
    with page.expect_download() as waiting:
        page.keyboard.press("p")
    picture = Path(waiting.value.path()).read_bytes()
    assert picture.startswith(b"\x89PNG")
    assert waiting.value.suggested_filename == "Conical_calm__0.000s.png"
    with page.expect_download() as waiting:
        page.locator("button[title^='Save a film']").click()
    assert Path(waiting.value.path()).read_bytes().startswith(b"\x1aE\xdf\xa3")  # EBML


def test_without_webgl_the_page_says_so(browser, pendulum, tmp_path) -> None:
    path = tmp_path / "view.html"
    path.write_text(viewer_page([show_run(pendulum)]), encoding="utf-8")
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null;")
    page.goto(path.as_uri())
    page.wait_for_selector("[data-state=failed]")
    assert "needs WebGL 2" in page.locator(".viewer").text_content()
    page.close()


def test_the_command_writes_a_file(pendulum, tmp_path) -> None:
    run = CliRunner().invoke(msahl_post, ["view", str(pendulum)])
    assert (run.exit_code, run.output.strip()) == (0, str(pendulum / "view.html"))
    assert (pendulum / "view.html").read_text(encoding="utf-8").startswith("<!DOCTYPE html>")
    run = CliRunner().invoke(msahl_post, ["view", str(pendulum), "--graph", "Bob.x,Bob.nothing"])
    assert (run.exit_code, "no column 'Bob.nothing'" in run.output) == (2, True)
    run = CliRunner().invoke(msahl_post, ["view", str(pendulum), "-o", str(tmp_path)])
    assert (run.exit_code, f"{tmp_path}: Is a directory" in run.output) == (4, True)
    assert not tmp_path.with_name(f"{tmp_path.name}.part").exists()
    run = CliRunner().invoke(msahl_post, ["view", str(tmp_path)])
    assert (run.exit_code, "not the folder of a run" in run.output) == (2, True)


def test_a_row_of_the_list_selects_an_element(view, pendulum) -> None:
    page = view(show_run(pendulum))
    page.evaluate(
        "document.querySelector('.viewer').addEventListener('msahl-selected',"
        " (event) => (window.told = event.detail))"
    )
    page.locator(".tree .what", has_text="Pivot").click()
    assert page.evaluate("window.told") == {"kind": "joint", "name": "Pivot"}
    page.wait_for_selector(".tree li.selected")
    assert "Pivot" in page.locator(".tree li.selected").text_content()
    page.keyboard.press("Escape")
    assert page.evaluate("window.told") is None


def test_the_graph_shows_markers_before_the_nodes_of_a_beam():
    names, tables = ["Bar.2.z", "Tip.x", "Tip.z", "Tip.vz"], ["states", *["markers"] * 3]
    packed = {"names": names, "units": ["m", "m", "m", "m/s"], "tables": tables}
    assert first_columns(packed | {"step": [1e-9, 0.0, 1e-9, 1e-9]}) == ["Tip.z"]
