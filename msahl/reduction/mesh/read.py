"""Read a mesh: Gmsh (.msh), Abaqus and CalculiX (.inp), Nastran (.bdf), VTK (.vtk, .vtu).

meshio reads them; the format follows from the contents. Numbers of nodes are those of the file in
.inp and .bdf, else the positions in the file, from 1. Sets are ``*NSET`` and ``*ELSET``, physical
groups of Gmsh, and arrays of VTK with one number for each node or element: those not zero belong to
the set. Of .inp and .bdf one file has the complete mesh: files that it includes are not read.
"""

import contextlib
import io
import re
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.mesh.mesh import Mesh, build_mesh
from msahl.reduction.read_nodes import read_nodes
from msahl.reduction.text_files import MOST_BYTES, head_of, lines_of

FORMATS = {
    "gmsh": r"\$(MeshFormat|Comments)",
    "vtk": r"# vtk DataFile",
    "vtu": r"""(<\?xml[^>]*>\s*)?(<!--.*?-->\s*)*<VTKFile[^>]*type=["']UnstructuredGrid""",
}
"""Beginnings of files by the name that meshio has for the format."""
TEXT = {"abaqus": r"^\*ELEMENT\b", "nastran": r"^(CTETRA|CHEXA|CBAR|CBEAM|CROD|CPENTA)"}
"""Lines that formats with numbers of nodes have."""
MISSING = "a mesh needs scikit-fem and meshio; install them: pip install 'msahl[mesh]'"


def mesh_format(path: Path) -> str | None:
    """Return meshio's name for the format of a file; None if it is no mesh that is read here."""
    head = head_of(path).decode("latin-1").lstrip("\ufeffï»¿ \t\r\n")
    for name, beginning in FORMATS.items():
        if re.match(beginning, head, re.S):
            return name
    for name, line in TEXT.items():
        if re.search(line, head, re.M | re.I):
            return name
    if re.search(r"^(\*NODE\b|\*HEADING\b|BEGIN BULK|GRID\b)", head, re.M | re.I):
        return _later_format(path)
    return None


def _later_format(path: Path) -> str | None:
    """Return the format of a file whose elements follow many nodes."""
    patterns = {name: re.compile(line, re.I) for name, line in TEXT.items()}
    for _, text in lines_of(path):
        for name, pattern in patterns.items():
            if pattern.match(text):
                return name
    return None


def read_mesh(path: Path) -> Mesh:
    """Return the mesh of a file; raises ``ReductionError``."""
    kind = mesh_format(path)
    if kind is None:
        raise ReductionError(
            str(path), "is no mesh of Gmsh (.msh), Abaqus or CalculiX (.inp), Nastran (.bdf), or "
            "VTK (.vtk, .vtu); matrices have no --material",
        )  # fmt: skip
    if path.stat().st_size > MOST_BYTES:
        raise ReductionError(str(path), f"larger than {MOST_BYTES} bytes, the most accepted")
    if kind in TEXT:
        _require_alone(path)
    given = _meshio(path, kind)
    labels, places = _nodes(path, kind, given)
    cells = [(block.type, block.data) for block in given.cells]
    try:
        sets = dict(_sets(given))
    except (IndexError, KeyError, ValueError, TypeError) as error:
        raise ReductionError(str(path), f"its sets are damaged: {shown(str(error))}") from error
    return build_mesh(str(path), labels, places, cells, sets)


def _meshio(path: Path, kind: str) -> Any:
    """Return meshio's mesh of a file."""
    try:
        import meshio
    except ImportError as error:
        raise ReductionError(str(path), MISSING) from error
    try:
        with contextlib.ExitStack() as quiet:
            quiet.enter_context(contextlib.redirect_stdout(io.StringIO()))
            quiet.enter_context(contextlib.redirect_stderr(io.StringIO()))
            quiet.enter_context(warnings.catch_warnings(action="ignore"))
            return meshio.read(path, kind)
    # Its readers raise what their expressions do: of damaged files IndexError, KeyError, and more.
    except (Exception, SystemExit) as error:
        reason = shown(str(error)) or type(error).__name__
        raise ReductionError(
            str(path), f"meshio cannot read it as {kind}: {reason}; is the file complete?"
        ) from error


def _require_alone(path: Path) -> None:
    """Raise ``ReductionError`` for a file that needs others, or has coordinate systems."""
    for number, line in lines_of(path):
        word = line.lstrip().upper()
        if word.startswith(("*INCLUDE", "INCLUDE")):
            raise ReductionError(
                str(path), "files that a mesh includes are not read; insert them", number
            )
        if word.startswith(("*INSTANCE", "*PART")) and "NAME" in word:
            # Each part counts its nodes from 1, and each instance has a place of its own.
            raise ReductionError(
                str(path), "parts and instances of an assembly are not read; write a flat input "
                "file (in Abaqus: *PREPRINT, or the model's option)", number,
            )  # fmt: skip


def _nodes(path: Path, kind: str, given: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return labels (n,) and places (n, 3) of a file's nodes in the order of meshio."""
    places = np.asarray(given.points, dtype=float)
    if places.ndim != 2 or not 0 < places.shape[1] <= 3:
        raise ReductionError(str(path), "there are no nodes in it")
    places = np.pad(places, ((0, 0), (0, 3 - places.shape[1])))
    if kind not in TEXT:
        return np.arange(1, len(places) + 1), places
    nodes = read_nodes(path)
    if len(nodes.labels) != len(places):
        raise ReductionError(
            str(path), f"meshio reads {len(places)} of its {len(nodes.labels)} nodes; write them "
            "as one block, each once",
        )  # fmt: skip
    return nodes.labels, nodes.places


def _sets(given: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield names and nodes of sets, as indices."""
    found: dict[str, list[np.ndarray]] = {}
    for name, nodes in given.point_sets.items():
        found.setdefault(str(name), []).append(np.asarray(nodes, dtype=np.int64))
    for name, parts in given.cell_sets.items():
        if not str(name).startswith("gmsh:"):
            found.setdefault(str(name), []).extend(_corners(given, parts))
    for name, parts in _groups(given):
        found.setdefault(name, []).extend(_corners(given, parts))
    for name, values in given.point_data.items():
        if np.ndim(values) == 1 and ":" not in str(name):
            found.setdefault(str(name), []).append(np.flatnonzero(values))
    for name, blocks in given.cell_data.items():
        if ":" not in str(name) and all(np.ndim(values) == 1 for values in blocks):
            parts = [np.flatnonzero(values) for values in blocks]
            found.setdefault(str(name), []).extend(_corners(given, parts))
    for name, parts in found.items():
        if parts:
            yield name, np.unique(np.concatenate(parts))


def _groups(given: Any) -> Iterator[tuple[str, list[np.ndarray]]]:
    """Yield the physical groups of Gmsh: names and elements of each block."""
    tags = given.cell_data.get("gmsh:physical")
    if tags is None:
        return
    dimensions = [_dimension(block.type) for block in given.cells]
    for name, (tag, dimension) in given.field_data.items():
        yield (
            str(name),
            [
                np.flatnonzero(np.asarray(one) == tag)
                if own == dimension
                else np.zeros(0, np.int64)
                for own, one in zip(dimensions, tags, strict=True)
            ],
        )


def _dimension(kind: str) -> int:
    names = (("vertex",), ("line",), ("triangle", "quad"))
    return next((n for n, words in enumerate(names) if kind.startswith(words)), 3)


def _corners(given: Any, parts: Any) -> list[np.ndarray]:
    """Return the nodes of elements, by their indices in each block."""
    blocks = zip(given.cells, parts, strict=False)
    nodes = [block.data[np.asarray(one, dtype=np.int64)].ravel() for block, one in blocks
             if one is not None and len(one)]  # fmt: skip
    return [np.asarray(one, dtype=np.int64) for one in nodes]
