"""Elements of a beam: their ends, nodes by number and by place, loads per length at nodes."""

from collections.abc import Collection

import numpy as np

from msahl.elements.beams.shape import node_stations, shape
from msahl.records import record

SAME = 1e-9
"""Distance of two places, relative to the beam's length, that counts as zero."""


@record
class Mesh:
    """Elements of a ``degree`` between ``ends``, relative arc lengths from 0 to 1."""

    degree: int
    ends: tuple[float, ...]

    @property
    def count(self) -> int:
        """Number of nodes."""
        return (len(self.ends) - 1) * self.degree + 1

    @property
    def stations(self) -> np.ndarray:
        """Relative arc lengths (count,) of the nodes."""
        return node_stations(self.degree, np.diff(self.ends))

    def node_at(self, station: float) -> int:
        """Return the number, from 1, of the node at a ``station`` where an element ends."""
        element = int(np.abs(np.array(self.ends) - station).argmin())
        return element * self.degree + 1

    def shares(self, start: float, end: float, first: float, last: float) -> dict[int, float]:
        """Return by number of node the integral of its share of a load per length between two ends
        of elements, ``first`` at ``start`` and ``last`` at ``end``, linear between; the beam's
        length is 1. Lobatto's formula, as for the masses."""
        found: dict[int, float] = {}
        stations, weights = self.stations, shape(self.degree).node_weights
        for e, (low, high) in enumerate(zip(self.ends, self.ends[1:], strict=False)):
            if low < start - SAME or high > end + SAME:
                continue
            for a, weight in enumerate(weights):
                node = e * self.degree + a
                load = first + (last - first) * (stations[node] - start) / (end - start)
                share = 0.5 * (high - low) * float(weight) * load
                found[node + 1] = found.get(node + 1, 0.0) + share
        return found


def mesh(degree: int, elements: int, stations: Collection[float]) -> Mesh:
    """Return a mesh of ``elements`` of nearly equal lengths, of which some end at the ``stations``
    (relative arc lengths); of more elements if the stations need them."""
    ends = [0.0]
    for station in sorted(stations):
        if SAME < station < 1.0 - SAME and station > ends[-1] + SAME:
            ends.append(station)
    ends.append(1.0)
    lengths = np.diff(ends)
    parts = np.ones(lengths.size, dtype=int)
    for _ in range(elements - lengths.size):
        # Quotients that differ by rounding alone are equal: the first of them is divided.
        parts[int((lengths / parts > (1.0 - SAME) * (lengths / parts).max()).argmax())] += 1
    pieces = [
        low + (high - low) * np.arange(n) / n
        for low, high, n in zip(ends, ends[1:], parts, strict=False)
    ]
    return Mesh(degree, (*np.concatenate(pieces).tolist(), 1.0))
