"""What load cards of a body need, whatever the program that reads them.

The mesh is in the axes of the body, with its B as the origin, in m, kg, s and N, and has the mass
distribution of the body. Its own elements then make the inertia loads of their accelerations:

    f(r) = rho (g - a_G - alpha x (r - r_G) - omega x (omega x (r - r_G)))
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.model import Model
from msahl.post.loads.wrenches import LOAD, REACTION, Instant, Motion

FIRST_NODE = 9000001
"""Number of the node at the mass centre; points of loads follow. Most meshes have lower ones."""
SAME = 1e-9
"""Distance [m] of points that are one node."""


class Case(NamedTuple):
    """Loads of a body at a time [s]: the sum of forces and moments (6,) at each node, by number,
    and its motion."""

    time: float
    loads: dict[int, np.ndarray]
    motion: Motion


class BodyCards(NamedTuple):
    """The nodes of a body by number, each (3,) [m], the first is its mass centre; and its loads at
    every instant."""

    body: str
    nodes: dict[int, np.ndarray]
    cases: list[Case]
    inertia: np.ndarray  # (3, 3) about the mass centre [kg m^2]


def cards_of(model: Model, instants: Sequence[Instant]) -> list[BodyCards]:
    """Return the loads of each body with numbered nodes."""
    return [
        _cards(body.name, np.array(body.r_BG), np.array(body.inertia), instants)
        for body in model.bodies
    ]


def _cards(
    name: str, centre: np.ndarray, inertia: np.ndarray, instants: Sequence[Instant]
) -> BodyCards:
    nodes = {FIRST_NODE: centre}
    cases = []
    for instant in instants:
        loads: dict[int, np.ndarray] = {}
        for one in instant.loads:
            if one.body == name and one.kind in (REACTION, LOAD):
                node = _node(one.point, nodes)
                components = np.concatenate([one.force, one.moment])
                loads[node] = loads.get(node, np.zeros(6)) + components
        cases.append(Case(instant.time, loads, instant.motions[name]))
    return BodyCards(name, nodes, cases, inertia)


def _node(point: np.ndarray, nodes: dict[int, np.ndarray]) -> int:
    """Return the number of the node at a point, a new one if there is none."""
    for number, there in nodes.items():
        if np.abs(there - point).max() <= SAME:
            return number
    nodes[FIRST_NODE + len(nodes)] = point
    return FIRST_NODE + len(nodes) - 1


def size(vector: np.ndarray) -> float:
    """Return the length of a vector."""
    return float(np.sqrt(vector @ vector))
