"""Loops of MJCF: a robot with four moves as its open tree with exact constraints; open loops."""

import json
import math
from importlib.util import find_spec

import numpy as np
import pytest

import msahl
from msahl.importers import ImportOptions, import_file
from tests.importers import loops
from tests.importers.faults import faults_of
from tests.importers.test_mjcf import BALL, body, four_bar, hinge, imported  # noqa: F401

MOTION = 1e-9
"""RK4 by steps of 0.125 ms, from which those of 0.25 ms differ by 2e-10; gauss5 at 2.5 ms."""


@pytest.fixture(scope="module")
def expected():
    return json.loads(loops.EXPECTED.read_text())


def keyed(tmp_path, numbers):
    """The robot with a keyframe of the state at the start."""
    given = " ".join(f'{k}="{" ".join(map(repr, numbers[k]))}"' for k in ("qpos", "qvel"))
    controls = " ".join(map(str, loops.CONTROLS))
    key = f'<keyframe><key name="k" {given} ctrl="{controls}"/></keyframe></mujoco>'
    path = tmp_path / "loops.xml"
    path.write_text(loops.FILE.read_text().replace("</mujoco>", key))
    return path


@pytest.mark.slow
def test_a_robot_with_four_loops_moves_as_its_tree_with_constraints(tmp_path, expected):
    found = import_file(keyed(tmp_path, expected), ImportOptions(key="k"))
    assert not [note for note in found.notes if "open by" in note.message]
    assert not [note for note in found.notes if note.kind == "not carried over"]
    model = msahl.load(found.source.data)
    kinds = {joint.name: joint.kind for joint in model.records.joints}
    assert sum(kind == "spherical" for kind in kinds.values()) == 8
    result = model.run(scheme="gauss5", dt=2.5e-3, t_final=loops.TIMES[-1], error="off")
    suffix = {"revolute": "angle", "prismatic": "slide"}
    columns = [f"{name}.{suffix[kinds[name]]}" for name in expected["names"]]
    for t, q in zip(loops.TIMES, expected["motion"], strict=True):
        (row,) = np.flatnonzero(np.abs(result.time - t) < 1e-9)
        assert [result[column][row] for column in columns] == pytest.approx(q, abs=MOTION)


@pytest.mark.skipif(find_spec("mujoco") is None, reason="needs mujoco, which has the numbers")
def test_the_stored_motion_is_that_of_mujoco(expected):
    found = loops.reference(step=2.0 * loops.STEP)
    assert found["violation"] < 1e-10  # 5e-12 was seen: of RK4, taken back
    # The step is twice as long: 2e-10 was seen.
    assert np.allclose(found["motion"], expected["motion"], rtol=0.0, atol=MOTION)


def open_notes(found):
    return [(n.line, n.where, n.message) for n in found.notes if "open by" in n.message]


def test_a_keyframe_says_by_how_much_its_loop_is_open(imported):  # noqa: F811
    """The tips of coupler and rocker, with the crank alone rotated by 0.1 rad about -y."""
    world, pin = four_bar()
    key = '<keyframe><key name="k" qpos="0.1 0 0"/></keyframe>'
    ((line, where, message),) = open_notes(imported(world, f"{pin}\n{key}", key="k"))
    # The coupler's tip lies where the loop is closed, on a circle about the crank's pivot.
    distance = 2.0 * math.sin(0.05) * math.hypot(*closed_tip())
    assert f"open by {distance:.3g} m at t = 0; the start closes it" in message
    assert (line, where) == (1, "connect 'pin'")


def closed_tip():
    angle = math.radians(98.85104391916123)
    return 1.0 + 0.8 * math.cos(angle), 0.8 * math.sin(angle)


def test_a_loop_that_cannot_be_closed_is_a_fault_of_its_equality(imported):  # noqa: F811
    rod = '<geom type="capsule" fromto="0 0 0 1 0 0" size="0.05"/>'
    world = body(hinge("a") + rod + '<site name="tip" pos="1 0 0"/>', 'name="near"')
    far = '<site name="far" pos="2.5 0 0"/>'
    pin = '<equality><connect name="pin" site1="tip" site2="far"/></equality>'
    text = faults_of(imported, world + far, pin)
    assert "model.xml:1: connect 'pin': its loop is open by 1.5 m at t = 0" in text
    assert "cannot be closed from there; start elsewhere, by --at or --key" in text


def test_rates_that_open_a_loop_are_a_fault_of_its_equality(imported):  # noqa: F811
    world, pin = four_bar()
    key = '<keyframe><key name="k" qvel="1 1 1"/></keyframe>'
    text = faults_of(imported, world, f"{pin}{key}", key="k")
    assert "connect 'pin': its deck cannot be run: joint 'pin': the given rates" in text


WELDED = body("<freejoint/>" + BALL, 'name="a" pos="1 0 0" euler="0 0 90"') + body(
    "<freejoint/>" + BALL, 'name="b" pos="0 2 0"'
)


def weld(more):
    return f'<equality><weld name="w" body1="a" body2="b" {more}/></equality>'


@pytest.mark.parametrize("zeros", ["", 'relpose="0 1 0 0 0 0 0"', 'relpose="0.1 2 3 0 0 0 0"'])
def test_a_weld_without_a_quaternion_has_the_pose_of_the_file(imported, zeros):  # noqa: F811
    found = imported(WELDED, weld(zeros))
    assert not open_notes(found)
    (joint,) = found.source.model().joints
    assert joint.kind == "rigid"


def test_a_weld_with_a_quaternion_has_its_own_pose(imported):  # noqa: F811
    """The second body belongs at (0.1, 0.2, 0.3) of the first, rotated by 90 deg about x, less its
    anchor: MuJoCo keeps the anchor at the position of the relpose."""
    relpose = 'relpose="0.1 0.2 0.3 1 1 0 0" anchor="0.5 0 0"'
    R = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # of the first body
    # Where the anchor is and where it belongs, and from no rotation to one about two axes.
    distance = np.linalg.norm([1.0, 0.0, 0.0] + R @ [0.1, 0.2, 0.3] - [0.5, 2.0, 0.0])
    text = faults_of(imported, WELDED, weld(relpose))
    assert f"open by {distance:.3g} m and {2.0 * math.pi / 3.0:.3g} rad" in text
    there = body("<freejoint/>" + BALL, 'name="a" pos="1 0 0" euler="0 0 90"')
    place = [1.0, 0.0, 0.0] + R @ [0.1 - 0.5, 0.2, 0.3]
    inner = f'name="b" pos="{" ".join(map(repr, place.tolist()))}" quat="1 1 1 1"'
    found = imported(there + body("<freejoint/>" + BALL, inner), weld(relpose))
    assert not open_notes(found)


def test_a_weld_without_torques_is_a_ball_at_its_anchor(imported):  # noqa: F811
    found = imported(WELDED, weld('torquescale="0" anchor="1 2 3"')).source.model()
    (joint,) = found.joints
    assert (joint.kind, joint.child_point) == ("spherical", (1.0, 2.0, 3.0))
    # (1, 4, 3) of the world from (1, 0, 0), in axes that are rotated by 90 deg about z.
    assert joint.parent_point == pytest.approx((4.0, 0.0, 3.0))
