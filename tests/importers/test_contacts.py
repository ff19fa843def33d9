"""Limits of joints become stops, and shapes on planes contacts; the others are listed."""

import math

import numpy as np
import pytest

import msahl
from msahl.model import JointLimit, PlaneContact
from tests.importers.test_mjcf import body, faults_of, hinge
from tests.importers.test_mjcf import imported as imported_mjcf  # noqa: F401
from tests.importers.test_urdf import imported as imported_urdf  # noqa: F401
from tests.importers.test_urdf import joint, link

FLOOR = '<geom name="floor" type="plane" size="1 1 1"/>'
HIGH = 'name="high" pos="0 0 2"'


def contacts(found):
    return found.source.model().contacts


def notes(found, kind="not carried over"):
    return [note.message for note in found.notes if note.kind == kind]


def geom(kind="sphere", size="0.1", more=""):
    return f'<geom name="g" type="{kind}" size="{size}" {more}/>'


def test_a_range_in_degrees_is_a_stop(imported_mjcf):  # noqa: F811
    slide = hinge("s", 'type="slide" axis="1 0 0" range="-0.1 0.2"')
    world = body(hinge("h", 'range="-30 90"') + geom() + body(slide + geom().replace('"g"', '"k"')))
    first, second = contacts(imported_mjcf(world, restitution=0.25))
    assert first == JointLimit(
        "h limit", "h", "angle", -math.pi / 6.0, math.pi / 2.0, restitution=0.25
    )
    assert (second.coordinate, second.lower, second.upper) == ("slide", -0.1, 0.2)


def test_limits_of_urdf_are_stops_and_their_other_numbers_are_listed(imported_urdf):  # noqa: F811
    limit = '<limit lower="-1" upper="2" effort="5" velocity="3"/>'
    elements = [link("base"), link("a"), joint("j", "revolute", "base", "a", limit)]
    found = imported_urdf(*elements)
    (stop,) = contacts(found)
    assert (stop.joint, stop.coordinate, stop.lower, stop.upper) == ("j", "angle", -1.0, 2.0)
    assert "its effort and velocity: nothing bounds the load and the rate" in notes(found)
    found = imported_urdf(*elements[:2], elements[2].replace('lower="-1"', 'lower="2"'))
    assert not contacts(found)
    assert any("its range is empty" in text for text in notes(found))


@pytest.mark.parametrize(
    ("value", "words"),
    [(0.0, ""), (-0.5, ""), (-0.6, "the joint is 0.1 rad outside its range at t = 0")],
)
def test_a_joint_that_starts_outside_its_range_has_no_stop(imported_mjcf, value, words):  # noqa: F811
    world = body(hinge("h", 'range="-0.5 0.5"') + geom())
    found = imported_mjcf(world, '<compiler angle="radian"/>', pose={"h": value})
    assert len(contacts(found)) == (not words)
    assert any(words and words in text for text in notes(found)) == bool(words)


def test_angles_beyond_half_a_revolution_are_counted_as_runs_count_them(imported_mjcf):  # noqa: F811
    world = body(hinge("h", 'range="180 300"') + geom())
    (stop,) = contacts(imported_mjcf(world, pose={"h": 4.0}))
    assert (stop.lower, stop.upper) == pytest.approx((-math.pi, -math.pi / 3.0))


def test_the_joints_of_a_plane_that_have_stops_are_three(imported_mjcf):  # noqa: F811
    axes = (("x", "slide", "1 0 0"), ("z", "slide", "0 0 1"), ("r", "hinge", "0 1 0"))
    joints = "".join(hinge(n, f'type="{t}" axis="{a}" range="-1 1"') for n, t, a in axes)
    found = imported_mjcf(body(joints + geom()))
    assert len(found.source.model().joints) == len(contacts(found)) == 3
    found = imported_mjcf(body(joints + geom()), contacts="none")
    assert [j.kind for j in found.source.model().joints] == ["planar"]
    assert not contacts(found)
    assert len(notes(found)) == 3


@pytest.mark.parametrize(
    ("shape", "points", "radius"),
    [
        (geom(), [(0, 0, 0)], 0.1),
        (geom("capsule", "0.1 0.3"), [(0, 0, -0.3), (0, 0, 0.3)], 0.1),
        (
            geom("capsule", "0.1", 'fromto="0 0 0 0 0.4 0"'),
            [(0, 0, 0), (0, 0.4, 0)],
            0.1,
        ),
        (
            geom("box", "0.1 0.2 0.3"),
            [(x, y, z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)],
            0.0,
        ),
    ],
)
def test_shapes_touch_planes_at_ends_and_corners(imported_mjcf, shape, points, radius):  # noqa: F811
    floor = '<geom name="floor" type="plane" size="1 1 1" pos="0 0 -1" euler="0 90 0"/>'
    found = contacts(
        imported_mjcf(floor + body("<freejoint/>" + shape, HIGH.replace("0 0 2", "3 0 0")))
    )
    assert sorted(one.child_point for one in found) == pytest.approx(
        [pytest.approx(point, abs=1e-15) for point in sorted(points)]
    )
    for one in found:
        assert isinstance(one, PlaneContact)
        assert (one.radius, one.friction, one.normal) == (radius, 1.0, (1.0, 0.0, 0.0))
        assert (one.parent, one.child, one.parent_point) == ("Ground", "high", (0.0, 0.0, -1.0))


@pytest.mark.parametrize(
    ("of_floor", "of_shape", "friction"),
    [
        ("", 'friction="0.3"', 1.0),  # the larger one
        ('friction="0.2"', 'friction="0.3 0.1"', 0.3),
        ('priority="1" friction="0.2"', 'friction="0.3"', 0.2),
        ('condim="1"', 'condim="1"', 0.0),
        ('condim="1"', "", 1.0),
    ],
)
def test_friction_is_mixed_as_in_mujoco(imported_mjcf, of_floor, of_shape, friction):  # noqa: F811
    world = FLOOR.replace("/>", f" {of_floor}/>") + body("<freejoint/>" + geom(more=of_shape), HIGH)
    (one,) = contacts(imported_mjcf(world))
    assert one.friction == friction


@pytest.mark.parametrize(
    ("more", "others", "expected"),
    [
        ("", "", 1),
        ('contype="2" conaffinity="2"', "", 0),
        ('contype="2"', "", 1),  # the floor's type meets its affinity
        ('contype="0" conaffinity="0"', "", 0),
        ("", '<option><flag contact="disable"/></option>', 0),
        ("", '<contact><exclude body1="world" body2="high"/></contact>', 0),
        (
            'contype="0" conaffinity="0"',
            '<contact><pair geom1="g" geom2="floor" friction="0.7 0.7"/></contact>',
            1,
        ),
    ],
)
def test_masks_pairs_and_exclusions_are_those_of_mujoco(imported_mjcf, more, others, expected):  # noqa: F811
    found = imported_mjcf(FLOOR + body("<freejoint/>" + geom(more=more), HIGH), others)
    assert len(contacts(found)) == expected
    if "pair" in others:
        assert contacts(found)[0].friction == 0.7


def test_what_a_plane_cannot_meet_here_and_shapes_that_meet_are_listed(imported_mjcf):  # noqa: F811
    free = "<freejoint/>" + geom("cylinder", "0.1 0.2", 'condim="6" margin="0.1"')
    child = body(hinge() + geom(more='margin="0.1" condim="4"').replace('"g"', '"k"'), 'name="low"')
    found = imported_mjcf(FLOOR + body(free + child, HIGH))
    lines = {(note.where, note.message) for note in found.notes}
    assert (
        "geom 'g'",
        "its contact with planes: spheres, capsules and boxes have one here",
    ) in lines
    assert any(w == "geom 'k'" and "torsional and rolling" in m for w, m in lines)
    assert any(w == "geom 'k'" and m.startswith("the margin") for w, m in lines)
    # Parent and child do not collide; two bodies that are neither do.
    other = "its contact with shapes other than planes"
    assert not any(m == other for _, m in lines)
    apart = body("<freejoint/>" + geom().replace('"g"', '"m"'), 'pos="3 0 2"')
    found = imported_mjcf(FLOOR + body(free + child, HIGH) + apart)
    assert sum(m == other for m in notes(found)) == 3


def test_a_shape_below_the_plane_has_no_contact(imported_mjcf):  # noqa: F811
    found = imported_mjcf(FLOOR + body("<freejoint/>" + geom(), 'pos="0 0 0.04"'))
    assert not contacts(found)
    assert any("it is 0.06 m below the plane at t = 0" in text for text in notes(found))


def test_contacts_alone_may_be_omitted(imported_mjcf):  # noqa: F811
    world = FLOOR + body(hinge("h", 'range="-30 30"') + geom(), HIGH)
    found = imported_mjcf(world, contacts="limits")
    assert [type(one) for one in contacts(found)] == [JointLimit]
    assert any("--contacts limits omits it" in text for text in notes(found))


@pytest.mark.parametrize(
    ("world", "others", "words"),
    [
        (body(hinge("h", 'range="30 -30"') + geom()), "", "its range is from 30 to -30"),
        (body(hinge("h", 'limited="true"') + geom()), "", "its range is from 0 to 0"),
        (body(hinge() + geom(more='friction="-1"')) + FLOOR, "", "it must not be negative"),
        (body(hinge() + geom(more='contype="0.5"')), "", "it is a whole number"),
        (
            body(hinge() + geom()),
            '<contact><pair geom1="g" geom2="x"/></contact>',
            "'x' is no geom",
        ),
        (body(hinge() + geom()), '<contact><exclude body1="y"/></contact>', "'y' is no body"),
    ],
)
def test_faults_of_limits_and_contacts(imported_mjcf, world, others, words):  # noqa: F811
    assert words in faults_of(imported_mjcf, world, others)


def test_a_ball_bounces_on_the_plane_of_its_file(imported_mjcf):  # noqa: F811
    """Dropped from 1 m onto a plane: it rises to e^2 of it, after sqrt(2h/g) (1 + e)."""
    world = FLOOR + body("<freejoint/>" + geom(), 'name="ball" pos="0 0 1.1"')
    found = imported_mjcf(world, '<option gravity="0 0 -10"/>', restitution=0.5)
    top = math.sqrt(0.2) * 1.5
    result = msahl.load(found.source.data).run(
        scheme="gauss3", dt=top / 100.0, output_interval=top / 10.0, t_final=top, error="off"
    )
    # Located impacts are exact to the tolerance of the search, 1e-12 of the step, for parabolas.
    assert result["ball.z"][-1] == pytest.approx(0.1 + 0.25, abs=1e-9)
    assert np.min(result["ball.z"]) > 0.1 - 1e-9
