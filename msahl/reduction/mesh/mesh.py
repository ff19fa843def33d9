"""Meshes: nodes, elements by their kind, and named sets of nodes."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from msahl.reduction.faults import ReductionError

SOLIDS = {
    "tetra": 4,
    "tetra10": 10,
    "hexahedron": 8,
    "hexahedron20": 20,
    "hexahedron27": 27,
}
"""Elements of solids and how many nodes each has, in the order of VTK."""
BEAM = "line"
FLAT = ("vertex", "line", "triangle", "quad")
"""Beginnings of the names of elements that have no volume: those of sets, beside solids."""


@dataclass(frozen=True, eq=False, slots=True)
class Mesh:
    """Nodes that elements use, with ``labels`` (n,) in rising order and ``places`` (n, 3) in the
    unit of the file; ``elements`` by kind, with the indices (e, k) of their nodes; ``sets`` of
    nodes by name, as labels; ``ignored`` numbers of other elements by kind."""

    source: str
    labels: np.ndarray
    places: np.ndarray
    elements: Mapping[str, np.ndarray]
    sets: Mapping[str, np.ndarray]
    ignored: Mapping[str, int]

    @property
    def is_solid(self) -> bool:
        """Whether its elements are solids, not beams."""
        return BEAM not in self.elements


def build_mesh(
    source: str,
    labels: np.ndarray,
    places: np.ndarray,
    cells: Iterable[tuple[str, np.ndarray]],
    sets: Mapping[str, np.ndarray],
) -> Mesh:
    """Return the checked mesh of nodes and elements by kind, whose nodes are indices into
    ``labels``; ``sets`` are indices too. Raises ``ReductionError``."""
    kinds: dict[str, list[np.ndarray]] = {}
    for kind, nodes in cells:
        if len(nodes):
            kinds.setdefault(kind, []).append(np.asarray(nodes, dtype=np.int64))
    joined = {kind: np.concatenate(parts) for kind, parts in kinds.items()}
    chosen = _chosen(source, joined)
    used = np.unique(np.concatenate([nodes.ravel() for nodes in chosen.values()]))
    if used[0] < 0 or used[-1] >= len(labels):
        raise ReductionError(source, "an element has a node that does not exist; correct it")
    used = used[np.argsort(labels[used], kind="stable")]
    _require_labels(source, labels[used])
    index = np.full(len(labels), -1)
    index[used] = np.arange(len(used))
    if not np.isfinite(places[used]).all():
        label = labels[used][~np.isfinite(places[used]).all(axis=1)][0]
        raise ReductionError(source, f"node {label}: its place is not finite; correct it")
    mesh = Mesh(
        source,
        labels[used],
        places[used],
        {kind: index[nodes] for kind, nodes in chosen.items()},
        {name: labels[one[index[one] >= 0]] for name, one in sets.items()},
        {kind: len(nodes) for kind, nodes in joined.items() if kind not in chosen},
    )
    _require_one_part(mesh)
    return mesh


def _chosen(source: str, kinds: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Return the elements that make the body: solids if there are any, else beams."""
    for kind in kinds:
        if kind not in SOLIDS and not kind.startswith(FLAT):
            raise ReductionError(
                source, f"elements '{kind}' are not read; make the mesh of {', '.join(SOLIDS)}"
            )
    solids = {kind: nodes for kind, nodes in kinds.items() if kind in SOLIDS}
    if solids:
        return solids
    if set(kinds) - {BEAM, "vertex"} or BEAM not in kinds:
        found = ", ".join(kinds) or "none"
        raise ReductionError(
            source, f"it has no solid elements ({', '.join(SOLIDS)}) and is no mesh of beams "
            f"(lines of two nodes) alone; its elements: {found}",
        )  # fmt: skip
    return {BEAM: kinds[BEAM]}


def _require_labels(source: str, labels: np.ndarray) -> None:
    again = np.flatnonzero(np.diff(labels) == 0)
    if len(again):
        raise ReductionError(source, f"node {labels[again[0]]} appears twice; delete one")


def _require_one_part(mesh: Mesh) -> None:
    """Raise ``ReductionError`` for parts that share no nodes."""
    rows, columns = [], []
    for nodes in mesh.elements.values():
        rows.append(np.repeat(nodes[:, 0], nodes.shape[1] - 1))
        columns.append(nodes[:, 1:].ravel())
    at = np.concatenate(rows), np.concatenate(columns)
    size = len(mesh.labels)
    links = sparse.coo_array((np.ones(len(at[0])), at), shape=(size, size))
    count, part = connected_components(links, directed=False)
    if count > 1:
        other = mesh.labels[np.flatnonzero(part != part[0])[0]]
        raise ReductionError(
            mesh.source,
            f"it has {count} parts that share no nodes: node {mesh.labels[0]} belongs to one, node "
            f"{other} to another; merge the nodes at which they meet",
        )
