"""Build the record of a beam and those of its nodes from geometry and section.

The mass of an element is that of Lobatto's quadrature: each node has its weight times the section's
mass and inertia by length, summed over the elements that it belongs to.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import parameters
from msahl.algebra.vector import ZERO
from msahl.elements.beams.shape import gauss_stations, node_stations, shape, strains
from msahl.model.beams import Beam, Section, Six
from msahl.model.bodies import RigidBody

UNDAMPED: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class Line(NamedTuple):
    """The unstressed reference line: elements of a ``degree`` and of ``lengths`` [m], their nodes.

    ``node_stations`` says at which arc lengths nodes are.
    """

    degree: int
    lengths: np.ndarray  # (elements,)
    positions: np.ndarray  # (nodes, 3) inertial axes [m]
    axes: np.ndarray  # (nodes, 3, 3) with the columns d_1, along the line, d_2 and d_3


def node_names(name: str, count: int) -> tuple[str, ...]:
    """Return the names of the bodies that are the nodes of a beam."""
    return tuple(f"{name}.{k}" for k in range(1, count + 1))


def build_beam(
    name: str,
    line: Line,
    section: Section | Callable[[float], Section],
    damping: Six = UNDAMPED,
) -> tuple[Beam, tuple[RigidBody, ...]]:
    """Return the beam and its nodes, unstressed and at rest; a ``section`` that changes is a
    function of the arc length [m].
    """
    degree, lengths = line.degree, np.asarray(line.lengths, dtype=float)
    stations = node_stations(degree, lengths)
    names = node_names(name, stations.size)
    shares = node_shares(degree, lengths)
    bodies = (
        _node(names[a], shares[a], _section_at(section, stations[a]), parts)
        for a, parts in enumerate(zip(line.positions, parameters(line.axes), strict=True))
    )
    beam = Beam(
        name=name,
        degree=degree,
        nodes=names,
        lengths=tuple(lengths.tolist()),
        stations=tuple(stations.tolist()),
        compliance=tuple(
            _section_at(section, s).compliance for s in gauss_stations(degree, lengths)
        ),
        strain=_rows(strains(degree, lengths, line.positions, line.axes)),
        damping=damping,
    )
    return beam, tuple(bodies)


def node_shares(degree: int, lengths: Sequence[float] | np.ndarray) -> np.ndarray:
    """Return the length [m] (nodes,) of which each node has the mass."""
    shares = np.zeros(len(lengths) * degree + 1)
    for e, length in enumerate(lengths):
        shares[e * degree : e * degree + degree + 1] += 0.5 * length * shape(degree).node_weights
    return shares


def _section_at(section: Section | Callable[[float], Section], station: float) -> Section:
    return section if isinstance(section, Section) else section(float(station))


def _node(name: str, share: float, section: Section, parts: Any) -> RigidBody:
    position, orientation = parts
    return RigidBody(
        name=name,
        mass=float(share * section.mass),
        r_BG=section.center,
        inertia=_rows(share * np.array(section.inertia)),
        position=tuple(position.tolist()),
        orientation=tuple(orientation.tolist()),
        velocity=ZERO,
        angular_velocity=ZERO,
    )


def _rows(array: np.ndarray) -> Any:
    """Return the rows of an array as tuples."""
    return tuple(tuple(row) for row in array.tolist())
