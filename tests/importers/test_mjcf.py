"""MJCF: classes, frames, geoms, several joints of a body, loops, actuators, keyframes, includes."""

import math

import numpy as np
import pytest
from lxml import etree

import msahl
from msahl.algebra.rotation_arrays import rotations
from msahl.expressions.text import text_of
from msahl.importers import ImportOptions, import_file
from tests.importers.faults import faults_of
from tests.importers.joint_space import linkage
from tests.importers.test_urdf import tetrahedron
from tests.support.models import ROOT

LEG = ROOT / "examples" / "leg.xml"
BALL = '<geom type="sphere" size="0.1" mass="2"/>'


@pytest.fixture
def imported(tmp_path):
    """Import a model with this world and these other sections."""

    def of(world, others="", **options):
        path = tmp_path / "model.xml"
        path.write_text(f'<mujoco model="M">{others}<worldbody>{world}</worldbody></mujoco>')
        return import_file(path, ImportOptions(**options))

    return of


def body(inside, attributes=""):
    return f"<body {attributes}>{inside}</body>"


def only_body(found):
    (one,) = found.source.model().bodies
    return one


def hinge(name="j", more=""):
    return f'<joint name="{name}" {more}/>'


# Each inertia by integrating x^2 over 400 slices, and its mass by their areas.
@pytest.mark.parametrize(
    ("kind", "size", "half", "radius"),
    [
        ("sphere", "0.2", 0.2, lambda z: math.sqrt(0.04 - z * z)),
        ("cylinder", "0.2 0.3", 0.3, lambda z: 0.2),
        ("capsule", "0.2 0.3", 0.5, lambda z: math.sqrt(0.04 - max(abs(z) - 0.3, 0.0) ** 2)),
        ("ellipsoid", "0.2 0.2 0.4", 0.4, lambda z: 0.2 * math.sqrt(1.0 - z * z / 0.16)),
    ],
)
def test_round_geoms_have_the_inertia_of_their_slices(imported, kind, size, half, radius):
    z, w = np.polynomial.legendre.leggauss(400)
    r = np.array([radius(half * x) for x in z])
    area = math.pi * half * w * r**2
    mass, along = 1000.0 * area.sum(), 1000.0 * (area * r**2 / 2.0).sum()
    across = 1000.0 * (area * (r**2 / 4.0 + (half * z) ** 2)).sum()
    geom = f'<geom type="{kind}" size="{size}"/>'
    found = only_body(imported(body(hinge() + geom)))
    # Gauss' formula over the kinks of the capsule.
    assert found.mass == pytest.approx(mass, rel=1e-5)
    assert np.array(found.inertia) == pytest.approx(np.diag([across, across, along]), rel=1e-5)


def test_a_box_between_two_points_and_euler_angles_in_degrees(imported):
    geom = '<geom type="box" fromto="0 0 0 0 0.4 0" size="0.05" density="500"/>'
    found = only_body(imported(body(hinge() + geom)))
    m = 500.0 * 0.1 * 0.1 * 0.4
    assert found.mass == pytest.approx(m)
    assert found.r_BG == pytest.approx((0.0, 0.2, 0.0))
    long = m * (0.01 + 0.16) / 12.0
    assert np.diag(found.inertia) == pytest.approx([long, m * 0.02 / 12.0, long])
    geom = '<geom type="box" size="0.1 0.2 0.3" euler="0 0 90"/>'
    J = only_body(imported(body(hinge() + geom))).inertia
    plain = only_body(imported(body(hinge() + geom.replace("90", "0")))).inertia
    assert (J[0][0], J[1][1]) == pytest.approx((plain[1][1], plain[0][0]))


@pytest.mark.parametrize(
    ("given", "compiler"),
    [
        ('quat="1 1 0 0"', ""),
        ('axisangle="1 0 0 90"', ""),
        ('axisangle="1 0 0 1.5707963267948966"', 'angle="radian"'),
        ('xyaxes="1 0 0 0 0 1"', ""),
        ('zaxis="0 -1 0"', ""),
        ('euler="90 0 0"', ""),
        ('euler="0 90 0"', 'eulerseq="zxy"'),
        ('euler="90 0 0"', 'eulerseq="XZY"'),
    ],
)
def test_all_orientations_of_a_quarter_about_x(imported, given, compiler):
    world = body(hinge(more='axis="0 0 1"') + BALL, given)
    found = imported(world, f"<compiler {compiler}/>").source.model()
    assert found.joints[0].parent_axes[2] == pytest.approx((0.0, -1.0, 0.0), abs=1e-15)


def test_classes_are_inherited_and_overridden():
    found = import_file(LEG).source.model()
    springs = {load.joint: load for load in found.loads if hasattr(load, "stiffness")}
    assert (springs["hip"].stiffness, springs["hip"].damping) == (1.5, 0.2)
    assert (springs["knee"].stiffness, springs["ankle"].damping) == (4.0, 0.05)
    # Unloaded at -35 deg; the joint begins at its reference of -10 deg.
    assert springs["knee"].free == pytest.approx(math.radians(-25.0))
    rotors = {b.name: b.inertia[2][2] for b in found.bodies if b.name.endswith("rotor")}
    expected = {"rail": 0.5, "hip": 0.012, "knee": 0.012, "ankle": 0.012}
    assert rotors == {f"{name} rotor": value for name, value in expected.items()}


def test_a_linear_equality_is_a_gear():
    found = import_file(LEG).source.model()
    gear = next(c for c in found.couplings if "follows" in c.name)
    assert (gear.first, gear.second, gear.ratio) == ("knee", "ankle", -0.5)


def test_a_keyframe_gives_coordinates_and_controls():
    found = import_file(LEG, ImportOptions(key="crouched"))
    assert b'<slide units="m">-0.1</slide>' in found.source.data
    controls = {s.name: text_of(s.expression) for s in found.source.model().signals}
    assert controls == {"hip motor control": "0.1", "knee servo control": "-0.7"}
    assert "those there are: crouched" in faults_of(import_file, LEG, ImportOptions(key="up"))


def test_coordinates_of_a_planar_joint_have_the_signs_of_the_file(imported):
    """z x (x of the joint) is against the second slide here."""
    axes = {"x": "1 0 0", "z": "0 0 1"}
    slides = "".join(f'<joint name="{n}" type="slide" axis="{a}"/>' for n, a in axes.items())
    inside = slides + hinge("roll", 'axis="0 1 0"') + BALL
    found = imported(body(inside), pose={"z": 0.4}, rates={"x": 0.2, "z": 0.3})
    result = msahl.load(found.source.data).run(scheme="gauss2", dt=0.1, t_final=0.1, error="off")
    body_name = only_body(found).name
    start = [result[f"{body_name}.{c}"][0] for c in ("x", "z", "vx", "vz")]
    assert start == pytest.approx([0.0, 0.4, 0.2, 0.3], abs=1e-15)  # round-off


def test_damped_slides_with_rotors_and_next_to_no_mass(imported):
    """x = v m/c (1 - exp(-c t/m)). The body between the slides has 1e-19 kg: what its damper does
    to such a mass says nothing of the round-off of the slides' rates."""
    m, c, v, t = 0.04, 0.5, 0.3, 0.2
    axes = {"y": "0 1 0", "x": "1 0 0"}
    more = f'type="slide" damping="{c}" armature="{m}"'
    slides = "".join(f'<joint name="{n}" axis="{a}" {more}/>' for n, a in axes.items())
    sphere = '<geom type="sphere" size="0.1" mass="1e-10"/>'
    found = imported(body(slides + sphere), '<option gravity="0 0 0"/>', rates={"y": v})
    result = msahl.load(found.source.data).run(scheme="gauss4", dt=0.01, t_final=t, error="off")
    expected = v * m / c * (1.0 - math.exp(-c * t / m))
    # The sphere has 2.5e-9 of the mass of the rotor; 1e-5 was seen where steps stopped early.
    assert result["y.slide"][-1] == pytest.approx(expected, rel=1e-8)


def test_slides_and_a_hinge_of_a_plane_are_one_joint(imported):
    axes = (("x", "slide", "1 0 0"), ("z", "slide", "0 0 1"), ("r", "hinge", "0 1 0"))
    joints = "".join(f'<joint name="{n}" type="{t}" axis="{a}"/>' for n, t, a in axes)
    pose = {"x": 0.3, "z": -0.2, "r": 0.7}
    found = imported(body(joints + BALL, 'pos="1 2 3"'), pose=pose).source.model()
    (joint,), (ball,) = found.joints, found.bodies
    assert joint.kind == "planar"
    assert ball.position == pytest.approx((1.3, 2.0, 2.8))
    angle = 4.0 * math.atan(math.hypot(*ball.orientation) / 4.0)
    assert (angle, np.sign(ball.orientation[1])) == (pytest.approx(0.7), 1.0)


def test_several_hinges_have_small_bodies_between_them(imported):
    axes = {"a": "0 0 1", "b": "0 1 0", "c": "1 0.2 0"}
    joints = "".join(f'<joint name="{n}" axis="{x}"/>' for n, x in axes.items())
    found = imported(body(joints + BALL), pose={"a": 0.3, "b": 0.5, "c": -0.4}).source.model()
    masses = [one.mass for one in found.bodies]
    assert len(masses) == 3
    assert sum(masses) == pytest.approx(2.0, rel=1e-15)
    assert max(masses[:2]) < 1e-8
    values = {"a": {"angle": 0.3}, "b": {"angle": 0.5}, "c": {"angle": -0.4}}
    R = linkage(found, values).places[found.bodies[-1].name].R

    def rotation(axis, angle):
        x, y, z = np.array(axis) / np.linalg.norm(axis)
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return np.eye(3) + math.sin(angle) * K + (1 - math.cos(angle)) * K @ K

    wanted = rotation((0, 0, 1), 0.3) @ rotation((0, 1, 0), 0.5) @ rotation((1, 0.2, 0), -0.4)
    assert pytest.approx(wanted, abs=1e-14) == R


def test_a_free_body_and_a_ball_joint_begin_by_a_keyframe(imported):
    world = body(
        "<freejoint/>" + BALL + body('<joint type="ball" pos="0 0 1"/>' + BALL, 'pos="0 0 -1"')
    )
    half = math.sqrt(0.5)
    qpos, qvel = f"1 2 3 {half} 0 0 {half} {half} {half} 0 0", "0 0 0 0 0 0 0.5 0 0"
    key = f'<keyframe><key name="k" qpos="{qpos}" qvel="{qvel}"/></keyframe>'
    found = imported(world, key, key="k").source.model()
    first, second = found.bodies
    assert first.position == (1.0, 2.0, 3.0)
    assert second.angular_velocity == pytest.approx((0.5, 0.0, 0.0))
    # (0, 0, -1), rotated about x of the second body, is (0, 1, 0), and then (-1, 0, 0).
    assert second.position == pytest.approx((1.0 - 1.0, 2.0, 3.0))


FOUR_BAR = ROOT / "decks" / "mechanisms" / "four_bar.xml"
ANGLES = {"crank": 60.0, "coupler": 36.13065665513935, "rocker": 98.85104391916123}
"""Of the rods to the ground where that deck begins [deg]."""


def test_balls_in_a_loop_are_closed_as_well(imported):
    """A rod on a hinge and one on a ball, which is pinned to the world where the file has it."""
    rod = '<geom type="capsule" fromto="0 0 0 1 0 0" size="0.05" mass="1"/>'
    far = body('<joint type="ball"/>' + rod, 'name="far" pos="1 0 0"')
    near = body(hinge("a", 'axis="0 1 0"') + rod + far, 'name="near"')
    pin = '<equality><connect body1="far" body2="world" anchor="1 0 0"/></equality>'
    found = imported(
        near.replace('pos="1 0 0"', 'pos="1 0 0" euler="0 90 0"'), pin, pose={"a": 0.2}
    )
    one = next(b for b in found.source.model().bodies if b.name == "far")
    tip = one.position + rotations(np.array(one.orientation)) @ np.array([1.0, 0.0, 0.0])
    assert tip == pytest.approx((1.0, 0.0, -1.0), abs=1e-13)


def four_bar():
    """The linkage of that deck, without its motor: a connect closes the loop."""

    def rod(name, length, mass, J, angle, at, inside=""):
        inertial = f'<inertial pos="{length / 2} 0 0" mass="{mass}" diaginertia="1e-4 {J} {J}"/>'
        joint = hinge(name, 'axis="0 -1 0"')
        return body(
            inertial + joint + inside, f'name="{name}" pos="{at} 0 0" euler="0 {-angle!r} 0"'
        )

    relative = ANGLES["coupler"] - ANGLES["crank"]
    coupler = rod("coupler", 0.9, 2, 0.135, relative, 0.3)
    world = rod("crank", 0.3, 1, 0.0075, ANGLES["crank"], 0, coupler)
    world += rod("rocker", 0.8, 2, 0.10666666666666669, ANGLES["rocker"], 1)
    pin = '<connect name="pin" body1="coupler" body2="rocker" anchor="0.9 0 0"/>'
    return world, f"<equality>{pin}</equality>"


def test_a_loop_is_closed_from_another_pose(imported):
    found = imported(*four_bar(), pose={"crank": 0.5}).source.model()
    tips = []
    for name, length in (("coupler", 0.9), ("rocker", 0.8)):
        one = next(b for b in found.bodies if b.name == name)
        P = np.array(one.orientation)
        tips.append(one.position + rotations(P) @ np.array([length, 0.0, 0.0]))
    # To round-off of the pose, whose angles have 16 digits.
    assert tips[0] == pytest.approx(tips[1], abs=1e-13)
    assert np.hypot(tips[0][0] - 1.0, tips[0][2]) == pytest.approx(0.8)


def test_a_loop_moves_as_the_deck_of_the_same_linkage(imported):
    model = msahl.load(imported(*four_bar(), rates={"crank": 2.0 * math.pi}).source.data)
    root = etree.parse(FOUR_BAR).getroot()
    root.find("system").remove(root.find("system/motions"))
    options = {"scheme": "gauss5", "dt": 0.005, "t_final": 1.0, "error": "off"}
    found = model.run(output_interval=0.01, **options)
    expected = msahl.load(root).run(output_interval=0.01, **options)
    for ours, deck in (("crank", "Crank pivot"), ("coupler", "Crank pin")):
        theirs = expected[f"{deck}.angleRate"]
        # Their axes are opposite.
        assert found[f"{ours}.angleRate"] == pytest.approx(-theirs, abs=1e-9 * np.ptp(theirs))


def test_what_has_no_counterpart_is_listed(imported):
    world = body(hinge(more='range="-10 10" actuatorfrcrange="-1 1"') + BALL + "<camera/>")
    others = '<option density="1.2"/><sensor><jointpos joint="j"/></sensor><size nconmax="9"/>'
    found = imported(world, others)
    lost = {(note.where, note.message) for note in found.notes if note.kind == "not carried over"}
    assert {message for _, message in lost} == {
        "its actuatorfrcrange", "msahl has no such element", "forces of a fluid: density",
        "settings of MuJoCo itself",
    }  # fmt: skip


def test_meshes_and_materials_have_their_classes(imported, tmp_path):
    tetrahedron(tmp_path / "t.stl")
    others = (
        '<default><mesh scale="2 2 2"/><material rgba="1 0 0 1"/>'
        '<default class="small"><mesh scale="0.5 0.5 0.5"/></default></default>'
        '<asset><mesh name="a" file="t.stl"/><mesh name="b" class="small" file="t.stl"/>'
        '<material name="m"/></asset>'
    )
    geoms = "".join(f'<geom type="mesh" mesh="{m}" density="6" material="m"/>' for m in "ab")
    found = imported(body(hinge() + geoms), others)
    assert only_body(found).mass == pytest.approx(2.0**3 + 0.5**3)  # of tetrahedra of 1/6
    shapes = found.source.model().shapes
    assert [(shape.size, shape.colour) for shape in shapes] == [
        ((2.0,), "#ff0000"), ((0.5,), "#ff0000"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("compiler", "mesh", "counts"),
    [
        ("", "", True),
        ('exactmeshinertia="false"', "", True),
        ('exactmeshinertia="true"', "", False),
        ('exactmeshinertia="true"', 'inertia="convex"', True),
        ("", 'inertia="exact"', False),
    ],
)
def test_an_open_mesh_has_mass_by_its_pyramids_alone(imported, tmp_path, compiler, mesh, counts):
    tetrahedron(tmp_path / "t.stl")
    data = (tmp_path / "t.stl").read_bytes()
    (tmp_path / "t.stl").write_bytes(data[:80] + bytes([3, 0, 0, 0]) + data[84:-50])  # a face less
    others = f'<compiler {compiler}/><asset><mesh name="t" file="t.stl" {mesh}/></asset>'
    found = imported(body(f'{hinge()}{BALL}<geom type="mesh" mesh="t" mass="1"/>'), others)
    assert only_body(found).mass == (3.0 if counts else 2.0)
    words = "\n".join(note.message for note in found.notes)
    assert ("its mesh is open" in words) != counts
    assert ("not as its convex hull" in words) == ("convex" in mesh)


def test_included_files_lie_below_the_folder(tmp_path, imported):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "ball.xml").write_text(
        f"<mujocoinclude>{body(hinge() + BALL)}</mujocoinclude>"
    )
    assert only_body(imported('<include file="parts/ball.xml"/>')).mass == 2.0
    outside = tmp_path.parent / "ball.xml"
    outside.write_text("<mujocoinclude/>")
    for file in ("../ball.xml", str(outside), "none.xml", "model.xml"):
        text = faults_of(imported, f'<include file="{file}"/>')
        assert "below the folder" in text or "includes itself" in text


@pytest.mark.slow
def test_an_imported_deck_is_exported_and_read_back_to_the_same_motion(tmp_path):
    model = msahl.load(import_file(LEG, ImportOptions(key="crouched")).source.data)
    records = msahl.Model(model.records)
    records.write(tmp_path / "again.xml")
    again = msahl.load(tmp_path / "again.xml")
    options = {"scheme": "gauss5", "dt": 0.005, "t_final": 0.5, "error": "off"}
    first, second = model.run(**options), again.run(**options)
    for name in ("rail.slide", "hip.angle", "knee.angle"):
        assert second[name] == pytest.approx(first[name], abs=1e-12)
