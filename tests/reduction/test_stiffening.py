"""Displacements of second order: against rods whose strains are integrated as they are."""

from dataclasses import fields

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from msahl.reduction.body import body_bytes, read_body_bytes
from msahl.reduction.faults import ReductionError
from msahl.reduction.mesh.beams import element_axes
from msahl.reduction.mesh.material import Material, section_of
from msahl.reduction.mesh.second_order import UP_TO, WEIGHTS, Beams, _element, _sections
from tests.reduction.meshes import line_mesh
from tests.reduction.stiffened import blade, stiffened

CORNERS = np.array([(0.0, 0.0, 0.0), (0.5, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.3, 0.2)])
TEXT = "A=1e-2, I2=8e-6, I3=2e-5, J=1.5e-5, k2=0.8, k3=0.8, d3=0:0:1"
STEEL = Material(E=210e9, nu=0.3, rho=7850.0)
PIECES = 200
"""Steps of an element: the error of the exponentials is their square."""


@pytest.fixture(scope="module")
def frame():
    """A bent rod that shears, with nodes at both ends."""
    return stiffened(CORNERS, TEXT, STEEL, ("Root=1", "Tip=4"), 3)


def rod(found, a):
    """Rotation and place of the tip, seen from the root, of the rod with the strains of the
    amplitudes ``a``: the pieces of each element have constant strains."""
    mesh, section = line_mesh(CORNERS), section_of(TEXT, STEEL.nu)
    axes = element_axes(mesh, section)
    body = found.body
    made = _sections(Beams(mesh, STEEL, section, 1.0), body.invariants.mass)
    R, r = Rotation.identity(), np.zeros(3)
    for e, nodes in enumerate(mesh.elements["line"]):
        one = _element(axes[e], nodes, made, body, found.rotations)
        ends = found.rotations[nodes] @ a
        # The derivative of a rotation that is quadratic in an element is linear in it.
        first = one.theta_dot @ a
        inside = (UP_TO.sum(axis=1))[:, None]
        slope, start = np.polyfit(inside[:, 0], first, 1)
        assert ends[1] - ends[0] == pytest.approx(one.length * (WEIGHTS @ first), abs=1e-12)
        h = one.length / PIECES
        for x in (np.arange(PIECES) + 0.5) / PIECES:
            k = start + slope * x
            middle = R * Rotation.from_rotvec(0.5 * h * k)
            r = r + h * middle.apply(one.along + one.gamma @ a)
            R = R * Rotation.from_rotvec(h * k)
    return R, r


def tip(found, a):
    """The same by the displacements of first and second order of both nodes."""
    body, places = found.body, found.body.interface_places
    forms = np.einsum("pcjk,j,k->pc", body.stiffening.interface, a, a)
    moved, rotated = np.split(body.interface_shapes @ a + forms, 2, axis=1)
    theta = body.interface_shapes[:, 3:] @ a
    R = [np.eye(3) + cross(rotated[p]) + 0.5 * cross(theta[p]) @ cross(theta[p]) for p in range(2)]
    return R[0].T @ R[1], R[0].T @ (places[1] + moved[1] - places[0] - moved[0])


def cross(a):
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def test_displacements_are_those_of_the_exact_rod(frame):
    """What is left is of third order in the rotations of up to 0.02 rad: a second amplitude of half
    the size has an eighth of it."""
    q = frame.body.eigenvalues.size
    a = np.random.default_rng(3).normal(size=q)
    a *= 0.02 / np.abs(frame.body.interface_shapes[:, 3:] @ a).max()
    errors = []
    for part in (1.0, 0.5):
        (R, r), (A, x) = rod(frame, part * a), tip(frame, part * a)
        errors.append((np.abs(r - x).max(), np.abs(R.as_matrix() - A).max()))
    of_second = 0.02**2  # the size of what is tested
    assert np.all(np.array(errors[0]) < 0.1 * of_second)
    assert np.log2(np.divide(*errors)) == pytest.approx(3.0, abs=0.2)


def test_the_shortening_of_a_blade_is_half_the_integral_of_its_slope_squared():
    """integral of x psi_x dm of the first mode, against the free beam's closed form."""
    body = blade().body
    moment = body.stiffening.moment
    assert moment == pytest.approx(moment.transpose(1, 0, 2, 3), abs=1e-9)
    # psi_x' = -w'^2/2, so the integral of x psi_x over the mass about its centre is that of
    # -(1/4 - x^2)/2 w'^2/2, by parts; w is the first free mode by the nodes, whose slope is -ry.
    x = body.node_places[:, 0]
    w = body.node_shapes[:, 2, 0]
    slope = np.gradient(w, x, edge_order=2)
    wanted = np.trapezoid(-0.25 * (0.25 - x**2) * slope**2, x)
    # Differences of 40 elements: (2.5 %)^2 times the curvature of the slope.
    assert moment[0, 0, 0, 0] == pytest.approx(wanted, rel=1e-2)


def test_files_have_the_stiffening():
    body = blade(2).body
    again = read_body_bytes("x", body_bytes(body)).stiffening
    for one in fields(again):
        assert np.array_equal(getattr(again, one.name), getattr(body.stiffening, one.name))


def test_loops_are_refused():
    square = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)])
    with pytest.raises(ReductionError, match="its beams form loops"):
        stiffened(square, pairs=np.array([[0, 1], [1, 2], [2, 0]]))
