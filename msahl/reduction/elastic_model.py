"""Elastic models: nodes with places, their degrees of freedom, matrices of mass and stiffness.

    M u" + C u' + K u = f

u   displacements of the nodes: up to three translations [m] and three rotations [rad] at each
M   mass [kg, kg-m, kg-m^2], K stiffness [N/m, N, N-m], C damping, all (m, m), symmetric

Components 0, 1, 2 are translations along x, y, z, components 3, 4, 5 rotations about them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from msahl.reduction.faults import ReductionError

COMPONENTS = ("x", "y", "z", "rx", "ry", "rz")
MOST_EQUATIONS = 5_000_000
"""Degrees of freedom of the largest model read."""
LARGEST = 1e30
"""Largest entry of a matrix, and 1e15 m is the farthest place: products stay finite."""
FARTHEST = 1e15
ASYMMETRY = 1e-6
"""Largest difference between M[i, j] and M[j, i], by the geometric mean of their diagonals: that of
text with seven digits, the fewest that finite-element programs write."""


@dataclass(frozen=True, eq=False, slots=True)
class ElasticModel:
    """An elastic body by its nodes and matrices, in SI units.

    Node k has the number ``labels[k]`` and is at ``places[k]``; row i of the matrices is component
    ``components[i]`` of node ``owners[i]``. ``interface`` are the labels that the file names.
    """

    source: str
    labels: np.ndarray  # (n,)
    places: np.ndarray  # (n, 3) [m]
    owners: np.ndarray  # (m,)
    components: np.ndarray  # (m,)
    mass: sparse.csr_array  # (m, m)
    stiffness: sparse.csr_array  # (m, m)
    damping: sparse.csr_array | None = None
    interface: tuple[int, ...] = ()

    @property
    def size(self) -> int:
        """Number of degrees of freedom."""
        return len(self.owners)

    def rows_of(self, node: int) -> np.ndarray:
        """Return the rows of a node, by its index."""
        return np.flatnonzero(self.owners == node)

    def node_of(self, label: int) -> int:
        """Return the index of a node; raises ``ReductionError`` if there is none of this label."""
        found = np.flatnonzero(self.labels == label)
        if len(found) == 0:
            few = ", ".join(map(str, self.labels[:5]))
            raise ReductionError(
                self.source, f"there is no node {label}; the first of {len(self.labels)} are {few}"
            )
        return int(found[0])

    def row_name(self, row: int) -> str:
        """Return a row for a message."""
        label = self.labels[self.owners[row]]
        return f"node {label}, component {COMPONENTS[self.components[row]]}"


@dataclass(frozen=True, eq=False, slots=True)
class Nodes:
    """Nodes of a file: labels (n,) and places (n, 3)."""

    labels: np.ndarray
    places: np.ndarray


@dataclass(frozen=True, eq=False, slots=True)
class Matrices:
    """Matrices of a file: row i of each is component ``components[i]`` of the node with the label
    ``labels[i]``."""

    labels: np.ndarray  # (m,)
    components: np.ndarray  # (m,)
    mass: sparse.csr_array
    stiffness: sparse.csr_array
    damping: sparse.csr_array | None = None


def build_model(
    source: str, nodes: Nodes, given: Matrices, interface: Sequence[int] = ()
) -> ElasticModel:
    """Return the checked model of nodes and matrices, in SI units, its rows in the order of nodes.

    Raises ``ReductionError``: nodes or rows that appear twice or are missing, matrices that no
    elastic body has.
    """
    _require_one_of_each(source, nodes.labels)
    order = np.argsort(nodes.labels, kind="stable")
    labels, places = nodes.labels[order], nodes.places[order]
    owners = np.searchsorted(labels, given.labels)
    missing = (owners == len(labels)) | (
        labels[np.minimum(owners, len(labels) - 1)] != given.labels
    )
    if missing.any():
        label = given.labels[np.argmax(missing)]
        raise ReductionError(
            source, f"node {label} has no place; give the file that has, by --nodes"
        )
    rows = np.lexsort((given.components, owners))
    used = np.unique(owners)
    model = ElasticModel(
        source,
        labels[used],
        places[used],
        np.searchsorted(used, owners[rows]),
        given.components[rows],
        _symmetric(given.mass, rows),
        _symmetric(given.stiffness, rows),
        None if given.damping is None else _symmetric(given.damping, rows),
        tuple(int(label) for label in interface),
    )
    _check(model, given, rows)
    return _without_empty_rows(model)


def _require_one_of_each(source: str, labels: np.ndarray) -> None:
    values, counts = np.unique(labels, return_counts=True)
    if len(values) == 0:
        raise ReductionError(source, "there are no nodes; give the file that has them, by --nodes")
    if counts.max() > 1:
        raise ReductionError(source, f"node {values[np.argmax(counts)]} appears twice; delete one")


def _symmetric(A: sparse.csr_array, rows: np.ndarray) -> sparse.csr_array:
    A = sparse.csr_array(A)[rows][:, rows]
    return sparse.csr_array(0.5 * (A + A.T))


def _check(model: ElasticModel, given: Matrices, rows: np.ndarray) -> None:
    """Raise ``ReductionError`` for matrices that no elastic body has."""
    again = (np.diff(model.owners) == 0) & (np.diff(model.components) == 0)
    if again.any():
        name = model.row_name(int(np.argmax(again)))
        raise ReductionError(model.source, f"{name} has two rows; delete one")
    near = (np.abs(model.places) <= FARTHEST).all(axis=1)
    if not near.all():
        label = model.labels[np.argmin(near)]
        raise ReductionError(model.source, f"node {label}: its place is not finite; correct it")
    matrices = {"mass": given.mass, "stiffness": given.stiffness, "damping": given.damping}
    for what, A in matrices.items():
        if A is not None:
            _check_matrix(model, what, sparse.csr_array(A)[rows][:, rows])


def _check_matrix(model: ElasticModel, what: str, A: sparse.csr_array) -> None:
    wrong = ~(np.abs(A.data) <= LARGEST)
    if wrong.any():
        row = int(np.searchsorted(A.indptr, np.argmax(wrong), "right")) - 1
        raise ReductionError(
            model.source,
            f"{model.row_name(row)}: its {what} is not finite, or above {LARGEST:g}; correct it",
        )
    diagonal = A.diagonal()
    if (diagonal < 0.0).any():
        row = int(np.argmin(diagonal))
        raise ReductionError(
            model.source,
            f"{model.row_name(row)}: its {what} is {diagonal[row]:g}; none is negative",
        )
    difference = abs(A - A.T).tocoo()
    scale = np.sqrt(diagonal[difference.row] * diagonal[difference.col])
    wrong = difference.data > ASYMMETRY * np.maximum(scale, 1e-12 * diagonal.max(initial=0.0))
    if wrong.any():
        k = int(np.argmax(wrong))
        a, b = model.row_name(int(difference.row[k])), model.row_name(int(difference.col[k]))
        raise ReductionError(
            model.source,
            f"the {what} between {a} and {b} differs by {difference.data[k]:.3g} from its "
            "transpose; an elastic body has symmetric matrices",
        )


def _without_empty_rows(model: ElasticModel) -> ElasticModel:
    """Return the model without degrees of freedom that have neither mass nor stiffness, as
    rotations of solids' nodes in files that list all six."""
    kept = np.flatnonzero((model.stiffness.diagonal() > 0.0) | (model.mass.diagonal() > 0.0))
    if len(kept) == 0:
        raise ReductionError(model.source, "the matrices are zero; give those of an elastic body")
    if len(kept) == model.size:
        return model
    return select_rows(model, kept)


def select_rows(model: ElasticModel, kept: np.ndarray) -> ElasticModel:
    """Return the model with these rows alone."""
    damping = model.damping
    return replace(
        model,
        owners=model.owners[kept],
        components=model.components[kept],
        mass=model.mass[kept][:, kept],
        stiffness=model.stiffness[kept][:, kept],
        damping=None if damping is None else damping[kept][:, kept],
    )
