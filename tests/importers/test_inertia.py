"""The inertia doctor: impossible and doubtful inertias, the nearest one, solids of meshes."""

import numpy as np
import pytest

from msahl.check.bodies import impossible
from msahl.check.possible_inertia import nearest_possible, second_moments
from msahl.importers.inertia import matrix
from msahl.importers.meshes import MeshFiles
from msahl.importers.robot import Inertia, about, together
from msahl.importers.solids import mesh_solid, pyramids
from msahl.post.scene.meshes import Mesh, read_mesh
from tests.importers.test_urdf import faults_of, imported, joint, link, mesh, messages, tetrahedron

__all__ = ["imported"]


def rotated(random):
    """A random rotation."""
    Q, R = np.linalg.qr(random.normal(size=(3, 3)))
    return Q * np.sign(np.diag(R))


@pytest.mark.slow
def test_the_nearest_tensor_is_possible_and_no_possible_one_is_nearer():
    random = np.random.default_rng(4)
    for _ in range(60):
        A = random.normal(size=(3, 3))
        J = A + A.T
        nearest = nearest_possible(J, 1.0)
        assert impossible(matrix(nearest)) == ""
        distance = np.linalg.norm(nearest - J)
        for _ in range(200):
            # Any possible tensor, near the one found: second moments not below its least ones.
            s = np.abs(second_moments(nearest) + random.normal(size=3) * random.choice([1e-2, 1.0]))
            axes = rotated(random)
            other = axes @ np.diag(s.sum() - s) @ axes.T
            # The least second moments are 1e-6 of the largest entry.
            assert np.linalg.norm(other - J) > distance - 1e-5 * np.abs(J).max()


def test_a_possible_tensor_stays():
    J = np.diag([1.0, 1.5, 2.2])
    assert nearest_possible(J, 1.0) == pytest.approx(J, rel=1e-14)


def test_what_round_off_left_of_zero_counts_as_zero():
    """1e-35 kg m^2 of the head of a robot, 1.3 kg."""
    J = np.array([[0.0, 0.0, 2.4e-35], [0.0, 0.0, 0.0], [2.4e-35, 0.0, 0.0]])
    # By hand: every second moment is half the mass at the radius of a point, 0.1 mm.
    assert np.linalg.eigvalsh(nearest_possible(J, 1.3)) == pytest.approx([1.3e-8] * 3, rel=1e-12)


def test_by_hand_the_excess_is_shared_by_all_three_moments():
    # 1 + 1 < 5: each changes by a third of the excess of 3.
    found = np.linalg.eigvalsh(nearest_possible(np.diag([1.0, 1.0, 5.0]), 1.0))
    assert found == pytest.approx([2.0, 2.0, 4.0], abs=2e-5)


def inertial(mass, xx, yy, zz):
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="0" '
        'ixz="0" iyz="0"/></inertial>'
    )


def arm(*inside):
    return link("base", ""), link("a", "".join(inside)), joint("j", "continuous", "base", "a")


@pytest.mark.parametrize("moments", [(-0.1, 0.2, 0.2), (0.1, 0.1, 0.5), (0, 0, 0)])
def test_an_impossible_inertia_is_refused_or_repaired(imported, moments):
    elements = arm(inertial(2, *moments))
    text = faults_of(imported, *elements)
    assert "link 'a'" in text
    assert "--repair" in text
    found = imported(*elements, repair=True)
    (body,) = found.source.model().bodies
    assert np.array(body.inertia) == pytest.approx(nearest_possible(np.diag(moments), 2.0))
    (message,) = messages(found, "inertia")
    assert "replaced by the nearest possible one" in message


def test_a_moving_link_without_mass_gets_a_tiny_one(imported):
    elements = (
        link("w", ""),
        link("a", ""),
        link("b", inertial(2, 1, 1, 1)),
        joint("j", "continuous", "w", "a"),
        joint("k", "prismatic", "a", "b"),
    )
    assert "link 'a': it moves and has no mass" in faults_of(imported, *elements)
    bodies = imported(*elements, repair=True).source.model().bodies
    assert [body.mass for body in bodies] == pytest.approx([2e-9, 2.0])


def test_radii_of_gyration_are_compared_with_the_shapes(imported):
    box = '<visual><geometry><box size="0.2 0.2 0.2"/></geometry></visual>'
    for moments, message in (
        ((3.0,) * 3, "more than the 0.1732 m"),
        ((1e-7,) * 3, "of the 0.1732 m"),
    ):
        (found,) = messages(imported(*arm(box, inertial(2, *moments))), "inertia")
        assert message in found
    assert not messages(imported(*arm(box, inertial(2, *(0.0133,) * 3))), "inertia")


def test_the_solid_of_a_mesh_is_the_sum_of_its_tetrahedra(tmp_path):
    tetrahedron(tmp_path / "t.stl")
    found = mesh_solid(read_mesh(tmp_path / "t.stl"))
    assert found.mass == pytest.approx(1.0 / 6.0)
    assert found.c == pytest.approx([0.25] * 3)
    # int x^2 = 1/60 and int x y = 1/120 over this tetrahedron.
    about_corner = np.full((3, 3), -1.0 / 120.0) + np.eye(3) * (2.0 / 60.0 + 1.0 / 120.0)
    assert found.J + about(found.mass, found.c) == pytest.approx(about_corner)
    one = read_mesh(tmp_path / "t.stl")
    assert mesh_solid(Mesh(one.vertices, one.faces[:3])) is None


def test_a_message_has_the_moments_of_the_solid(imported, tmp_path):
    tetrahedron(tmp_path / "t.stl")
    found = imported(*arm(mesh("t.stl"), inertial(2, 50, 50, 50)))
    (message,) = messages(found, "inertia")
    solid = mesh_solid(read_mesh(tmp_path / "t.stl"))
    smallest = np.linalg.eigvalsh(solid.J * 12.0)[0]
    assert f"a solid of its mesh: {smallest:.6g}" in message


def test_parts_add_up_about_their_common_mass_centre():
    random = np.random.default_rng(1)
    parts = [Inertia(m, random.normal(size=3), np.eye(3)) for m in (1.0, 2.0, 0.5)]
    total = together(parts)
    point = random.normal(size=3)
    J = sum(p.J + about(p.mass, p.c - point) for p in parts)
    assert total.J + about(total.mass, total.c - point) == pytest.approx(J)


def test_meshes_of_one_name_are_copied_under_different_ones(tmp_path):
    files = MeshFiles((tmp_path,), tmp_path / "deck", "meshes")
    names = [files._from_target(tmp_path / folder / "part.stl") for folder in ("a", "b", "a")]
    assert names == ["meshes/part.stl", "meshes/part_2.stl", "meshes/part.stl"]


def test_a_convex_mesh_has_the_same_inertia_by_pyramids(tmp_path):
    tetrahedron(tmp_path / "t.stl")
    mesh_ = read_mesh(tmp_path / "t.stl")
    exact, found = mesh_solid(mesh_), pyramids(mesh_)
    assert found.mass == pytest.approx(exact.mass)
    assert found.c == pytest.approx(exact.c)
    assert pytest.approx(exact.J) == found.J


def test_a_tensor_without_mass_counts(imported):
    """As in the models of Gazebo, MuJoCo and Pinocchio; feet of robots are shipped so."""
    foot = link("foot", inertial(0, 0.1, 0.2, 0.25)), joint("f", "fixed", "a", "foot")
    found = imported(*arm(inertial(2, 1, 1.5, 2)), *foot)
    (body,) = found.source.model().bodies
    assert body.mass == 2.0
    assert np.diag(body.inertia) == pytest.approx([1.1, 1.7, 2.25], rel=1e-15)
    assert messages(found, "inertia") == ["a tensor without mass; it counts as it stands"]
