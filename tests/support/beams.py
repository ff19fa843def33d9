"""Beams for tests."""

from dataclasses import replace

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import ZERO
from msahl.elements.beams.build import Line, build_beam
from msahl.elements.beams.shape import node_stations
from msahl.model import Joint, Section
from tests.support.models import GROUND, build_model


def straight(degree, elements, length=1.0, direction=0.0):
    """A line along x, rotated about z by ``direction``, with d_2 in the plane x, y."""
    lengths = np.full(elements, length / elements)
    c, s = np.cos(direction), np.sin(direction)
    axes = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    stations = node_stations(degree, lengths)
    return Line(
        degree, lengths, stations[:, None] * axes[:, 0], np.tile(axes, (stations.size, 1, 1))
    )


def arc(degree, elements, radius, angle):
    """An arc of a circle in the plane x, y that begins at the origin along x and bends to y."""
    lengths = np.full(elements, radius * angle / elements)
    phi = node_stations(degree, lengths) / radius
    zero, c, s = np.zeros_like(phi), np.cos(phi), np.sin(phi)
    positions = radius * np.stack([s, 1.0 - c, zero], axis=1)
    axes = np.stack([[c, -s, zero], [s, c, zero], [zero, zero, 1.0 + zero]]).transpose(2, 0, 1)
    return Line(degree, lengths, positions, axes)


def section(stiffness, mass=1.0, inertia=(2e-3, 1e-3, 1e-3), **others):
    """A section of the six ``stiffness`` EA, GA2, GA3, GJ, EI2, EI3; infinite ones are rigid."""
    compliance = np.diag(1.0 / np.array(stiffness, dtype=float))
    rows = tuple(tuple(row) for row in compliance.tolist())
    tensor = tuple(tuple(row) for row in np.diag(np.array(inertia, dtype=float)).tolist())
    return Section(rows, mass, tensor, **others)


ELASTIC = (1e4, 4e3, 4e3, 10.0, 12.0, 15.0)
STIFF = (1e9, 4e8, 4e8, 1e3, 2e3, 2e3)
FLEXIBLE = (np.inf, np.inf, np.inf, 1.0, 1.2, 1.5)
"""Six stiffnesses of sections: EA, GA2, GA3, GJ, EI2, EI3 [N, N m^2]."""


def free_beam(rng, degree, elements, stiffness, damping=(0.0,) * 6, **of_section):
    """A curved beam that nothing holds, thrown, spun and shaken."""
    line = arc(degree, elements, radius=1.0, angle=1.2)
    beam, nodes = build_beam("Beam", line, section(stiffness, **of_section), damping)
    v, w, shake = rng.normal(size=3), 2.0 * rng.normal(size=3), np.array([0.2, 0.7, -0.6])

    def thrown(node):
        R = np.array(matrix(node.orientation))
        velocity = v + np.cross(w, node.position) + np.sin(3.0 * node.position[0]) * shake
        spin = tuple((R.T @ w).tolist())
        return replace(node, velocity=tuple((R.T @ velocity).tolist()), angular_velocity=spin)

    return build_model(map(thrown, nodes), beams=(beam,), dt=0.05)


def cantilever(degree, elements, stiffness, damping=(0.0,) * 6, length=1.0, **model):
    """A straight beam along x clamped to the ground at its first node."""
    line = straight(degree, elements, length)
    of_section = {k: model.pop(k) for k in ("mass", "inertia", "center") if k in model}
    beam, nodes = build_beam("Beam", line, section(stiffness, **of_section), damping)
    clamp = Joint("Clamp", "rigid", GROUND.name, nodes[0].name, ZERO, ZERO)
    return build_model(nodes, [clamp], beams=(beam,), **model)
