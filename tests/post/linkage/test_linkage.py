"""Linkages at a few instants: parts of bodies, view, instants, and what is drawn."""

import math

import numpy as np
import pandas as pd
import pytest

from msahl.deck import read_deck
from msahl.post.draw import encode, style
from msahl.post.linkage.draw import picture
from msahl.post.linkage.motion import Motion, instants, moves, view
from msahl.post.linkage.parts import outline, parts_of, surface
from msahl.post.scene import build_scene
from msahl.results.read import read_run
from tests.support.models import ROOT
from tests.support.run_folders import write


def scene_of(name):
    return build_scene(read_deck(ROOT / "decks" / f"{name}.xml"))


def swing(scene, amplitude, rows=401):
    """One period of a pendulum about y, as the table of states: x = sin, z = -cos."""
    angle = amplitude * np.cos(np.linspace(0.0, 2.0 * math.pi, rows))
    zero = np.zeros(rows)
    body = scene["bodies"][0]
    (pin,) = (j["childPoint"] for j in scene["joints"])
    length = float(np.linalg.norm(np.subtract(body["centre"], pin)))
    columns = {
        "time": np.linspace(0.0, 1.0, rows),
        "x": length * np.sin(angle), "y": zero, "z": -length * np.cos(angle),
        "P1": zero, "P2": -4.0 * np.tan(angle / 4.0), "P3": zero,
    }  # fmt: skip
    names = {key: key if key == "time" else f"{body['name']}.{key}" for key in columns}
    return pd.DataFrame({names[key]: values for key, values in columns.items()})


def test_a_link_is_the_line_between_its_joints():
    scene = scene_of("mechanisms/four_bar")
    for body, part in zip(scene["bodies"], parts_of(scene), strict=True):
        points = [
            joint[f"{side}Point"]
            for joint in scene["joints"]
            for side in ("parent", "child")
            if scene["bodies"][joint[side]]["name"] == body["name"] and joint[side] >= 0
        ]
        (line,) = part.lines
        np.testing.assert_allclose(sorted(line.tolist()), sorted(points), atol=1e-12)
        assert not part.faces


def test_a_body_of_three_joints_is_a_face_and_a_slider_a_block():
    scene = scene_of("mechanisms/andrews_squeezer")
    faces = {
        body["name"]: len(part.faces[0])
        for body, part in zip(scene["bodies"], parts_of(scene), strict=True)
        if part.faces
    }
    assert faces["K3"] >= 3
    scene = scene_of("machines/cart_pole")
    cart = next(i for i, body in enumerate(scene["bodies"]) if body["name"] == "Cart")
    (block,) = parts_of(scene)[cart].faces
    assert block.shape == (8, 3)


def test_a_mass_centre_beyond_the_joints_has_its_line():
    scene = scene_of("mechanisms/flyball_governor")
    rods = [p for b, p in zip(scene["bodies"], parts_of(scene), strict=True) if "Rod" in b["name"]]
    assert [len(rod.dots) for rod in rods] == [1, 1]


@pytest.mark.parametrize(
    ("kind", "size", "extent"),
    [
        ("box", [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
        ("sphere", [0.5], [1.0, 1.0, 1.0]),
        ("cylinder", [0.5, 3.0], [1.0, 1.0, 3.0]),
        ("cone", [0.5, 3.0], [1.0, 1.0, 3.0]),
        ("capsule", [0.5, 3.0], [1.0, 1.0, 4.0]),
    ],
)
def test_surfaces_have_the_extent_of_their_shapes(kind, size, extent):
    shape = {"kind": kind, "size": size, "position": [1.0, 0.0, 0.0]}
    shape["orientation"] = [1.0, 0.0, 0.0, 0.0]
    # Circles have 40 corners, so they are up to 0.3 % too narrow: 1 - cos(pi / 40).
    np.testing.assert_allclose(np.ptp(surface(shape), axis=0), extent, rtol=4e-3)


def test_outline():
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0.5, 0.5], [0.5, 0.0]], dtype=float)
    assert sorted(map(tuple, outline(square))) == [(0, 0), (0, 1), (1, 0), (1, 1)]
    line = np.array([[0, 0], [1, 1], [2, 2]], dtype=float)
    assert sorted(map(tuple, outline(line))) == [(0, 0), (2, 2)]


def test_a_planar_motion_is_seen_along_its_normal_with_gravity_down():
    scene = scene_of("mechanisms/four_bar")
    n = len(scene["bodies"])
    still = np.repeat(np.eye(3)[None, None], n, axis=1)
    motion = Motion(
        scene, np.zeros(1), np.array([[b["pose"][:3] for b in scene["bodies"]]]), still,
        parts_of(scene), np.zeros((0, 3)),
    )  # fmt: skip
    frame, plane = view(motion)
    assert plane == "xz"
    np.testing.assert_array_equal(frame, [[1, 0, 0], [0, 0, 1]])
    frame, plane = view(motion, "yx")
    assert plane == "yx"
    np.testing.assert_array_equal(frame, [[0, 1, 0], [1, 0, 0]])


def test_instants_divide_the_first_sweep_by_its_path():
    """A pendulum's first half period, from one side to the other, in equal angles."""
    scene = scene_of("thesis/single_pendulum_45")
    amplitude = 0.7
    motion = Motion.of(scene, swing(scene, amplitude))
    frame, _ = view(motion)
    assert moves(motion, frame)
    chosen = instants(motion, 5)
    angles = amplitude * np.cos(2.0 * math.pi * motion.time[chosen])
    assert angles[0] == pytest.approx(amplitude)
    # The sweep ends at 97 % of the full extent, 6 % of the amplitude; a row is at most 0.011 rad.
    assert angles[-1] == pytest.approx(-amplitude, abs=0.08 * amplitude)
    np.testing.assert_allclose(np.diff(angles), np.diff(angles).mean(), atol=0.012)


def test_of_a_mechanism_that_travels_far_the_beginning_is_drawn():
    scene = scene_of("mechanisms/two_pendulums")
    names = [body["name"] for body in scene["bodies"]]
    time = np.linspace(0.0, 1.0, 101)
    still = {f"{n}.{c}": np.zeros(101) for n in names for c in ("x", "y", "z", "P1", "P2", "P3")}
    table = pd.DataFrame({"time": time, **still})
    for name in names:
        table[f"{name}.x"] = 10.0 * scene["size"] * time
    # Four times its size: at 0.4 s, up to a row.
    assert Motion.of(scene, table).time[-1] == pytest.approx(0.4, abs=0.011)


def test_what_hardly_moves_is_no_picture():
    scene = scene_of("thesis/single_pendulum_45")
    motion = Motion.of(scene, swing(scene, 1e-4))
    assert not moves(motion, view(motion)[0])


def test_the_picture_of_a_run(tmp_path):
    run = read_run(write(tmp_path / "run") or tmp_path / "run")
    with style():
        name, figure = picture(run)
        first = encode(figure, "png")
        assert encode(picture(run)[1], "png") == first
    assert name == "linkage"
    assert "Conical & <calm>: at t = 0" in figure.axes[0].get_title(loc="left")
    assert "Bob" in [text.get_text() for text in figure.axes[0].texts]
