"""Build the system of a model: what depends on its connections, then what depends on its numbers.

collect      model -> elements, by what they act between
topology     elements -> node map, multipliers' places, pattern, index arrays
parameters   elements and topology -> the arrays of the system
"""

from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import add, at, times
from msahl.elements.constraints import coordinates, surfaces
from msahl.elements.constraints.equations import left_side
from msahl.jit.by_size import LARGE
from msahl.jit.recent import Recent
from msahl.model import Model
from msahl.ports import forces
from msahl.system.arrays import System, new_coordinates_workspace
from msahl.system.collect import Elements, collect
from msahl.system.parameters import build_parameters
from msahl.system.topology import Topology, build_topology, connections

_TOPOLOGIES: Recent[Topology] = Recent(32)


class Places(NamedTuple):
    """Positions and orientations of all frames, the ground's last."""

    x: np.ndarray  # (f, 3) origins, inertial axes [m]
    p: np.ndarray  # (f, 3) Wiener-Milenkovic parameters


def build_system(model: Model, relaxed: bool = False, places: Places | None = None) -> System:
    """Return the system of ``model``; ``relaxed`` if its joints are redundant.

    Constants that are what a coordinate is at t = 0 are taken at ``places``, by default those of
    the model.
    """
    elements = collect(model)
    return _with_numbers(elements, topology_of(elements, relaxed), places)


def topology_of(elements: Elements, relaxed: bool) -> Topology:
    """Return the topology of ``elements``, which all small models with the same connections share;
    ``relaxed`` if their joints are redundant.
    """
    if len(elements.model.bodies) >= LARGE:
        return build_topology(elements, relaxed)
    return _TOPOLOGIES.get(
        (connections(elements), relaxed), lambda: build_topology(elements, relaxed)
    )


def rebuild_parameters(model: Model, topology: Topology, places: Places | None = None) -> System:
    """Return the system of ``model``, whose connections are those of ``topology``.

    Raises ``ValueError`` if they are not.
    """
    elements = collect(model)
    if connections(elements) != topology.connections:
        raise ValueError("the model does not connect its elements as the topology has it")
    return _with_numbers(elements, topology, places)


def _with_numbers(elements: Elements, topology: Topology, places: Places | None) -> System:
    system = build_parameters(elements, topology)
    if system.scalar is not None:
        _set_constants(system, places or initial_places(elements.model))
    return system


def initial_places(model: Model) -> Places:
    """Return where the frames are at t = 0, as the model gives it."""
    x, p = np.zeros((2, len(model.bodies) + 1, 3))
    for i, body in enumerate(model.bodies):
        x[i] = add(body.position, times(matrix(body.orientation), body.r_BG))
        p[i] = body.orientation
    return Places(x, p)


def _set_constants(system: System, places: Places) -> None:
    """Set the constants of a new system that are what its coordinates are at ``places``."""
    assert system.scalar is not None
    group, rows = system.scalar.coordinates, system.scalar.equations
    R = np.array([matrix(at(places.p, f)) for f in range(len(places.p))])
    start = new_coordinates_workspace(group)
    coordinates.prepare(group, places.x, R, np.zeros(group.kind.size), start)
    surfaces.choose_axes(group.products.surfaces, group.products, start.products)
    for r in np.flatnonzero(np.isnan(rows.offset)):
        rows.offset[r] = left_side(rows, system.laws, start, int(r))
    forces.set_origins(system.forces, start.value)
