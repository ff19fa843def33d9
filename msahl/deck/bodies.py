"""Grounds and rigid bodies: elements -> records, and the inertia that is possible."""

import numpy as np

from msahl.algebra.vector import Matrix, Vector
from msahl.deck.faults import Element, attribute, text
from msahl.deck.values import INERTIAL, Reader
from msahl.model.bodies import Ground, RigidBody

TRIANGLE = 1e-9
"""A principal moment may exceed the sum of the other two by this part of the largest entry given:
room for the round-off of flat plates and thin rods, which reach the sum exactly."""

POSITIVE = 1e-12
"""A principal moment below this part of the largest entry given counts as zero."""

_ENTRIES = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def read_ground(element: Element, reader: Reader) -> Ground:
    """Record of a ``<ground>``."""
    return Ground(text(element.find("name")))


def read_rigid_body(element: Element, reader: Reader) -> RigidBody:
    """Record of a ``<rigidBody>``; position of B in inertial axes, all else in its own."""
    name = text(element.find("name"))
    start = element.find("initialConditions")
    start = element if start is None else start  # then none of its children is found either
    mass = _mass(element, reader)
    r_BG = reader.components(element.find("rGB"))
    return RigidBody(
        name=name,
        mass=mass,
        r_BG=r_BG,
        inertia=_inertia(element, mass, r_BG, reader),
        position=reader.vector(start.find("position"), own=name, wanted=INERTIAL),
        orientation=reader.orientation(element),
        velocity=reader.vector(start.find("velocity"), own=name, wanted=name),
        angular_velocity=reader.vector(start.find("angularVelocity"), own=name, wanted=name),
    )


def _mass(body: Element, reader: Reader) -> float:
    element = body.find("mass")
    mass = reader.number(element, "mass")
    if mass <= 0.0 and element is not None and reader.faults.sound(element):
        reader.faults.add(element, f"the mass is {mass:g} kg; it must be greater than zero")
    return mass


def _inertia(body: Element, mass: float, r_BG: Vector, reader: Reader) -> Matrix:
    """Tensor about G in body axes [kg m^2], checked."""
    moi = body.find("moi")
    assert moi is not None  # the schema requires it
    J = symmetric(*reader.numbers(moi, _ENTRIES, "inertia"))
    scale = float(np.abs(J).max())
    sources = [moi]
    if attribute(moi, "about", "G") == "B":
        J = about_mass_centre(J, mass, r_BG)
        sources += [*body.iterfind("mass"), *body.iterfind("rGB")]
    if all(map(reader.faults.sound, sources)):
        complaint = impossible(J, scale)
        if complaint:
            reader.faults.add(moi, complaint)
    return J


def symmetric(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Matrix:
    """The symmetric matrix of its six entries."""
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def about_mass_centre(J_B: Matrix, mass: float, r: Vector) -> Matrix:
    """``J_G = J_B - m (r.r 1 - r r^T)``, the parallel-axis theorem; ``r`` from B to G."""
    x, y, z = r
    part = symmetric(y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    rows = (np.array(J_B) - mass * np.array(part)).tolist()
    return (tuple(rows[0]), tuple(rows[1]), tuple(rows[2]))


def impossible(J: Matrix, scale: float) -> str:
    """Why no body has the inertia tensor ``J`` about its mass centre; "" for a possible one.

    ``scale`` is the largest entry as given, whose round-off ``J`` carries.
    """
    smallest, middle, largest = np.linalg.eigvalsh(J).tolist()
    moments = f"principal moments about G {smallest:.6g}, {middle:.6g}, {largest:.6g} kg-m^2"
    if smallest <= POSITIVE * scale:
        return f"{moments}: all must be greater than zero; give a small one in place of zero"
    if largest > smallest + middle + TRIANGLE * scale:
        return f"{moments}: none may exceed the sum of the other two; check entries and units"
    return ""
