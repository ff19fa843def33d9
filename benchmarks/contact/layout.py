"""Contacts of a model at t = 0 in inertial axes, from which every other program is set up.

All shapes are spheres, which touch a plane of the ground or each other; a corner is a sphere of
radius zero. Bodies and joints are those of ``benchmarks.mechanisms.layout``.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from benchmarks.mechanisms.layout import Mass, layout
from msahl.algebra.rotation import matrix
from msahl.model import Model
from msahl.model.contacts import PlaneContact, SphereContact


@dataclass(frozen=True, slots=True)
class Ball:
    """A sphere of a body."""

    body: str
    point: np.ndarray  # its centre from the mass centre, inertial axes at t = 0 [m]
    radius: float


@dataclass(frozen=True, slots=True)
class Plane:
    """The surface of the ground, whose body is on the side of ``normal``."""

    point: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, slots=True)
class Pair:
    """Two shapes that may touch; ``mass`` is what an impulse along their normal moves at t = 0, as
    if joints and other contacts were not there.
    """

    name: str
    ball: Ball
    other: Ball | Plane
    friction: float
    restitution: float
    mass: float


def pairs(model: Model) -> list[Pair]:
    """Return all contacts of ``model``; those on the ground are planes."""
    known = [c for c in model.contacts if isinstance(c, PlaneContact | SphereContact)]
    assert len(known) == len(model.contacts), "other programs are not given such a contact"
    return [_pair(model, contact) for contact in known]


def _pair(model: Model, contact: PlaneContact | SphereContact) -> Pair:
    masses = layout(model).masses
    ball = _ball(model, contact.child, contact.child_point, contact.radius)
    given = contact.name, ball
    if isinstance(contact, PlaneContact):
        plane = Plane(np.array(contact.parent_point), np.array(contact.normal))
        inverse = _inverse_mass(masses[ball.body], ball, plane.normal)
        return Pair(*given, plane, contact.friction, contact.restitution, 1.0 / inverse)
    other = _ball(model, contact.parent, contact.parent_point, contact.parent_radius)
    one, two = masses[ball.body], masses[other.body]
    apart = one.x + ball.point - two.x - other.point
    normal = apart / np.linalg.norm(apart)
    inverse = _inverse_mass(one, ball, normal) + _inverse_mass(two, other, normal)
    return Pair(*given, other, contact.friction, contact.restitution, 1.0 / inverse)


def _inverse_mass(mass: Mass, ball: Ball, normal: np.ndarray) -> float:
    """Rate [1/kg] that an impulse along the ``normal`` through the ball gives it that way."""
    arm = np.cross(ball.point, normal)
    return float(1.0 / mass.mass + arm @ np.linalg.solve(mass.inertia, arm))


def _ball(model: Model, name: str, point: tuple[float, float, float], radius: float) -> Ball:
    body = next(body for body in model.bodies if body.name == name)
    offset = np.array(matrix(body.orientation)) @ (np.array(point) - np.array(body.r_BG))
    return Ball(name, offset, radius)


def damping_ratio(restitution: float) -> float:
    """Return the damping ratio of a spring and damper, which do not pull, that rebounds so; 1
    without rebound.

    Source: Schwager and Poeschel (2007), whose contact ends when its force is zero.
    """
    if restitution <= 0.0:
        return 1.0
    if restitution >= 1.0:
        return 0.0
    return float(brentq(lambda ratio: _rebound(ratio) - restitution, 0.0, 1.0 - 1e-9))


def _rebound(ratio: float) -> float:
    root = math.sqrt(1.0 - ratio * ratio)
    phase = math.pi - math.atan2(2.0 * ratio * root, 1.0 - 2.0 * ratio * ratio)
    return math.exp(-ratio / root * phase)
