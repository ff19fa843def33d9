"""Coordinates of joints by their names, as the equations of motion compute them: of products."""

from collections.abc import Iterator

import numpy as np

from msahl.algebra.vector import Vector
from msahl.elements.constraints.coordinate_kinds import ANGLE, PLAIN
from msahl.elements.constraints.products import DOT, SLIDE
from msahl.joints.coordinates import ORIENTATION, coordinates, frames
from msahl.joints.joint import Coincide, Coordinate, Product, angle, slide
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint


def joint_coordinate(joint: Joint, name: str) -> Coordinate:
    """Return the coordinate ``name`` of a joint."""
    if name in ("slide1", "slide2"):
        axis = frames(joint)[0][int(name[-1]) - 1]
        return Coordinate(PLAIN, (Product(SLIDE, _vector(axis)),))
    if name in ("angle1", "angle2"):
        return _angle_of_universal(joint, name)
    return {"angle": angle, "slide": slide}[name](joint)


def _angle_of_universal(joint: Joint, name: str) -> Coordinate:
    """Return an angle of a universal joint: that of the child's axis about the parent's, or minus
    that of the parent's axis about the child's.
    """
    parent, child = frames(joint)
    if name == "angle1":
        pairs = ((parent[1], child[2]), (parent[0], child[2]))
    else:
        pairs = ((parent[2], -child[1]), (parent[2], child[0]))
    sine, cosine = (Product(DOT, _vector(n), e=_vector(e)) for n, e in pairs)
    return Coordinate(ANGLE, (sine, cosine), angular=True)


def _vector(a: np.ndarray) -> Vector:
    return (float(a[0]), float(a[1]), float(a[2]))


def coupled_rates(joint: Joint) -> Iterator[tuple[str, str, float]]:
    """Yield the coordinates q1 and q2 and the factor c of each equation dq1/dt + c dq2/dt = 0
    between two coordinates of a joint."""
    names = [name for name in coordinates(joint) if name != ORIENTATION]
    known = {name: joint_coordinate(joint, name) for name in names}
    for equation in KINDS[joint.kind].equations(joint):
        if isinstance(equation, Coincide) or equation.second is None:
            continue
        pair = [n for q in (equation.first, equation.second) for n in names if known[n] == q]
        if len(pair) == 2:
            yield pair[0], pair[1], equation.coefficient
