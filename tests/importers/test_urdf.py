"""URDF: frames, fixed links, joints of all types, mimic, meshes, and what is listed."""

import struct

import numpy as np
import pytest

import msahl
from msahl.importers import ImportOptions, import_file
from tests.importers.faults import faults_of
from tests.importers.joint_space import linkage, mass_matrix
from tests.support.models import ROOT

ARM = ROOT / "examples" / "arm.urdf"
ROD = """<inertial>
<mass value="2"/><inertia ixx="0.1" iyy="0.2" izz="0.25" ixy="0" ixz="0" iyz="0"/>
</inertial>"""


def link(name, inside=ROD):
    return f'<link name="{name}">{inside}</link>'


def joint(name, kind, parent, child, inside=""):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


@pytest.fixture
def imported(tmp_path):
    """Import a robot of these elements."""

    def of(*elements, **options):
        path = tmp_path / "robot.urdf"
        path.write_text(f'<robot name="R">{chr(10).join(elements)}</robot>')
        return import_file(path, ImportOptions(**options))

    return of


def messages(found, kind):
    return [note.message for note in found.notes if note.kind == kind]


def test_fixed_links_are_one_body_by_the_parallel_axis_theorem(imported):
    placed = '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>'
    found = imported(
        link("base", ""), link("a"), link("b"),
        joint("j", "continuous", "base", "a"), joint("f", "fixed", "a", "b", placed),
    )  # fmt: skip
    model = found.source.model()
    (body,) = model.bodies
    assert body.mass == 4.0
    assert body.r_BG == pytest.approx((0.5, 0.0, 0.0))
    # Ixx of a and Iyy of b, rotated; both masses are 0.5 m from the common centre.
    assert np.array(body.inertia) == pytest.approx(np.diag([0.3, 0.3 + 1.0, 0.5 + 1.0]))
    (marker,) = model.markers
    assert (marker.name, marker.body) == ("b", "a")
    assert marker.axes[0] == pytest.approx((0.0, 1.0, 0.0))


def test_kept_fixed_links_move_like_one_body():
    merged = import_file(ARM, ImportOptions(pose={"elbow": 0.3})).source.model()
    kept = import_file(ARM, ImportOptions(pose={"elbow": 0.3}, keep_fixed=True)).source.model()
    assert [j.kind for j in kept.joints].count("rigid") == 1
    assert len(kept.bodies) == len(merged.bodies) + 1
    values = {"shoulder": {"angle": 0.2}, "elbow": {"angle": -0.7}, "left": {"slide": 0.01}}
    names = ["shoulder", "elbow"]

    def M(model):
        return mass_matrix(without_couplings(model), values, names)

    assert M(kept) == pytest.approx(M(merged), rel=1e-12)


def without_couplings(model):
    from tests.importers.joint_space import without_rotors

    return without_rotors(model)[0]


def test_planar_and_floating_joints(imported):
    found = imported(
        link("base", ""), link("a"), link("b"), link("c"),
        joint("p", "planar", "base", "a", '<axis xyz="0 1 0"/>'),
        joint("f", "floating", "base", "b", '<origin xyz="1 2 3" rpy="0.1 0 0"/>'),
        joint("x", "prismatic", "b", "c", '<origin xyz="0 0 1"/>'),
    )  # fmt: skip
    model = found.source.model()
    assert {j.name: j.kind for j in model.joints} == {"p": "planar", "x": "prismatic"}
    places = {body.name: body.position for body in model.bodies}
    assert places["b"] == pytest.approx((1.0, 2.0, 3.0))
    assert places["c"] == pytest.approx((1.0, 2.0 - np.sin(0.1), 3.0 + np.cos(0.1)))


def test_the_base_is_fixed_unless_it_is_free(imported):
    robot = link("world", ""), link("a"), joint("f", "fixed", "world", "a")
    assert "--base free" in faults_of(imported, link("a"))
    assert imported(link("a"), base="free").source.model().joints == ()
    assert "nothing in it moves" in faults_of(imported, *robot, base="free")


def test_a_joint_that_follows_another_is_geared_to_it(imported):
    follow = '<axis xyz="0 0 1"/><mimic joint="j" multiplier="-2" offset="0.5"/>'
    found = imported(
        link("base", ""), link("a"), link("b"),
        joint("j", "continuous", "base", "a", '<axis xyz="0 0 1"/>'),
        joint("k", "continuous", "a", "b", follow), pose={"j": 0.25}, rates={"j": 1.0},
    )  # fmt: skip
    result = msahl.load(found.source.data).run(t_final=0.2)
    assert result["k.angle"][0] == pytest.approx(0.0)
    # To round-off of the constraint.
    assert result["k.angle"] == pytest.approx(-2.0 * result["j.angle"] + 0.5, abs=1e-10)
    assert result["j.angle"][-1] > 0.3


def test_fingers_that_follow_one_another_keep_their_distance():
    result = msahl.load(import_file(ARM, ImportOptions(pose={"left": 0.01})).source.data).run(
        t_final=0.3
    )
    assert result["left.slide"] == pytest.approx(result["right.slide"], abs=1e-10)
    assert np.ptp(result["left.slide"]) > 1e-3


def test_a_joint_that_follows_a_fixed_one_is_fixed(imported):
    found = imported(
        link("base", ""), link("a"), link("b"), link("c"),
        joint("f", "fixed", "base", "a"), joint("m", "prismatic", "a", "b",
            '<axis xyz="0 0 1"/><mimic joint="f" offset="0.5"/>'),
        joint("j", "continuous", "b", "c"),
    )  # fmt: skip
    model = found.source.model()
    assert len(model.bodies) == 1
    assert model.joints[0].parent_point == pytest.approx((0.0, 0.0, 0.5))


def test_what_is_not_carried_over_is_listed_with_its_line():
    notes = import_file(ARM).notes
    lines = ARM.read_text().splitlines()
    lost = {(n.where, n.line) for n in notes if n.kind == "not carried over"}
    assert lost == {
        (f"{tag} '{name}', {inside}", number)
        for tag, name, inside, number in (
            ("link", "upper arm", "collision", 30),
            ("joint", "elbow", "limit", 96),
            ("joint", "left", "limit", 114),
            ("joint", "right", "limit", 122),
        )
    }
    assert all(f"<{where.rpartition(' ')[2]}" in lines[line - 1] for where, line in lost)


def test_dry_friction_is_an_actuator_of_constant_magnitude(imported):
    found = imported(
        link("base", ""), link("a"),
        joint("j", "continuous", "base", "a", '<axis xyz="0 0 1"/><dynamics friction="0.5"/>'),
        rates={"j": 3.0},
    )  # fmt: skip
    result = msahl.load(found.source.data).run(t_final=0.5)
    # I = 0.25 kg m^2: the rate falls by 2 rad/s^2.
    assert result["j.angleRate"][-1] == pytest.approx(2.0, abs=1e-6)
    assert "regularised" in messages(found, "changed")[0]


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        ((link("a"), link("a")), "the name is taken by another link"),
        ((link("a"), joint("j", "hinge", "a", "a")), "type 'hinge' is none of"),
        ((link("a"), joint("j", "fixed", "a", "b")), "its child 'b' is no link"),
        ((link("a"), link("b"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")),
         "form a circle"),
        ((link("w", ""), link("a", ""), joint("j", "continuous", "w", "a")), "--repair gives it"),
        ((link("a", '<inertial><mass value="x"/></inertial>'),), "expected a finite number"),
        ((link("a", '<inertial><mass value="-1"/></inertial>'),), "must not be negative"),
        ((link("b", ""), link("a"), joint("j", "continuous", "b", "a", '<axis xyz="0 0 0"/>')),
         "give a direction"),
    ],
)  # fmt: skip
def test_faults_have_a_remedy(imported, elements, message):
    text = faults_of(imported, *elements)
    assert message in text
    assert "robot.urdf:" in text


def test_entities_are_refused(tmp_path):
    path = tmp_path / "bomb.urdf"
    path.write_text('<!DOCTYPE r [<!ENTITY a "b">]><robot name="&a;"/>')
    assert "document type declaration" in faults_of(import_file, path)


def tetrahedron(path):
    """The solid with the corners 0 and the unit vectors: volume 1/6."""
    corners = np.vstack([np.zeros(3), np.eye(3)])
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    triangles = b"".join(
        struct.pack("<12fH", 0, 0, 0, *corners[list(face)].ravel(), 0) for face in faces
    )
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + triangles)


def mesh(file, scale="1 1 1"):
    return f'<visual><geometry><mesh filename="{file}" scale="{scale}"/></geometry></visual>'


def test_meshes_lie_below_the_folder_of_the_file_or_one_that_is_given(imported, tmp_path):
    elsewhere = tmp_path / "packages" / "robots"
    elsewhere.mkdir(parents=True)
    tetrahedron(elsewhere / "part.stl")
    tetrahedron(tmp_path / "near.stl")
    outside = tmp_path.parent / "outside.stl"
    tetrahedron(outside)
    files = ["near.stl", "package://robots/part.stl", "../outside.stl", str(outside)]
    elements = [link("base", "".join(map(mesh, files))), link("a"),
                joint("j", "continuous", "base", "a")]  # fmt: skip
    found = imported(*elements)
    assert [shape.file for shape in found.source.model().shapes] == ["near.stl"]
    assert len(messages(found, "not carried over")) == 3
    found = imported(*elements, packages=(tmp_path / "packages",))
    files = [shape.file for shape in found.source.model().shapes]
    assert files == ["near.stl", "packages/robots/part.stl"]
    assert any("outside" in text for text in messages(found, "not carried over"))


def test_the_pose_places_the_bodies():
    pose = {"shoulder": 0.4, "elbow": -1.1, "left": 0.02}
    found = import_file(ARM, ImportOptions(pose=pose)).source.model()
    values = {n: {"slide" if n == "left" else "angle": q} for n, q in pose.items()}
    placed = linkage(without_couplings(found), values)
    for body in found.bodies:
        if body.name in ("upper arm", "forearm", "left finger"):
            assert body.position == pytest.approx(placed.places[body.name].x, abs=1e-14)


def test_a_rate_that_is_not_given_is_zero_beside_coupled_joints_whose_rates_are():
    # Left and right are coupled, and both have rates: nothing follows for the shoulder, but by
    # round-off of the coupling's equation.
    found = import_file(ARM, ImportOptions(rates={"left": 0.01}, pose={"elbow": 0.4}))
    upper = next(body for body in found.source.model().bodies if body.name == "upper arm")
    assert upper.angular_velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-15)
