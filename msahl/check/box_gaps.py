"""Gaps of two boxes at t = 0, also of boxes that overlap."""

import math

import numpy as np

from msahl.algebra.vector import IDENTITY
from msahl.check.context import INERTIAL, Context
from msahl.check.directions import PARALLEL
from msahl.check.ends import points
from msahl.elements.constraints import segments
from msahl.model.box_parts import corners_of, edges_of
from msahl.model.contacts import BoxesContact

Box = tuple[np.ndarray, np.ndarray, np.ndarray]
"""Middle [m] and axes (rows), inertial axes, and half sizes [m]."""


def gap_of_boxes(contact: BoxesContact, context: Context) -> float:
    """Return the gap of two rounded boxes [m], less than zero if they overlap: then the least way
    by which one of them comes free, along the normals of faces and across edges.
    """
    here, there = map(np.array, points(contact, context))
    own = [context.rotated(axis, contact.parent, INERTIAL) for axis in IDENTITY]
    other = [context.rotated(axis, contact.child, INERTIAL) for axis in contact.axes]
    one = (here, np.array(own), np.array(contact.parent_half))
    two = (there, np.array(other), np.array(contact.half))
    apart = separation(one, two)
    gap = distance(one, two) if apart > 0.0 else apart
    return gap - contact.parent_radius - contact.radius


def separation(one: Box, two: Box) -> float:
    """Return the largest distance of the projections of two boxes, along the normals of faces and
    across pairs of edges [m]; it is less than zero if they overlap.
    """
    crossed = np.cross(one[1][:, None], two[1][None]).reshape(-1, 3)
    sine = np.linalg.norm(crossed, axis=1)
    axes = np.vstack([one[1], two[1], crossed[sine > PARALLEL] / sine[sine > PARALLEL, None]])
    D, reach = two[0] - one[0], sum(np.abs(axes @ box[1].T) @ box[2] for box in (one, two))
    return float((np.abs(axes @ D) - reach).max())


def distance(one: Box, two: Box) -> float:
    """Return the distance of two boxes that do not overlap [m]."""
    found = [_to_corners(one, two), _to_corners(two, one)]
    for middle, axis, half in edges_of(tuple(one[2])):
        for place, along, length in edges_of(tuple(two[2])):
            a, e = np.array(axis) @ one[1], np.array(along) @ two[1]
            D = two[0] + np.array(place) @ two[1] - one[0] - np.array(middle) @ one[1]
            u, w, _, _ = segments.feet((half, length), (a @ D, e @ D, a @ e))
            found.append(math.hypot(*(D + w * e - u * a)))
    return min(found)


def _to_corners(box: Box, other: Box) -> float:
    """Return the distance of a box from the corners of another one."""
    places = other[0] + np.array(corners_of(tuple(other[2]))) @ other[1] - box[0]
    beyond = np.maximum(np.abs(places @ box[1].T) - box[2], 0.0)
    return float(np.linalg.norm(beyond, axis=1).min())
