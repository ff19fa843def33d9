"""Reduction of an elastic model to a body with a floating frame, and of a file's."""

from dataclasses import dataclass, replace

import numpy as np

from msahl.reduction.body import ReducedBody
from msahl.reduction.craig_bampton import Basis, craig_bampton
from msahl.reduction.elastic_model import ElasticModel
from msahl.reduction.errors import ReductionErrors, reduction_errors
from msahl.reduction.faults import ReductionError
from msahl.reduction.floating import FloatingModes, floating_modes, require_free
from msahl.reduction.interfaces import Interface, Tied, tied
from msahl.reduction.invariants import invariants
from msahl.reduction.modal import ModalModel
from msahl.reduction.normal_modes import Wanted
from msahl.reduction.read import Files, read_model
from msahl.reduction.rigid import EPSILON, mass_centre, rigid_fields

MEAN = "mean"
"""The floating frame of mean axes."""
FEWEST_RIGID = 6
LEAST_HOLD = 1e-6
"""Smallest singular value of the interface's rigid displacements, by the largest, with arms
measured by their own size: with less, small loads at the interface strain the body enormously."""
DEFAULT = Wanted(10)
STIFFENED = "geometric stiffening is known of meshes of beams only"


@dataclass(frozen=True, slots=True)
class Wishes:
    """What to reduce to: interfaces (none: those that the file names), normal modes with these
    fixed, and the frame: MEAN, or the name of an interface; whether with geometric stiffening."""

    interfaces: tuple[Interface, ...] = ()
    modes: Wanted = DEFAULT
    frame: str = MEAN
    stiffening: bool = False


@dataclass(frozen=True, eq=False, slots=True)
class Reduction:
    """A reduced body and the numbers of its making, for a report; ``rotations`` (n, 3, q) are those
    of its nodes, ``members`` the labels of the nodes of each interface."""

    source: str
    body: ReducedBody
    rotations: np.ndarray
    members: tuple[np.ndarray, ...]
    nodes: int
    equations: int
    static: int
    normal: int
    resistance: float


def reduce_file(files: Files, wishes: Wishes) -> Reduction:
    """Return the reduced body of a file; raises ``ReductionError``."""
    if wishes.stiffening:
        raise ReductionError(str(files.model), f"{STIFFENED}; omit --stiffening")
    return reduce_model(read_model(files), wishes)


def reduce_model(given: ElasticModel | ModalModel, wishes: Wishes) -> Reduction:
    """Return the reduced body of a model; raises ``ReductionError``."""
    if isinstance(given, ModalModel):
        return _of_modes(given, wishes)
    interfaces = _interfaces(given, wishes)
    parts = tied(given, interfaces)
    model = parts.model
    outer = np.concatenate([model.rows_of(model.node_of(one)) for one in parts.nodes.values()])
    outer.sort()
    _, centre = mass_centre(model)
    R = rigid_fields(model, centre)
    require_free(model, R)
    _require_hold(model, R[outer])
    basis, interior = craig_bampton(model, outer, wishes.modes)
    modes = floating_modes(basis, _frame_node(parts, wishes.frame))
    errors = reduction_errors(modes, interior)
    normal = len(interior.modes.eigenvalues)
    body, rotations, members = _body(modes, errors, parts, wishes.frame, given)
    counts = len(given.labels), given.size, len(outer), normal
    return Reduction(given.source, body, rotations, members, *counts, modes.resistance)


def _of_modes(given: ModalModel, wishes: Wishes) -> Reduction:
    """Return the body of a file that has modes in place of matrices of nodes."""
    model = given.basis.model
    interfaces = _interfaces(model, wishes)
    if not all(one.is_node for one in interfaces):
        raise ReductionError(
            model.source, "it has modes, not matrices of nodes, so no set of nodes can be tied"
        )
    parts = tied(model, interfaces)
    basis: Basis = given.basis
    modes = floating_modes(basis, _frame_node(parts, wishes.frame))
    unknown = np.full(len(modes.eigenvalues), np.nan)
    errors = ReductionErrors(unknown, float("nan"), float("nan"), np.full(6, np.nan))
    count = basis.shapes.shape[1]
    body, rotations, members = _body(modes, errors, parts, wishes.frame, model)
    counts = len(model.labels), model.size, 0, count
    return Reduction(model.source, body, rotations, members, *counts, modes.resistance)


def _interfaces(model: ElasticModel, wishes: Wishes) -> tuple[Interface, ...]:
    named = tuple(Interface(str(one), (range(one, one + 1),)) for one in model.interface)
    found = wishes.interfaces or named
    if not found:
        raise ReductionError(
            model.source,
            "no interface is chosen; name the nodes that joints and loads attach to, such as "
            f"--interface {model.labels[0]}",
        )
    return found


def _frame_node(parts: Tied, frame: str) -> int | None:
    if frame == MEAN:
        return None
    if frame not in parts.nodes:
        known = ", ".join(parts.nodes)
        raise ReductionError(
            parts.model.source, f"--frame {frame}: expected {MEAN} or an interface: {known}"
        )
    return parts.model.node_of(parts.nodes[frame])


def _require_hold(model: ElasticModel, R: np.ndarray) -> None:
    """Raise ``ReductionError`` unless a body cannot move rigidly with its interface fixed."""
    size = np.abs(R[:, 3:]).max(initial=0.0) or 1.0
    values = np.linalg.svd(R / np.where(np.arange(6) < 3, 1.0, size), compute_uv=False)
    if (values > LEAST_HOLD * values.max(initial=0.0)).sum() < FEWEST_RIGID:
        raise ReductionError(
            model.source,
            "the body can move rigidly while its interface nodes are held, because they have no "
            "rotations; add nodes that are not on a line with them, or tie nodes to an interface: "
            "--interface Hub=3,4,5",
        )


def _node_shapes(modes: FloatingModes, parts: Tied) -> np.ndarray:
    """Return the shapes (n, 6, q) at all nodes, also at those that follow an interface."""
    model = modes.model
    spread = np.zeros((len(model.labels), 6, len(modes.eigenvalues)))
    spread[model.owners, model.components] = modes.shapes
    for name, label in parts.nodes.items():
        point = model.node_of(label)
        nodes = np.flatnonzero(np.isin(model.labels, parts.members[name]))
        nodes = nodes[nodes != point]
        arms = model.places[nodes] - model.places[point]
        moved = np.einsum("cik,iq,nk->ncq", EPSILON, spread[point, 3:], arms)
        spread[nodes, :3], spread[nodes, 3:] = spread[point, :3] + moved, spread[point, 3:]
    return spread


def _at_all_nodes(modes: FloatingModes, spread: np.ndarray, given: ElasticModel) -> FloatingModes:
    """Return the modes of the model before sets of nodes were tied, which kept its nodes in their
    places: by the rotations of its own nodes each of them follows the frame as it does."""
    return replace(
        modes,
        model=given,
        shapes=spread[given.owners, given.components],
        rigid=rigid_fields(given, modes.centre),
    )


def _body(
    modes: FloatingModes, errors: ReductionErrors, parts: Tied, frame: str, given: ElasticModel
) -> tuple[ReducedBody, np.ndarray, tuple[np.ndarray, ...]]:
    """Return the body of the modes of the model that the ``parts`` tie, which is the ``given`` one
    if nothing is tied; the rotations of its nodes and the members of its interfaces."""
    model = modes.model
    q = len(modes.eigenvalues)
    spread = _node_shapes(modes, parts)
    at = np.array([model.node_of(label) for label in parts.nodes.values()])
    rotates = np.array([(model.components[model.rows_of(k)] > 2).sum() == 3 for k in at])
    places = model.places - modes.centre
    body = ReducedBody(
        frame=frame,
        centre=modes.centre,
        eigenvalues=modes.eigenvalues,
        damping=np.zeros((q, q)) if modes.damping is None else modes.damping,
        interface_names=np.array(list(parts.nodes)),
        interface_places=places[at],
        interface_shapes=spread[at],
        interface_rotates=rotates,
        node_labels=model.labels,
        node_places=places,
        node_shapes=spread[:, :3],
        frequency_errors=errors.frequency,
        following_frequency=errors.following,
        effective_mass=errors.effective_mass,
        static_residual=errors.statics,
        invariants=invariants(_at_all_nodes(modes, spread, given)),
    )
    return body, spread[:, 3:], tuple(parts.members[name] for name in parts.nodes)
