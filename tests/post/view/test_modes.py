"""Modes in the viewer: the poses of a period, the chooser, the amplitude."""

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.analysis.linearised.point import at_start
from msahl.analysis.modes.solution import modes
from msahl.cli.main import main as msahl
from msahl.post.view import viewer_page
from msahl.post.view.modes import show_modes
from tests.analysis.modes.test_modes import free_bodies_at_rest, hanging
from tests.support.browser import next_picture, wait_until
from tests.support.models import ROOT

BICYCLE = ROOT / "decks/mechanisms/bicycle.xml"


def rotation_of(quaternion):
    w, v = quaternion[0], np.array(quaternion[1:])
    K = np.cross(np.eye(3), v)
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K


def test_poses_are_those_of_the_shape_in_its_phase(open_page, tmp_path):
    point = at_start(hanging(3))
    found = modes(point)
    shown = show_modes(point, found, tmp_path / "chain.xml")
    (tmp_path / "modes.html").write_text(viewer_page([shown]))
    page = open_page(tmp_path / "modes.html", viewport={"width": 1000, "height": 700})
    page.wait_for_selector("[data-state=ready]")
    page.keyboard.press("Space")
    wait_until(page, "!window.msahl.isPlaying")
    page.keyboard.press("PageDown")
    wait_until(page, "window.msahl.mode === 1")
    page.evaluate("const s = document.querySelector('.amplitude'); s.value = 0.5; "
                  "s.dispatchEvent(new Event('input'));")  # fmt: skip
    page.evaluate("const s = document.querySelector('.scrub'); s.value = 0.25; "
                  "s.dispatchEvent(new Event('input'));")  # fmt: skip
    wait_until(page, "Math.abs(window.msahl.time - 0.25) < 1e-9")
    next_picture(page)
    # An eighth of a period, with the square of half the slider of half the scene's size.
    amplitude = 0.5 * shown.scene["size"] * 0.25
    moved = amplitude * (found.shape[1] * np.exp(0.25j * np.pi)).real
    for body, pose, part in zip(point.model.bodies, page.evaluate("window.msahl.poses()"), moved,
                                strict=True):  # fmt: skip
        # Shapes are rounded to 2^-20 of their largest part.
        assert np.abs(np.array(pose[:3]) - body.position - part[:3]).max() <= 3e-6
        angle = float(np.linalg.norm(part[3:]))
        expected = np.array(matrix(from_axis_angle(tuple((part[3:] / angle).tolist()), angle)))
        assert np.abs(rotation_of(pose[3:]) - expected).max() <= 3e-6
    assert page.locator("select.mode option").count() == 3
    page.locator(".mode-facts", has_text=f"{found.frequency[1]:.9g} Hz").wait_for()
    page.locator(".clock", has_text="45° of a period").wait_for()


def test_the_motion_plays_and_its_paths_follow_the_mode(open_page, tmp_path):
    folder = tmp_path / "bicycle"
    words = ["modes", str(BICYCLE), "--set", "v=4", "-q", "--page", "-o", str(folder)]
    result = CliRunner().invoke(msahl, words)
    assert result.exit_code == 0, result.output
    assert result.output.strip().endswith("modes.html")
    page = open_page(folder / "modes.html", viewport={"width": 1000, "height": 700})
    page.wait_for_selector("[data-state=ready]")
    assert page.evaluate("window.msahl.isPlaying")
    # The page opens on the weave, not on the capsize mode, which is slower.
    page.locator(".mode-facts", has_text="damping ratio").wait_for()
    before = page.evaluate("window.msahl.time")
    wait_until(page, f"window.msahl.time !== {before!r}")
    page.keyboard.press("t")
    page.locator("select.mode").select_option("2")
    wait_until(page, "window.msahl.mode === 2")
    page.locator(".mode-facts", has_text="decays without oscillation").wait_for()
    # Three modes beside those that are zero.
    assert page.locator("select.mode option").count() == 3


def test_rigid_body_modes_alone_make_no_page(tmp_path):
    point = at_start(free_bodies_at_rest())
    with pytest.raises(ValueError, match="no mode moves a body"):
        show_modes(point, modes(point), tmp_path / "free.xml")


def test_a_page_needs_a_folder():
    for more in (["--page"], ["--page", "--over", "v=1,2", "-o", "x"]):
        result = CliRunner().invoke(msahl, ["modes", str(BICYCLE), *more])
        assert result.exit_code == 2
        assert "--page" in result.output
