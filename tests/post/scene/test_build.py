"""The scene of a model: its format, its derived shapes, its elements."""

import itertools
import json
from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation_arrays import matrices, rotations
from msahl.deck import read_deck
from msahl.post.scene import build_scene
from msahl.post.scene.derived import equivalent_solid, wheel_radii
from msahl.post.scene.geometry import along, quaternion, smallest_rotation
from tests.support.models import DECKS, ROOT

POINTS = {"parent": "parentPoint", "child": "childPoint", "a": "aPoint", "b": "bPoint"}
UNIT = 1e-14  # norms and products of three doubles


def scene_of(name):
    return build_scene(read_deck(ROOT / "decks" / name))


def inertia(shape, mass):
    """Tensor about the middle (3, 3) of a uniform solid, in the axes of its body."""
    kind, size = shape["kind"], shape["size"]
    if kind == "sphere":
        moments = [0.4 * mass * size[0] ** 2] * 3
    elif kind == "box":
        squares = np.square(size)
        moments = mass * (squares.sum() - squares) / 12
    else:
        radius, length = size
        across = mass * (3 * radius**2 + length**2) / 12
        moments = [across, across, 0.5 * mass * radius**2]
    R = matrices(shape["orientation"])
    return R @ np.diag(moments) @ R.T


@pytest.mark.parametrize("deck", DECKS, ids=lambda path: path.stem)
def test_scene_of_every_deck_is_complete_json(deck):
    model = read_deck(deck)
    scene = json.loads(json.dumps(build_scene(model), allow_nan=False))
    assert [b["name"] for b in scene["bodies"]] == [b.name for b in model.bodies]
    names = [j.name for j in model.joints] + [c.name for c in model.couplings]
    assert [j["name"] for j in scene["joints"]] == names
    assert len(scene["springs"]) + len(scene["loads"]) == len(model.loads)
    assert all(body["shapes"] or body["beam"] is not None for body in scene["bodies"])
    assert [beam["name"] for beam in scene["beams"]] == [beam.name for beam in model.beams]
    assert scene["size"] > 0
    low, high = np.array(scene["extent"])
    for index, record in enumerate(model.bodies):
        x, q = scene["bodies"][index]["pose"][:3], scene["bodies"][index]["pose"][3:]
        assert np.allclose(matrices(q), rotations(np.array(record.orientation)), rtol=0, atol=UNIT)
        centre = matrices(q) @ record.r_BG + x
        assert np.all(low - 1e-9 <= centre)
        assert np.all(centre <= high + 1e-9)
    for entry in scene["joints"] + scene["springs"]:
        for side, point in POINTS.items():
            if side in entry:
                assert -1 <= entry[side] < len(model.bodies)
                assert len(entry[point]) == 3


@pytest.mark.parametrize("deck", DECKS, ids=lambda path: path.stem)
def test_equivalent_solids_have_the_inertia_of_the_body(deck):
    for body in read_deck(deck).bodies:
        J = np.array(body.inertia)
        solid = equivalent_solid(body)
        # Moments that differ by less than 1e-6 of the largest count as equal.
        assert np.allclose(inertia(solid, body.mass), J, rtol=0, atol=2e-6 * np.abs(J).max())
        assert solid["position"] == list(body.r_BG)


def test_principal_axes_of_a_rotated_tensor():
    scene = scene_of("machines/satellite.xml")
    bus = next(body for body in scene["bodies"] if body["name"] == "Bus")
    box = next(shape for shape in bus["shapes"] if shape["kind"] == "box")
    assert box["orientation"][0] > 0.9  # of the possible axes those near the body's


def test_links_join_the_mass_centre_and_the_joints():
    far = scene_of("thesis/double_pendulum_45.xml")["bodies"][0]
    assert [shape["kind"] for shape in far["shapes"]] == ["sphere", "rod"]
    rod = far["shapes"][1]
    ends = [np.array(rod["position"]) + s * rod["size"][1] * matrices(rod["orientation"])[:, 2]
            for s in (-0.5, 0.5)]  # fmt: skip
    centre = min(np.linalg.norm(end - far["centre"]) for end in ends)
    assert centre < 1e-12  # of a length of 5 m


def test_bodies_that_roll_have_the_radius_of_the_joint():
    disk = scene_of("joints/rolling_disk.xml")["bodies"][0]["shapes"][0]
    assert (disk["kind"], disk["size"][0], disk["derived"]) == ("disc", 0.5, True)
    ball = scene_of("joints/spherical_slider.xml")["bodies"][0]["shapes"][0]
    assert (ball["kind"], ball["size"]) == ("sphere", [0.15])


def test_gears_touch():
    scene = scene_of("joints/gear.xml")
    discs = [body["shapes"][0]["size"][0] for body in scene["bodies"]]
    (gear,) = [joint for joint in scene["joints"] if joint["kind"] == "gear"]
    assert discs[0] == pytest.approx(abs(gear["parameters"]["ratio"]) * discs[1])
    assert sum(discs) == pytest.approx(0.3)  # the distance of the axes
    pinion = scene_of("joints/rack_and_pinion.xml")
    (rack,) = [joint for joint in pinion["joints"] if joint["kind"] == "rackAndPinion"]
    assert pinion["bodies"][0]["shapes"][0]["size"][0] == rack["parameters"]["ratio"]
    assert wheel_radii(2.0, 0.5) == (1.0, 0.5)  # the second within the first
    assert wheel_radii(1.0, 0.5) is None
    assert wheel_radii(-2.0, 0.0) is None


def test_a_sphere_of_a_link_is_no_larger_than_the_link():
    scene = scene_of("extreme/toggle.xml")
    crank = scene["bodies"][0]["shapes"]
    assert crank[0]["kind"] == "sphere"
    assert crank[0]["size"][0] <= 0.3 * crank[1]["size"][1] + 1e-12


def test_elements_of_a_car():
    scene = scene_of("mechanisms/suspension.xml")
    index = {body["name"]: i for i, body in enumerate(scene["bodies"])}
    tyre = next(spring for spring in scene["springs"] if spring["name"] == "FL.Tyre")
    assert (tyre["a"], tyre["b"], tyre["glyph"]) == (-1, index["FL.Wheel"], "coil")
    assert [joint["glyph"] for joint in scene["joints"]] == ["slide"] * 4
    assert scene["up"] == [0, 0, 1]
    assert scene["normal"] is None


def test_a_planar_mechanism_has_a_normal():
    assert scene_of("mechanisms/four_bar.xml")["normal"] == [0, 1, 0]
    assert scene_of("mechanisms/bricard.xml")["normal"] is None


def test_couplings_follow_the_joints():
    scene = scene_of("joints/gear.xml")
    *joints, gear = scene["joints"]
    assert gear["glyph"] == "gear"
    assert [joints[i]["child"] for i in gear["joints"]] == [gear["parent"], gear["child"]]


def test_loads_keep_their_axes():
    scene = scene_of("basics/loads.xml")
    assert all(load["kind"] == "force" for load in scene["loads"])
    for load in scene["loads"]:
        assert load["force"] or load["moment"]


def test_a_rotation_and_its_quaternion():
    random = np.random.default_rng(5)
    for vector in itertools.chain(np.eye(3), -np.eye(3), random.normal(size=(20, 3))):
        R = along(vector)
        assert np.allclose(R @ R.T, np.eye(3), rtol=0, atol=UNIT)
        assert np.linalg.det(R) > 0
        assert np.allclose(R[:, 2], vector / np.linalg.norm(vector), rtol=0, atol=UNIT)
        assert np.allclose(matrices(quaternion(R)), R, rtol=0, atol=UNIT)


@pytest.mark.parametrize("after", [(0, 1, 0), (0.6, 0, -0.8)])
@pytest.mark.parametrize("before", [(0, 0, 1), (0, 0, -1), (0, 1, 0), (0, -1, 0), (-0.6, 0, 0.8)])
def test_smallest_rotation(before, after):
    q = smallest_rotation(before, after)
    R = matrices(q)
    assert np.allclose(R @ before, after, rtol=0, atol=1e-15)
    assert np.allclose(R @ R.T, np.eye(3), rtol=0, atol=1e-15)
    assert np.allclose(q[0] ** 2, 0.5 * (1 + np.dot(before, after)), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("stiffness", "damping", "glyphs"),
    [
        (3.0, 0.0, ("coil", "torsion")),
        (0.0, 2.0, ("damper", "drum")),
        (3.0, 2.0, ("strut", "torsion")),
        (0.0, 0.0, ("coil", "torsion")),  # a constant force
    ],
)
def test_a_damper_is_drawn_as_one(stiffness, damping, glyphs):
    for deck, glyph in zip(("spring_damper", "torsional_spring"), glyphs, strict=True):
        model = read_deck(ROOT / "decks" / "forces" / f"{deck}.xml")
        spring = replace(model.loads[0], stiffness=stiffness, damping=damping)
        (entry,) = build_scene(replace(model, loads=(spring,)))["springs"]
        assert entry["glyph"] == glyph


@pytest.mark.parametrize("deck", ["machines/quarter_car.xml", "forces/slide_spring.xml"])
def test_a_spring_along_a_joint_has_a_length(deck):
    """The points of the joint coincide at the start."""
    scene = scene_of(deck)
    (spring,) = scene["springs"]
    ends = []
    for side in ("a", "b"):
        x, q = np.zeros(3), np.eye(3)
        if spring[side] >= 0:
            pose = scene["bodies"][spring[side]]["pose"]
            x, q = np.array(pose[:3]), matrices(pose[3:])
        ends.append(x + q @ spring[f"{side}Point"])
    assert np.linalg.norm(ends[1] - ends[0]) >= 0.08 * scene["size"]
