"""Doubtful inertias of the bodies of a model, by their shapes (see ``importers.inertia``)."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from msahl.importers.inertia import doubt
from msahl.importers.meshes import MeshFiles
from msahl.importers.robot import Inertia, Look, Pose
from msahl.model import Model, Shape


def doubts(model: Model, folder: Path) -> Iterator[str]:
    """Yield why inertias are doubtful, with the names of their bodies; meshes lie in ``folder``."""
    meshes = MeshFiles((folder,), folder)
    looks: dict[str, list[Look]] = {}
    for shape in model.shapes:
        looks.setdefault(shape.body, []).append(_look(shape))
    for body in model.bodies:
        inertia = Inertia(body.mass, np.array(body.r_BG), np.array(body.inertia))
        words = doubt(inertia, looks.get(body.name, ()), meshes)
        if words:
            yield f"body '{body.name}': {words}"


def _look(shape: Shape) -> Look:
    """Return a shape of a deck as one of a link."""
    pose = Pose(np.array(shape.axes).T, np.array(shape.position))
    return Look(shape.kind, shape.size, pose, shape.colour, shape.file)
