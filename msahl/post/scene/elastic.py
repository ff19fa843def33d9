"""Reduced elastic bodies of a scene: their skins, which move by the amplitudes of their modes."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msahl.algebra.rotation_arrays import matrices
from msahl.deck.faults import DeckError
from msahl.model import ElasticBody, Model
from msahl.post.scene.geometry import floats
from msahl.post.scene.meshes import find_mesh
from msahl.reduction.body import ReducedBody, read_body
from msahl.reduction.faults import ReductionError
from msahl.reduction.particles import amplitude_scale

DIGITS = 5
"""Decimals of displacements by an amplitude of 1 m, which are at most 1 m."""
PLACES = 6
"""Digits of places, relative to the size of the body."""


def skins(
    model: Model, body: Mapping[str, int], folders: Sequence[Path], colours: Sequence[str]
) -> tuple[list[dict[str, Any]], list[str]]:
    """Return the skins of the elastic bodies whose files have one, and what is wrong with the files
    of others. Files are looked for in ``folders``, in this order."""
    found: list[dict[str, Any]] = []
    notes: list[str] = []
    for elastic in model.elastic_bodies:
        if not elastic.file:
            continue
        try:
            given = read_body(find_mesh(elastic.file, folders))
        except DeckError:
            notes.append(f"elastic body '{elastic.name}': {elastic.file} is not beside the deck")
            continue
        except ReductionError as error:
            notes.append(f"elastic body '{elastic.name}': {error.message}")
            continue
        if given.eigenvalues.size != len(elastic.stiffness):
            notes.append(f"elastic body '{elastic.name}': {elastic.file} is that of another body")
        elif given.skin is not None:
            colour = colours[body[elastic.name] % len(colours)]
            found.append(_entry(elastic, given, body, colour))
    return found, notes


def amplitudes(entry: Mapping[str, Any], poses: np.ndarray) -> np.ndarray:
    """Return the amplitudes (rows, q) of an elastic body of a scene at ``poses`` (rows, bodies, 7)
    of all bodies."""
    bodies, axes = np.array(entry["carriers"]).T
    frame = poses[:, entry["frame"]]
    away = poses[:, bodies, :3] - frame[:, None, :3]
    across = np.einsum("tij,tki->tkj", matrices(frame[:, 3:]), away)
    result: np.ndarray = across[:, np.arange(len(axes)), axes] - entry["rest"]
    return result


def _entry(
    elastic: ElasticBody, given: ReducedBody, body: Mapping[str, int], colour: str
) -> dict[str, Any]:
    skin = given.skin
    assert skin is not None
    places = given.centre + skin.places
    digits = PLACES - int(np.floor(np.log10(max(np.ptp(places, axis=0).max(), 1e-300))))
    shapes = np.round(skin.shapes * amplitude_scale(given), DIGITS) + 0.0
    return {
        "name": elastic.name,
        "frame": body[elastic.name],
        "carriers": [[body[name], axis] for name, axis in elastic.amplitudes],
        "rest": list(_rest(elastic)),
        "points": np.round(places, min(digits, 300)).ravel().tolist(),
        "shapes": floats(shapes.transpose(2, 0, 1).ravel()),
        "triangles": skin.triangles.ravel().tolist(),
        "colour": colour,
    }


def _rest(elastic: ElasticBody) -> Iterator[float]:
    """Yield where carriers are without an amplitude, along its axis [m]."""
    place = {one.body: one.place for one in elastic.followers}
    for name, axis in elastic.amplitudes:
        yield place[name][axis]
