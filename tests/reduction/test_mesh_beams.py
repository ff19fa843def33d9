"""Beams of meshes: rigid motion, statics and frequencies by theory, error of the mesh."""

import numpy as np
import pytest
from scipy import linalg

from msahl.reduction import ReductionError, Wishes, reduce_model
from msahl.reduction.interfaces import interface_of
from msahl.reduction.mesh.material import Material, section_of
from msahl.reduction.mesh.reduce import mesh_model
from msahl.reduction.normal_modes import Wanted
from msahl.reduction.rigid import rigid_fields
from tests.reduction.meshes import line_mesh

STEEL = Material(210e9, 0.3, 7850.0)
L, RADIUS = 1.0, 0.05
RECTANGLE = "width=0.02, height=0.06, d3=0:0:1"
FREE = (4.730040744862704, 7.853204624095838)
"""Roots of cosh x cos x = 1: bending of a free Euler beam."""


def straight(count=8, direction=(1.0, 0.0, 0.0)):
    return line_mesh(np.linspace(0.0, L, count + 1)[:, None] * np.array(direction))


def reduced(mesh, section, interfaces, frame="mean", number=20):
    made = mesh_model(mesh, STEEL, section, "m-kg")
    wishes = Wishes(tuple(map(interface_of, interfaces)), Wanted(number), frame)
    body = reduce_model(made.model, wishes).body
    return body, made.errors(body, wishes)


@pytest.mark.parametrize("text", [RECTANGLE, "radius=0.05", "A=1e-3, I2=2e-7, I3=2e-7, J=3e-7"])
def test_a_frame_in_space_resists_no_rigid_motion(text):
    mesh = line_mesh([(0, 0, 0), (1, 0.2, 0), (1.5, 1, 0.3), (0.4, 0.8, -0.6)],
                     [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2)])  # fmt: skip
    model = mesh_model(mesh, STEEL, section_of(text, 0.3), "m-kg").model
    R = rigid_fields(model, np.zeros(3))
    terms = abs(model.stiffness) @ np.abs(R)
    assert np.abs(model.stiffness @ R).max() < 1e-14 * terms.max()
    values = linalg.eigh(model.stiffness.toarray(), model.mass.toarray())[0]
    assert np.abs(values[:6]).max() < 1e-12 * values[-1]
    assert values[6] > 1e-7 * values[-1]


@pytest.mark.parametrize("count", [1, 3])
@pytest.mark.parametrize("rotation", [np.eye(3), linalg.expm([[0, -1, 2], [1, 0, -3], [-2, 3, 0]])])
def test_loads_at_the_tip_give_the_displacements_of_timoshenkos_theory(count, rotation):
    d1, _, d3 = rotation.T
    section = section_of(f"width=0.02, height=0.06, d3={':'.join(map(repr, d3.tolist()))}", 0.3)
    body, _ = reduced(straight(count, d1), section, ["A=1", f"B={count + 1}"], "A", 0)
    tip = np.vstack([rotation.T @ body.interface_shapes[1, :3],
                     rotation.T @ body.interface_shapes[1, 3:]])  # fmt: skip
    found = tip @ np.diag(1.0 / body.eigenvalues) @ tip.T
    A, I2, I3, J, k2, k3 = section.geometry
    E, G = 210e9, 210e9 / 2.6
    exact = np.diag([L / (E * A), L**3 / (3 * E * I3) + L / (k2 * G * A),
                     L**3 / (3 * E * I2) + L / (k3 * G * A), L / (G * J), L / (E * I2),
                     L / (E * I3)])  # fmt: skip
    exact[1, 5] = exact[5, 1] = L**2 / (2 * E * I3)
    exact[2, 4] = exact[4, 2] = -(L**2) / (2 * E * I2)
    # Round-off of the elements' entries, which are 1e3 times the beam's stiffness.
    assert found == pytest.approx(exact, rel=1e-9, abs=1e-12 * exact.max())


def test_mass_and_inertia_are_those_of_the_rods():
    mesh = straight(3)
    made = mesh_model(mesh, STEEL, section_of(RECTANGLE, 0.3), "m-kg")
    A = 0.02 * 0.06
    assert made.volume == pytest.approx(A * L)
    R = rigid_fields(made.model, np.array([0.5, 0.0, 0.0]))
    inertia = R.T @ (made.model.mass @ R) / (7850.0 * A * L)
    assert inertia[:3, :3] == pytest.approx(np.eye(3), abs=1e-13)
    about = np.diag([0.02**2 + 0.06**2, L**2 + 0.06**2, L**2 + 0.02**2]) / 12
    assert inertia[3:, 3:] == pytest.approx(about, rel=1e-12, abs=1e-14)


@pytest.mark.parametrize("count", [8, 16])
def test_the_error_of_the_mesh_is_that_of_euler_beams(count):
    # Without shear factors there is no shear; rotary inertia lowers the frequencies by
    # (k r)^2/2 = 3e-9 here.
    r = 1e-5
    section = section_of(f"A=1e-4, I2={1e-4 * r**2}, I3={1e-4 * r**2}, J={2e-4 * r**2}", 0.3)
    body, errors = reduced(straight(count), section, ["A=1", f"B={count + 1}"], number=40)
    exact = np.array(FREE) ** 2 * np.sqrt(210e9 * r**2 / 7850.0) / (2 * np.pi * L**2)
    true = 1.0 - exact / body.frequencies[[0, 2]]
    # Hermite's functions have the error (k h)^4/1440 of the frequency, to leading order; the next
    # term is below (k h)^2/6 of it, 0.16.
    assert true == pytest.approx((np.array(FREE) / count) ** 4 / 1440, rel=0.16)
    assert errors[[0, 2]] == pytest.approx(true, rel=0.1)


def test_beams_along_the_height_and_of_no_length_are_refused():
    section = section_of(RECTANGLE, 0.3)
    with pytest.raises(ReductionError, match="between the nodes 1, 2 is along d3"):
        mesh_model(straight(1, (0, 0, 1)), STEEL, section, "m-kg")
    mesh = line_mesh([(0, 0, 0), (1, 0, 0), (1, 0, 0)])
    with pytest.raises(ReductionError, match=r"beam 2 \(nodes 2, 3\) has no length"):
        mesh_model(mesh, STEEL, section, "m-kg")
    with pytest.raises(ReductionError, match="give their cross-section"):
        mesh_model(straight(), STEEL, None, "m-kg")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("width=1", "expected the sizes of a section"),
        ("width=1, height=2", "give the direction of its height"),
        ("width=0, height=2, d3=0:0:1", "sizes are positive"),
        ("radius=1, thickness=2", "less than its radius"),
        ("width=1, height=1, flange=0.6, web=0.1", "thicker than the section"),
        ("A=1, I2=1, I3=1", "no J"),
        ("A=1, I2=1, I3=1, J=-1", "are positive"),
        ("A=1, I2=1, I3=1, J=1, radius=2", "unknown property 'radius'"),
        ("radius=x", "radius=x is no number"),
        ("radius=1, radius=1", "expected each property once"),
        ("radius=1, d3=0:0", "expected a direction such as 0:0:1"),
        ("no_such_file", "or their file"),
    ],
)
def test_faults_of_sections(text, message):
    with pytest.raises(ReductionError, match=message):
        section_of(text, 0.3)
