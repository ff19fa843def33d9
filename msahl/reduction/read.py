"""Read an elastic model: the format follows from the contents of the file.

Other files that belong to it are taken from its own folder, by their names, or are given.
"""

import re
from dataclasses import dataclass
from pathlib import Path

from msahl.reduction.elastic_model import ElasticModel, Matrices, Nodes, build_model
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.modal import ModalModel
from msahl.reduction.read_dmig import read_dmig
from msahl.reduction.read_fem import read_fem
from msahl.reduction.read_matrices import file_of_nodes, other_matrix, read_pair
from msahl.reduction.read_nodes import read_nodes
from msahl.reduction.read_npz import read_npz
from msahl.reduction.text_files import head_of, real
from msahl.reduction.units import SI, in_si


@dataclass(frozen=True, slots=True)
class Files:
    """The files of an elastic model: of the stiffness, or of all; of mass and nodes if they are
    elsewhere (None: beside it, by their names), and the units of the numbers. Of a mesh, the
    material and the section of its beams."""

    model: Path
    mass: Path | None = None
    nodes: Path | None = None
    units: str = SI
    material: str = ""
    section: str = ""


def read_model(files: Files) -> ElasticModel | ModalModel:
    """Return the model of a file in SI units; raises ``ReductionError``."""
    path = files.model
    head = head_of(path)
    text = head.decode("latin-1")
    if head.startswith(b"PK"):
        nodes, matrices, interface = read_npz(path)
        return _built(files, nodes, matrices, interface)
    if "RECORD GROUP" in text.upper():
        return read_fem(path, files.units)
    if re.search(r"^(DMIG|GRID|\$)", text, re.M | re.I):
        return _built(files, _nodes(files, path), read_dmig(path))
    _require_numbers(path, text)
    mass = files.mass or other_matrix(path, "mass")
    if mass is None:
        raise ReductionError(
            str(path), "no file of the mass is beside this one, named as this one of the stiffness "
            "(job_STIF1.mtx, job_MASS1.mtx; job.sti, job.mas); give it by --mass",
        )  # fmt: skip
    nodes = _nodes(files, file_of_nodes(path))
    return _built(files, nodes, read_pair(path, mass, other_matrix(path, "damping"), nodes))


def _require_numbers(path: Path, text: str) -> None:
    """Raise ``ReductionError`` for a file that is none of the formats."""
    for line, row in enumerate(text.splitlines(), 1):
        words = row.replace(",", " ").split()
        if words and not words[0].startswith(("**", "%", "#")):
            if all(real(word) is not None for word in words):
                return
            raise ReductionError(
                str(path), f"'{shown(row)}': no line of an elastic model; expected an .npz, a "
                "stiffness of Abaqus or CalculiX, DMIG cards of Nastran, or a .fem of MBDyn", line,
            )  # fmt: skip


def _nodes(files: Files, found: Path | None) -> Nodes:
    """Return the nodes: of the file that is given, or of the one found."""
    path = files.nodes or found
    if path == files.model and not re.search(rb"^GRID", path.read_bytes(), re.M | re.I):
        path = file_of_nodes(path)
    if path is None:
        raise ReductionError(
            str(files.model), "no file of its nodes is beside it, named as it (job.inp, job.bdf, "
            "job.csv); give it by --nodes",
        )  # fmt: skip
    return read_nodes(path)


def _built(
    files: Files, nodes: Nodes, matrices: Matrices, interface: tuple[int, ...] = ()
) -> ElasticModel:
    scaled_nodes, scaled = in_si(nodes, matrices, files.units)
    return build_model(str(files.model), scaled_nodes, scaled, interface)
