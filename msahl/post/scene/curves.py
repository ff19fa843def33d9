"""Shapes of contacts between pins and planar curves: rods along the curve, a disc for the pin."""

from collections.abc import Iterator, Mapping
from itertools import pairwise

import numpy as np

from msahl.algebra.rotation_arrays import matrices, quaternions
from msahl.elements.constraints.outlines import outline, segments_of
from msahl.model import Model, PinContact
from msahl.post.scene.geometry import Shape, along, quaternion, shape

WIDE = 1.0
"""Length of a pin, relative to its radius."""


def curve_shapes(
    model: Model, numbers: Mapping[str, int], radius: float
) -> Iterator[tuple[int, Shape]]:
    """Yield bodies or grounds by ``numbers`` and the shapes that contacts of pins give them, with
    rods of this ``radius`` [m].
    """
    for contact in model.contacts:
        if not isinstance(contact, PinContact):
            continue
        for start, end in pairwise(points_of(contact)):
            span = end - start
            length = float(np.sqrt(span @ span))
            if length > 0.0:
                upright, middle = quaternion(along(span)), 0.5 * (start + end)
                yield numbers[contact.parent], shape("rod", [radius, length], middle, upright)
        if contact.radius > 0.0:
            size = [contact.radius, WIDE * contact.radius]
            axis = _axes(model, contact.child).T @ _axes(model, contact.parent) @ contact.axes[2]
            upright = quaternion(along(axis))
            yield numbers[contact.child], shape("disc", size, contact.child_point, upright)


def points_of(contact: PinContact) -> np.ndarray:
    """Return points (n, 3) of a curve, as it goes, in the parent's axes from its reference
    point.
    """
    x, y, _ = np.array(contact.axes)
    points = np.array(outline(segments_of(contact.curve)))
    places: np.ndarray = contact.parent_point + points[:, :1] * x + points[:, 1:] * y
    return places


def _axes(model: Model, name: str) -> np.ndarray:
    """Return the axes of a body or ground at t = 0, the columns of a rotation matrix (3, 3)."""
    found = [body for body in model.bodies if body.name == name]
    if not found:
        return np.eye(3)
    return np.asarray(matrices(quaternions(np.array(found[0].orientation))))
