"""Beams for tests."""

import numpy as np

from msahl.elements.beams.build import Line
from msahl.elements.beams.shape import node_stations
from msahl.model import Section


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
