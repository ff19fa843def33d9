"""Interfaces of an elastic body: single nodes, or sets of nodes tied to a point that moves rigidly.

Text of an interface: ``12`` (node 12), ``Tip=12`` (with a name), ``Hub=3,4,10:20`` (a set), and of
a mesh with named sets ``Hub`` or ``Hub=bolt_1,bolt_2``. A set becomes one node at the mean place
of its nodes, with three translations and three rotations, which its nodes follow as parts of a
rigid body: u_k = u + theta x (x_k - x). Joints that transmit moments to solids, whose nodes have
no rotations, need this.
"""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import sparse

from msahl.reduction.elastic_model import ElasticModel
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.rigid import rigid_fields

_PART = re.compile(r"(\d{1,12})(?::(\d{1,12}))?")
_NAME = re.compile(r"[^\W\d]\w*")
_SET = re.compile(r"[^\W\d][^,=]*")


@dataclass(frozen=True, slots=True)
class Interface:
    """An interface by its ``name`` and the ``nodes`` that it consists of, by their labels: ranges
    with both ends; and named ``sets`` of a mesh."""

    name: str
    nodes: tuple[range, ...]
    sets: tuple[str, ...] = ()

    @property
    def is_node(self) -> bool:
        """Whether it is a single node, which keeps the degrees of freedom that it has."""
        return len(self.nodes) == 1 and len(self.nodes[0]) == 1


def interface_of(text: str) -> Interface:
    """Return the interface that a text describes; raises ``ReductionError``."""
    place = f"--interface {shown(text)}"
    name, sign, words = text.partition("=") if "=" in text else (text, "", text)
    names = tuple(word.strip() for word in words.split(","))
    sets = tuple(word for word in names if _SET.fullmatch(word))
    parts = [_PART.fullmatch(word) for word in names if word not in sets]
    if not all(parts) or ((sign or sets) and not _NAME.fullmatch(name.strip())):
        raise ReductionError(
            place, "expected a node such as 12, or Hub=3,4,10:20, or a set of a mesh: Hub=BOLTS"
        )
    ranges = tuple(range(int(m[1]), int(m[2] or m[1]) + 1) for m in parts if m)
    if not all(ranges):
        raise ReductionError(place, "a range begins with its lower number, as in 10:20")
    found = Interface(name.strip(), ranges, sets)
    if not sign and not found.is_node and not sets:
        raise ReductionError(place, f"a set of nodes has a name, as in Hub={shown(text)}")
    return found


@dataclass(frozen=True, eq=False, slots=True)
class Tied:
    """A model whose sets of nodes are tied; by name of the interface the label of its node, and the
    labels of the nodes that it consists of. ``expansion`` (m, m') gives the displacements of the
    model without ties."""

    model: ElasticModel
    nodes: dict[str, int]
    members: dict[str, np.ndarray]
    expansion: sparse.csr_array


def labels_of(model: ElasticModel, interface: Interface) -> np.ndarray:
    """Return the labels of an interface's nodes that the model has; a range may have gaps, but its
    ends and single nodes exist. Raises ``ReductionError``."""
    if interface.sets:
        raise ReductionError(
            model.source,
            f"--interface {interface.name}: '{shown(interface.sets[0])}' is no number of a node; "
            "only meshes have named sets",
        )
    for part in interface.nodes:
        model.node_of(part[0])
        model.node_of(part[-1])
    chosen = np.zeros(len(model.labels), dtype=bool)
    for part in interface.nodes:
        chosen |= (model.labels >= part[0]) & (model.labels <= part[-1])
    return model.labels[chosen]


def tied(model: ElasticModel, interfaces: Sequence[Interface]) -> Tied:
    """Return the model with sets of nodes tied.

    Raises ``ReductionError``: nodes that do not exist, or belong to two interfaces.
    """
    members = {one.name: labels_of(model, one) for one in interfaces}
    _require_apart(model, interfaces, members)
    sets = [one for one in interfaces if not one.is_node]
    first = int(model.labels.max()) + 1
    nodes = {one.name: int(members[one.name][0]) for one in interfaces if one.is_node}
    nodes |= {one.name: first + k for k, one in enumerate(sets)}
    G = sparse.csr_array(sparse.eye_array(model.size))
    if sets:
        model, G = _with_points(model, [members[one.name] for one in sets], first)
    return Tied(model, {one.name: nodes[one.name] for one in interfaces}, members, G)


def _require_apart(
    model: ElasticModel, interfaces: Iterable[Interface], members: dict[str, np.ndarray]
) -> None:
    seen: dict[int, str] = {}
    names: set[str] = set()
    for one in interfaces:
        if one.name in names:
            raise ReductionError(model.source, f"two interfaces have the name {one.name}")
        names.add(one.name)
        for label in members[one.name].tolist():
            if label in seen:
                raise ReductionError(
                    model.source,
                    f"node {label} belongs to the interfaces {seen[label]} and {one.name}; "
                    "a node belongs to one",
                )
            seen[label] = one.name


def _with_points(
    model: ElasticModel, sets: list[np.ndarray], first: int
) -> tuple[ElasticModel, sparse.csr_array]:
    """Return the model in which new nodes, from the label ``first``, carry sets of nodes, and the
    displacements (m, m') of the given one by its own."""
    owner_labels = model.labels[model.owners]
    inside = [np.flatnonzero(np.isin(owner_labels, one)) for one in sets]
    free = np.setdiff1d(np.arange(model.size), np.concatenate(inside))
    points = np.array([model.places[np.isin(model.labels, one)].mean(axis=0) for one in sets])
    columns = [_unit_columns(model.size, free)]
    for rows, point in zip(inside, points, strict=True):
        carried = np.zeros((model.size, 6))
        carried[rows] = rigid_fields(model, point)[rows]
        columns.append(sparse.csc_array(carried))
    G = sparse.csr_array(sparse.hstack(columns))
    count = len(sets)
    tied_model = replace(
        model,
        labels=np.concatenate([model.labels, first + np.arange(count)]),
        places=np.concatenate([model.places, points]),
        owners=np.concatenate(
            [model.owners[free], len(model.labels) + np.repeat(np.arange(count), 6)]
        ),
        components=np.concatenate([model.components[free], np.tile(np.arange(6), count)]),
        mass=sparse.csr_array(G.T @ model.mass @ G),
        stiffness=sparse.csr_array(G.T @ model.stiffness @ G),
        damping=None if model.damping is None else sparse.csr_array(G.T @ model.damping @ G),
    )
    return tied_model, G


def _unit_columns(size: int, rows: np.ndarray) -> sparse.csc_array:
    ones = np.ones(len(rows))
    return sparse.csc_array((ones, (rows, np.arange(len(rows)))), shape=(size, len(rows)))
