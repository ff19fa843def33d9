"""Reduction of a mesh: its matrices, its named sets as interfaces, and the error of the mesh."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NoReturn

import numpy as np

from msahl.reduction.body import ReducedBody
from msahl.reduction.elastic_model import ElasticModel, Matrices, Nodes, build_model
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.interfaces import Interface
from msahl.reduction.mesh.beams import beam_matrices, volume
from msahl.reduction.mesh.beams import refined as refined_beams
from msahl.reduction.mesh.material import MATERIAL, BeamSection, Material, material_of, section_of
from msahl.reduction.mesh.mesh import BEAM, Mesh
from msahl.reduction.mesh.read import mesh_format, read_mesh
from msahl.reduction.mesh.refine import refined as refined_solid
from msahl.reduction.mesh.refinement_error import Levels, refinement_errors
from msahl.reduction.mesh.second_order import Beams, beam_stiffening
from msahl.reduction.mesh.skin import mesh_skin
from msahl.reduction.mesh.solids import Solid, build_solid, matrices
from msahl.reduction.read import Files
from msahl.reduction.reduce import STIFFENED, Reduction, Wishes, reduce_model
from msahl.reduction.text_files import lines_of
from msahl.reduction.units import UNITS, in_si

DENSITIES = (0.1, 3e4)
"""Densities [kg/m^3] of aerogels and of osmium are within; others come from wrong units."""
MOST_MODES = 12
"""Modes of solids whose error by the mesh is estimated: each is solved for on the finer mesh."""
MOST_EQUATIONS = 1_000_000
"""Degrees of freedom of the largest finer mesh: a few gigabytes."""
EIGENVALUE_ORDER = {
    **{BEAM: 4, "tetra": 2, "hexahedron": 2},
    **{"tetra10": 4, "hexahedron20": 4, "hexahedron27": 4},
}
"""Eigenvalues converge with this power of the elements' size, twice the degree of their functions'
slopes plus one, where no re-entrant corner or edge of a tie is near."""


@dataclass(frozen=True, eq=False, slots=True)
class MeshSummary:
    """What a report says of a mesh: numbers of ``elements`` by kind, ``volume`` [m^3], ``errors``
    (q,), by how much the mesh makes each frequency too high, relative to it (nan: not estimated),
    and ``notes``, what a user should know."""

    elements: dict[str, int]
    volume: float
    errors: np.ndarray
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False, slots=True)
class MeshModel:
    """The elastic model of a mesh, its ``volume`` [m^3], and the function that estimates the errors
    of the mesh in the frequencies of a body."""

    mesh: Mesh
    model: ElasticModel
    volume: float
    errors: Callable[[ReducedBody, Wishes], np.ndarray]


def is_mesh(files: Files) -> bool:
    """Return whether a file is one of a mesh. Raises ``ReductionError``: a mesh without material,
    files of matrices beside a mesh."""
    if files.material:
        if files.mass or files.nodes:
            raise ReductionError(str(files.model), "a mesh has no --mass and --nodes; omit them")
        return True
    kind = mesh_format(files.model)
    if kind is None or (kind == "nastran" and _has_matrices(files.model)):
        if files.section:
            raise ReductionError(str(files.model), "matrices have no --section; omit it")
        return False
    raise ReductionError(
        str(files.model), f"it is a mesh; give its material: --material '{MATERIAL}'"
    )


def _has_matrices(path: Path) -> bool:
    return any(text[:4].upper() == "DMIG" for _, text in lines_of(path))


def reduce_mesh(files: Files, wishes: Wishes) -> tuple[Reduction, MeshSummary]:
    """Return the reduced body of a mesh; raises ``ReductionError``."""
    material = material_of(files.material)
    section = section_of(files.section, material.nu) if files.section else None
    mesh = read_mesh(files.model)
    made = mesh_model(mesh, material, section, files.units)
    chosen = replace(
        wishes, interfaces=tuple(of_sets(mesh, one) for one in wishes.interfaces or _none(mesh))
    )
    found = reduce_model(made.model, chosen)
    if wishes.stiffening:
        found = replace(found, body=_stiffened(mesh, material, section, files.units, found))
    skin = mesh_skin(mesh, section, UNITS[files.units][0], found.body, found.rotations)
    found = replace(found, body=replace(found.body, skin=skin))
    summary = MeshSummary(
        {kind: len(nodes) for kind, nodes in mesh.elements.items()},
        made.volume,
        _errors(made, found.body, chosen),
        tuple(_notes(mesh, material, files.units)),
    )
    return found, summary


def _stiffened(
    mesh: Mesh, material: Material, section: BeamSection | None, units: str, found: Reduction
) -> ReducedBody:
    """Return the body with its geometric stiffening."""
    if section is None:
        raise ReductionError(mesh.source, f"{STIFFENED}; omit --stiffening")
    body = found.body
    members = [int(np.searchsorted(mesh.labels, labels[0])) for labels in found.members]
    beams = Beams(mesh, material, section, UNITS[units][0])
    return replace(body, stiffening=beam_stiffening(beams, body, found.rotations, members))


def _errors(made: MeshModel, body: ReducedBody, wishes: Wishes) -> np.ndarray:
    """Return the errors of the mesh; nan if the finer mesh cannot be computed, which is no fault
    of the given one."""
    try:
        return made.errors(body, wishes)
    except ReductionError:
        return np.full(len(body.eigenvalues), np.nan)


def mesh_model(
    mesh: Mesh, material: Material, section: BeamSection | None, units: str
) -> MeshModel:
    """Return the elastic model of a mesh in SI units; raises ``ReductionError``."""
    if mesh.is_solid:
        if section is not None:
            raise ReductionError(mesh.source, "it is a mesh of solids; omit --section")
        return _of_solid(build_solid(mesh, material), units)
    if section is None:
        raise ReductionError(
            mesh.source, "it is a mesh of beams; give their cross-section, such as "
            "--section 'radius=0.01'",
        )  # fmt: skip
    return _of_beams(mesh, material, section, units)


def _of_solid(solid: Solid, units: str) -> MeshModel:
    model = _built(solid.mesh, matrices(solid), units)

    def errors(body: ReducedBody, wishes: Wishes) -> np.ndarray:
        found = np.full(len(body.eigenvalues), np.nan)
        finer, P = refined_solid(solid.mesh)
        if 3 * len(finer.labels) <= MOST_EQUATIONS:
            fine = _built(finer, matrices(build_solid(finer, solid.material)), units)
            count = min(_estimated(body), MOST_MODES)
            found[:count] = refinement_errors(Levels(model, fine, P), body, wishes, count)
            found[:count] *= 2.0**order / (2.0**order - 1.0)
        return found

    order = min(EIGENVALUE_ORDER[kind] for kind in solid.mesh.elements)
    return MeshModel(solid.mesh, model, UNITS[units][0] ** 3 * solid.volume, errors)


def _of_beams(mesh: Mesh, material: Material, section: BeamSection, units: str) -> MeshModel:
    model = _built(mesh, beam_matrices(mesh, material, section), units)

    order = EIGENVALUE_ORDER[BEAM]

    def errors(body: ReducedBody, wishes: Wishes) -> np.ndarray:
        finer = refined_beams(mesh)
        other = reduce_model(_built(finer, beam_matrices(finer, material, section), units), wishes)
        found = np.full(len(body.eigenvalues), np.nan)
        count = min(_estimated(body), _estimated(other.body))
        change = 1.0 - other.body.frequencies[:count] / body.frequencies[:count]
        found[:count] = np.maximum(change, 0.0) * 2.0**order / (2.0**order - 1.0)
        return found

    return MeshModel(mesh, model, UNITS[units][0] ** 3 * volume(mesh, section), errors)


def _built(mesh: Mesh, given: Matrices, units: str) -> ElasticModel:
    return build_model(mesh.source, *in_si(Nodes(mesh.labels, mesh.places), given, units))


def _estimated(body: ReducedBody) -> int:
    """Return the number of modes whose frequency the body has, below the omitted ones."""
    return int(np.isfinite(body.frequency_errors).sum())


def of_sets(mesh: Mesh, interface: Interface) -> Interface:
    """Return an interface whose named sets are ranges of nodes; raises ``ReductionError``."""
    ranges = list(interface.nodes)
    for name in interface.sets:
        labels = mesh.sets.get(name)
        if labels is None:
            known = ", ".join(shown(one) for one in list(mesh.sets)[:20]) or "none"
            raise ReductionError(
                mesh.source, f"--interface {interface.name}: there is no set '{shown(name)}'; "
                f"sets of the mesh: {known}",
            )  # fmt: skip
        if len(labels) == 0:
            raise ReductionError(
                mesh.source, f"--interface {interface.name}: no element uses a node of the set "
                f"'{shown(name)}'",
            )  # fmt: skip
        breaks = np.flatnonzero(np.diff(labels) != 1) + 1
        ranges += [range(int(one[0]), int(one[-1]) + 1) for one in np.split(labels, breaks)]
    return Interface(interface.name, tuple(ranges))


def _none(mesh: Mesh) -> NoReturn:
    """Raise ``ReductionError``, because no interface is chosen."""
    known = ", ".join(shown(name) for name in list(mesh.sets)[:20])
    example = f"Hub={shown(next(iter(mesh.sets)))}" if mesh.sets else f"{mesh.labels[0]}"
    raise ReductionError(
        mesh.source,
        "no interface is chosen; name the sets or nodes that joints and loads attach to, such as "
        f"--interface {example}; sets of the mesh: {known or 'none'}",
    )


def _notes(mesh: Mesh, material: Material, units: str) -> list[str]:
    """Return what a user should know: ignored elements, a density of no solid."""
    notes = []
    if mesh.ignored:
        parts = ", ".join(f"{count} {kind}" for kind, count in mesh.ignored.items())
        notes.append(f"elements that only serve as sets: {parts}")
    length, mass = UNITS[units]
    rho = material.rho * mass / length**3
    if not DENSITIES[0] < rho < DENSITIES[1]:
        notes.append(f"the density {rho:g} kg/m^3 is that of no solid: is rho in --units {units}?")
    return notes
