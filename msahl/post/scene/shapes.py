"""Shapes of the deck in the form of a scene; files of meshes are read here."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np

from msahl.deck.faults import DeckError
from msahl.model import Model
from msahl.model.shapes import Shape as Record
from msahl.post.scene.geometry import Shape, floats, quaternion, shape
from msahl.post.scene.meshes import Mesh, find_mesh, read_mesh

DIGITS = 6
"""Digits kept of a mesh's coordinates, relative to its size."""


def given_shapes(
    model: Model, folders: Sequence[Path]
) -> tuple[dict[str, list[Shape]], list[DeckError]]:
    """Return the shapes by the name of their body or ground, and what is wrong with the files of
    those that are missing. Files of meshes are looked for in ``folders``, in this order."""
    found: dict[str, list[Shape]] = {}
    errors: list[DeckError] = []
    read: dict[str, Mesh | None] = {}
    for record in model.shapes:
        mesh = None
        if record.kind == "mesh":
            if record.file not in read:
                try:
                    read[record.file] = read_mesh(find_mesh(record.file, folders))
                except DeckError as error:
                    read[record.file] = None
                    errors.append(_placed(error, model, record.body))
            mesh = read[record.file]
            if mesh is None:
                continue
        found.setdefault(record.body, []).append(_shape(record, mesh))
    return found, errors


def _placed(error: DeckError, model: Model, body: str) -> DeckError:
    """Return the faults of a file with the body or ground that has the shape."""
    kind = "body" if any(one.name == body for one in model.bodies) else "ground"
    return DeckError(tuple(replace(f, where=f"{kind} '{body}', mesh") for f in error.faults))


def mesh_faults(model: Model, folders: Sequence[Path]) -> list[str]:
    """Return what is wrong with the files of a model's meshes."""
    return [str(fault) for error in given_shapes(model, folders)[1] for fault in error.faults]


def _shape(record: Record, mesh: Mesh | None) -> Shape:
    orientation = quaternion(np.array(record.axes).T)
    made = shape(record.kind, record.size, record.position, orientation)
    made |= {"colour": record.colour or None, "derived": False}
    if mesh is not None:
        vertices = mesh.vertices * record.size[0]
        lengths = np.ptp(vertices, axis=0)
        digits = DIGITS - int(np.floor(np.log10(max(lengths.max(), 1e-300))))
        made |= {
            "name": PurePosixPath(record.file).name,
            "size": floats(lengths),
            "vertices": np.round(vertices, min(digits, 300)).ravel().tolist(),
            "faces": mesh.faces.ravel().tolist(),
        }
    return made
