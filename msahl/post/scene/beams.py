"""Beams of a scene: outlines that are swept along the nodes, and what strains follow from."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from msahl.elements.beams.shape import interpolation, shape
from msahl.model import Beam, BeamShape, Model
from msahl.post.scene.geometry import floats, ring_faces
from msahl.run.beam_table import stiffness_of

Entry = dict[str, Any]
RINGS = 3
"""Outlines that are drawn between two nodes, on average."""
PLAIN = 0.01
"""Radius of a beam without an outline, divided by its length."""


def node_beams(model: Model) -> dict[str, int]:
    """Return the number of the beam that each node belongs to, by the name of the node."""
    return {name: index for index, beam in enumerate(model.beams) for name in beam.nodes}


def beam_entries(model: Model, body: Mapping[str, int], colours: Sequence[str]) -> list[Entry]:
    """Return the beams; a colour that the deck does not give is the first node's of ``colours``."""
    shapes = {one.beam: one for one in model.beam_shapes}
    return [_entry(beam, shapes.get(beam.name), body, colours) for beam in model.beams]


def _entry(
    beam: Beam, looks: BeamShape | None, body: Mapping[str, int], colours: Sequence[str]
) -> Entry:
    nodes = [body[name] for name in beam.nodes]
    outlines = outlines_of(beam, looks)
    element = shape(beam.degree)
    places = np.linspace(-1.0, 1.0, RINGS * beam.degree + 1)
    return {
        "name": beam.name,
        "nodes": nodes,
        "colour": (looks.colour if looks else "") or colours[nodes[0] % len(colours)],
        "degree": beam.degree,
        "lengths": floats(beam.lengths),
        "outlines": [floats(outline.ravel()) for outline in outlines],
        "rings": [floats(row) for row in interpolation(element.nodes, places)[0]],
        "values": [floats(row) for row in element.values],
        "slopes": [floats(row) for row in element.slopes],
        "fromPoints": [floats(row) for row in interpolation(element.points, places)[0]],
        "strain": [floats(row) for row in beam.strain],
        "stiffness": [floats(stiffness_of(np.array(C)).ravel()) for C in beam.compliance],
    }


def outlines_of(beam: Beam, looks: BeamShape | None) -> np.ndarray:
    """Return the corners y, z (2, c, 2) of both ends [m]; of a square if they are not known."""
    if looks is not None:
        return np.array([looks.start, looks.end])
    r = PLAIN * sum(beam.lengths)
    square = [[-r, -r], [r, -r], [r, r], [-r, r]]
    return np.array([square, square])


def rings_at_nodes(entry: Entry) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners of the outline at each node (nodes, c, 3) in its axes [m], and the faces
    (n, 3) of the surface, whose corners are counted node by node."""
    start, end = (np.array(outline).reshape(-1, 2) for outline in entry["outlines"])
    count, corners = len(entry["nodes"]), len(start)
    degree = entry["degree"]
    share = np.concatenate([[0.0], np.cumsum(entry["lengths"])])
    inner = 0.5 * (1.0 + shape(degree).nodes)[:-1]
    stations = np.append((share[:-1, None] + np.diff(share)[:, None] * inner).ravel(), share[-1])
    t = (stations / share[-1])[:, None, None]
    rings = np.zeros((count, corners, 3))
    rings[..., 1:] = (1.0 - t) * start + t * end
    last = (count - 1) * corners
    ends = []
    for c in range(1, corners - 1):
        ends += [[0, c + 1, c], [last, last + c, last + c + 1]]
    return rings, np.concatenate([ring_faces(count, corners), ends])
