"""The skin of an elastic body in a scene moves as the body does."""

import shutil

import numpy as np
import pytest

import msahl
from msahl.algebra.rotation_arrays import matrices
from msahl.post.glb.exported_run import export_run
from msahl.post.scene import build_scene, scene_of_run
from msahl.post.scene.elastic import amplitudes
from msahl.post.view import viewer_page
from msahl.post.view.poses import poses_of_run
from msahl.post.view.viewer import show_run
from msahl.results.sample import read_sample
from tests.post.glb.test_glb import Reader, assert_valid
from tests.support.browser import next_picture, wait_until
from tests.support.models import ROOT

DECK = ROOT / "decks" / "elastic" / "reduced_slider_crank.xml"
SEEK = "t => document.dispatchEvent(new CustomEvent('msahl-seek', {detail: t}))"


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The folder of a run of the slider-crank."""
    written = tmp_path_factory.mktemp("runs") / "crank"
    msahl.load(DECK).run(t_final=0.02, error="off").write(written)
    return written


@pytest.fixture(scope="module")
def sample(folder):
    return read_sample(folder, 10**7, 10**5)


def skin_at(entry, poses):
    """Points (rows, s, 3) of the skin in inertial axes."""
    shapes = np.reshape(entry["shapes"], (len(entry["rest"]), -1, 3))
    own = np.reshape(entry["points"], (-1, 3)) + np.einsum(
        "tj,jsi->tsi", amplitudes(entry, poses), shapes
    )
    frame = poses[:, entry["frame"]]
    return frame[:, None, :3] + np.einsum("tij,tsj->tsi", matrices(frame[:, 3:]), own)


@pytest.mark.slow
def test_amplitudes_of_a_scene_are_those_of_the_table(sample):
    [entry] = scene_of_run(sample)["elastic"]
    found = amplitudes(entry, poses_of_run(sample).values)
    table = sample.tables["amplitudes"][1][:, 1::2]
    assert np.abs(table).max() > 1e-5
    # Differences of places of decimetres.
    assert found == pytest.approx(table, abs=1e-15)


def test_the_skin_moves_with_the_nodes_of_the_interface(sample):
    """The middle of the four corners at a node is the node, as it is computed by joints."""
    [entry] = scene_of_run(sample)["elastic"]
    poses = poses_of_run(sample).values
    points = skin_at(entry, poses)
    rest = np.reshape(entry["points"], (-1, 3))
    bent = 0.0
    for name, x in (("Rod.Pin", 0.0), ("Rod.Middle", 0.15), ("Rod.Wrist", 0.3)):
        body = [one.name for one in sample.model.bodies].index(name)
        middle = points[:, np.abs(rest[:, 0] - x) < 1e-6].mean(axis=1)
        # Shapes are rounded to 5e-6 of amplitudes of 0.1 mm.
        assert middle == pytest.approx(poses[:, body, :3], abs=1e-9)
        straight = poses[:, entry["frame"]]
        along = matrices(straight[:, 3:])[..., 0]
        bent = max(bent, np.abs(middle - straight[:, :3] - x * along).max())
    assert bent > 1e-5  # the test would see a skin that does not deform


def test_a_file_that_is_missing_or_another_is_a_note(sample, tmp_path):
    alone = build_scene(sample.model, "t", [tmp_path])
    assert alone["elastic"] == []
    assert "elastic body 'Rod': parts/rod.npz is not beside the deck" in alone["notes"]
    (tmp_path / "parts").mkdir()
    shutil.copy(DECK.parent / "parts" / "blade.npz", tmp_path / "parts" / "rod.npz")
    other = build_scene(sample.model, "t", [tmp_path])
    assert "elastic body 'Rod': parts/rod.npz is that of another body" in other["notes"]
    (tmp_path / "parts" / "rod.npz").write_text("nothing")
    damaged = build_scene(sample.model, "t", [tmp_path])
    assert any("is no .npz of numbers" in note for note in damaged["notes"])
    rod = [body["name"] for body in alone["bodies"]].index("Rod")
    assert alone["bodies"][rod]["shapes"]  # rods to the nodes of the interface
    assert not scene_of_run(sample)["bodies"][rod]["shapes"]


def test_bodies_that_carry_mass_have_no_shapes(sample):
    hidden = [body for body in scene_of_run(sample)["bodies"] if body["hidden"]]
    assert [body["name"] for body in hidden] == list(sample.model.hidden)
    assert not any(body["shapes"] for body in hidden)


def test_exported_skins_have_the_amplitudes_as_weights(folder, sample, tmp_path):
    (tmp_path / "run.glb").write_bytes(export_run(folder).data)
    reader = Reader(tmp_path / "run.glb")
    node = reader.node("Rod, skin")
    mesh = reader.file.meshes[reader.file.nodes[node].mesh]
    table = sample.tables["amplitudes"][1]
    [primitive] = mesh.primitives
    assert len(primitive.targets) == len(mesh.weights) == table[:, 1::2].shape[1]
    [animation] = reader.file.animations
    [sampler] = [
        animation.samplers[channel.sampler]
        for channel in animation.channels
        if channel.target.path == "weights"
    ]
    times, values = reader.array(sampler.input)[:, 0], reader.array(sampler.output)
    rows = np.searchsorted(table[:, 0], times - 1e-6)  # single precision
    expected = table[rows, 1::2]
    # Single precision of 0.1 mm.
    assert values.reshape(len(times), -1) == pytest.approx(expected, abs=1e-10)
    parent = reader.file.nodes[reader.node("Rod")]
    assert node in parent.children
    assert_valid(tmp_path / "run.glb", tmp_path)


def test_the_viewer_draws_the_skin_deformed(folder, sample, open_page, tmp_path):
    """Its points at a time, in their frame; and a hundred times the displacements by the menu."""
    (tmp_path / "view.html").write_text(viewer_page([show_run(folder)]))
    page = open_page(tmp_path / "view.html", viewport={"width": 1100, "height": 700})
    page.wait_for_selector("[data-state=ready]")
    assert page.locator(".tree", has_text="Rod.Pin").count()
    assert not page.locator(".tree", has_text="Rod.mass").count()
    entry = scene_of_run(sample)["elastic"][0]
    rest = np.array(entry["points"])
    row = int(np.argmax(np.abs(sample.tables["amplitudes"][1][:, 1::2]).max(axis=1)))
    time = sample.time[row]
    shapes = np.reshape(entry["shapes"], (len(entry["rest"]), -1))
    expected = sample.tables["amplitudes"][1][row, 1::2] @ shapes
    moved = {}
    for scale in (1, 100):
        page.locator("select[title^='Draw the deformation']").select_option(str(scale))
        page.evaluate(SEEK, float(time))
        wait_until(page, f"Math.abs(window.msahl.time - {float(time)!r}) < 1e-9")
        next_picture(page)
        found = np.array(page.evaluate("window.msahl.skin()"))
        moved[scale] = (found - rest) / scale
    # Poses are within 1e-6 of the size of the motion, 0.5 m, and so is each of 14 amplitudes.
    assert moved[100] == pytest.approx(expected, abs=4e-6)
    assert moved[1] == pytest.approx(expected, abs=4e-6)
    assert np.abs(expected).max() > 1e-4
