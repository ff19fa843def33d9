"""Slips between surfaces: laws that they keep in random configurations of two bodies."""

import numpy as np
import pytest

from msahl.algebra.rotation import compose, from_increment, matrix
from msahl.algebra.vector import at
from msahl.check.directions import frame
from msahl.elements.constraints import coordinates, segments, surfaces
from msahl.elements.constraints.coordinate_jacobians import stiffness
from msahl.elements.constraints.coordinates import part_node
from msahl.model import BoxContact, CapsuleContact, PlaneContact, SphereContact
from msahl.system.arrays import new_coordinates_workspace, node_count
from msahl.system.build import build_system
from msahl.system.state import build_state
from tests.support.models import build_model, free_bodies

A_POINT, B_POINT = (0.3, 0.2, -0.3), (0.4, 0.0, 0.2)
SLANTED = (0.6, 0.0, 0.8)
ENDS = ("C", "B0", "B1", A_POINT, B_POINT)
CONTACTS = {
    "plane": PlaneContact(*ENDS, SLANTED, 0.7, friction=0.3),
    "sphere": SphereContact(*ENDS, 1.5, 0.7, friction=0.3),
    "hollow sphere": SphereContact(*ENDS, -1.5, 0.7, friction=0.3),
    "cylinder": SphereContact(*ENDS, 1.5, 0.7, SLANTED, friction=0.3),
    "hollow cylinder": SphereContact(*ENDS, -1.5, 0.7, SLANTED, friction=0.3),
    "box": BoxContact(*ENDS, (0.2, 0.1, 0.3), 0.05, 0.7, friction=0.3),
    "side of a box": BoxContact(*ENDS, (20.0, 20.0, 0.01), 0.05, 0.7, friction=0.3),
    "capsule": BoxContact(*ENDS, (0.0, 0.0, 0.8), 0.3, 0.7, friction=0.3, axes=frame(SLANTED)),
    "capsules, sides": CapsuleContact(
        *ENDS, SLANTED, (0.0, 0.6, 0.8), 30.0, 30.0, 0.2, 0.7, friction=0.3
    ),
    "capsules, ends": CapsuleContact(
        *ENDS, SLANTED, (0.0, 0.6, 0.8), 0.1, 0.1, 0.2, 0.7, friction=0.3
    ),
    "capsules, side and end": CapsuleContact(
        *ENDS, SLANTED, (0.0, 0.6, 0.8), 30.0, 0.1, 0.2, 0.7, friction=0.3
    ),
    "rim": PlaneContact(*ENDS, SLANTED, 0.7, axis=(0.0, 0.6, 0.8), friction=0.3),
}
every_contact = pytest.mark.parametrize("contact", CONTACTS.values(), ids=CONTACTS)
E = 1e-5
"""Best for a central difference: its error E^2 and round-off eps/E balance near it."""


class Slips:
    """Both slips of a contact, of two bodies in a random configuration, in plain Python."""

    def __init__(self, contact, seed=0):
        self.rng = np.random.default_rng(seed)
        bodies = free_bodies(self.rng, 2).bodies
        model = build_model(bodies, contacts=(contact,))
        self.system = build_system(model)
        self.group = self.system.scalar.coordinates
        self.group.idle[:] = False  # as those of a closed contact are
        self.own = self.system.forces.sliding.along[0]
        state = build_state(model, self.system)
        self.x, self.p = state.x.copy(), state.p.copy()
        self.shape = (node_count(self.system), 3)
        self.v, self.W = self.rng.normal(size=(2, *self.x.shape))
        self.v[-1] = self.W[-1] = 0.0

    def at(self, x, p):
        """The workspace prepared at a configuration."""
        R = np.array([matrix(at(p, f)) for f in range(len(p))])
        start = new_coordinates_workspace(self.group, self.shape[0])
        coordinates.prepare(self.group, x, R, np.zeros(self.group.kind.size), start)
        return start

    def random(self):
        """Unknowns of a large step."""
        Z = np.zeros(self.shape)
        Z[:4] = 0.4 * self.rng.normal(size=(4, 3))
        return Z

    def evaluated(self, Z, start=None):
        start = start or self.at(self.x, self.p)
        coordinates.evaluate(self.group, start, self.system.frames, Z)
        return start

    def rates(self, x, p):
        start, rate = self.at(x, p), np.zeros(self.group.kind.size)
        coordinates.slopes(self.group, start)
        coordinates.rates(self.group, start, self.v, self.W, rate)
        return rate[self.own]

    def moved(self, dt):
        """The configuration after ``dt`` at constant velocities and angular velocities."""
        p = [compose(from_increment(tuple(dt * w)), at(self.p, f)) for f, w in enumerate(self.W)]
        return self.x + dt * self.v, np.array(p)


@every_contact
def test_a_slip_is_that_of_the_material_points(contact):
    """By positions of points fixed in both bodies where they touch, from the shapes alone."""
    slips = Slips(contact)
    R = [np.array(matrix(at(slips.p, f))) for f in range(2)]
    points = [np.array(A_POINT), np.array(B_POINT)]
    arms = [R[f] @ (points[f] - np.array(_r_BG(slips, f))) for f in range(2)]
    D = slips.x[1] + arms[1] - slips.x[0] - arms[0]
    n, touch = _touch(contact, D, R)
    touch = slips.x[1] + arms[1] + touch
    material = [slips.v[f] + np.cross(slips.W[f], touch - slips.x[f]) for f in range(2)]
    relative = material[1] - material[0]
    across = relative - n * (n @ relative)
    assert np.hypot(*slips.rates(slips.x, slips.p)) == pytest.approx(np.linalg.norm(across))
    start = slips.evaluated(np.zeros(slips.shape))
    first, second = start.force[slips.own, 2]
    assert np.cross(first, second) == pytest.approx(n, abs=1e-14)


def _touch(contact, D, R):
    """The normal, and the point of contact from the child's point at ``D`` from the parent's."""
    d = R[0] @ np.array(SLANTED)
    if isinstance(contact, BoxContact):
        own = np.array(contact.axes) @ R[0].T @ D
        E = R[0] @ np.array(contact.axes).T @ (own - np.clip(own, *np.outer((-1, 1), contact.half)))
        return E / np.linalg.norm(E), -contact.radius * E / np.linalg.norm(E)
    if isinstance(contact, CapsuleContact):
        e = R[1] @ np.array(contact.axis)
        half, places = (contact.parent_half, contact.half), (D @ d, D @ e, d @ e)
        u, w, _, _ = segments.feet(half, places)
        E = D + w * e - u * d
        return E / np.linalg.norm(E), w * e - contact.radius * E / np.linalg.norm(E)
    if isinstance(contact, PlaneContact):
        if contact.axis is None:
            return d, -contact.radius * d
        e = R[1] @ np.array(contact.axis)
        across = d - e * (e @ d)
        return d, -contact.radius * across / np.linalg.norm(across)
    n = D if contact.axis is None else D - d * (d @ D)
    n = n / np.linalg.norm(n)
    return n, -np.copysign(contact.radius, contact.parent_radius) * n


def _r_BG(slips, f):
    """Of bodies whose points are given from their mass centres."""
    return slips.system.bodies.r_BG[f]


@every_contact
def test_forces_are_a_wrench_at_one_point(contact):
    """No force and no moment on both bodies together: over a step about the mean positions."""
    slips = Slips(contact, 1)
    Z = slips.random()
    start = slips.evaluated(Z)
    mean = slips.x[:2] + 0.5 * Z[[0, 2]]
    for q in slips.own:
        on_a, moment_a, on_b, moment_b = start.force[q]
        assert on_a + on_b == pytest.approx(np.zeros(3), abs=1e-14)
        total = moment_a + moment_b + np.cross(mean[0], on_a) + np.cross(mean[1], on_b)
        assert total == pytest.approx(np.zeros(3), abs=1e-13)


@every_contact
def test_change_is_the_work_of_the_unit_force(contact):
    slips = Slips(contact, 2)
    Z = slips.random()
    start = slips.evaluated(Z)
    length = slips.system.frames.length
    parts = np.array([Z[0], Z[1] / length[0], Z[2], Z[3] / length[1]])
    for q in slips.own:
        assert start.change[q] == pytest.approx((start.force[q] * parts).sum(), rel=1e-13)


@every_contact
def test_derivatives_are_those_of_differences(contact):
    """Of the changes and of the unit forces by the unknowns of a large step."""
    slips = Slips(contact, 3)
    Z, frames = slips.random(), slips.system.frames
    start = slips.evaluated(Z)
    coordinates.differentiate(slips.group, start, frames, Z)
    for q in slips.own:
        slips.evaluated(Z, start)
        start.load[q] = 1.0
        values = np.zeros_like(slips.system.constant)
        stiffness(slips.group, start, frames, 1.0, Z, values)
        blocks = values.reshape(-1, 3, 3)
        for part in range(4):
            node = part_node(slips.group, frames, q, part)
            for i in range(3):
                ends = []
                for sign in (1.0, -1.0):
                    there = Z.copy()
                    there[node, i] += sign * E
                    F, other = np.zeros(slips.shape), slips.evaluated(there)
                    other.load[q] = 1.0
                    coordinates.push(slips.group, other, frames, 1.0, F)
                    ends.append((other.change[q], F))
                slope = (ends[0][0] - ends[1][0]) / (2.0 * E)
                assert slope == pytest.approx(start.slope[q, part, i], abs=1e-8)
                by_difference = (ends[0][1] - ends[1][1]) / (2.0 * E)
                for row in range(4):
                    block = slips.group.block[q, 4 * row + part]
                    found = blocks[block // 9][:, i]
                    at_node = part_node(slips.group, frames, q, row)
                    assert by_difference[at_node] == pytest.approx(found, abs=1e-8)


@every_contact
def test_second_derivative_is_that_along_a_motion_without_accelerations(contact):
    slips = Slips(contact, 4)
    ends = [slips.rates(*slips.moved(sign * E)) for sign in (1.0, -1.0)]
    start = slips.evaluated(np.zeros(slips.shape))
    for i, q in enumerate(slips.own):
        given = (slips.group, start, slips.v, slips.W, int(q))
        second = coordinates.coordinate_acceleration(*given)
        assert second == pytest.approx((ends[0][i] - ends[1][i]) / (2.0 * E), abs=1e-8)


@every_contact
def test_tangents_do_not_matter(contact):
    """Another axis gives the same slip and the same forces in space."""
    slips, found = Slips(contact, 5), []
    Z = slips.random()
    axis = slips.group.products.surfaces.axis
    for number in range(3):
        axis[:] = number
        start = slips.evaluated(Z)
        change, force = start.change[slips.own], start.force[slips.own]
        found.append(np.einsum("q,qpi->pi", change, force))
    assert found[1] == pytest.approx(found[0], abs=1e-13)
    assert found[2] == pytest.approx(found[0], abs=1e-13)


def test_axes_are_those_across_the_normal():
    slips = Slips(CONTACTS["sphere"], 6)
    start, m = slips.at(slips.x, slips.p), slips.group.products
    m.surfaces.axis[:] = 2
    start.products.D[:] = (0.1, 0.05, 1.0)
    assert surfaces.choose_axes(m.surfaces, m, start.products)
    assert not surfaces.choose_axes(m.surfaces, m, start.products)
    of_slips = m.kind == surfaces.SURFACE
    assert m.surfaces.axis[of_slips].tolist() == [1, 1]
