"""Reader of grounds and bodies: elements -> records.

What provides a frame is a ``RigidBody``, whatever its element takes its mass and inertia from:
``body_at_start`` adds its name and its start. The rest of the program sees the record alone.
"""

from collections.abc import Callable, Mapping
from dataclasses import asdict, replace

from msahl.algebra.many import largest
from msahl.algebra.vector import Matrix, Vector, axpy
from msahl.check.bodies import body_findings
from msahl.check.context import INERTIAL
from msahl.deck.faults import Element, attribute, text
from msahl.deck.values import Reader
from msahl.model.bodies import Ground, RigidBody

_ENTRIES = ("Ixx", "Iyy", "Izz", "Ixy", "Ixz", "Iyz")


def read_ground(element: Element, reader: Reader) -> Ground:
    """Return the record of a ``<ground>``."""
    return Ground(text(element.find("name")))


def read_rigid_body(element: Element, reader: Reader) -> RigidBody:
    """Return the record of a ``<rigidBody>``."""
    body, entries = given_body(element, reader)
    return _checked(element, body, largest(*map(abs, entries)), reader)


def given_body(element: Element, reader: Reader) -> tuple[RigidBody, tuple[float, ...]]:
    """Return the record of a ``<rigidBody>`` before it is checked, and the entries of the tensor as
    they are given [kg m^2]; with a ``Column`` and its reader those of many bodies at once."""
    mass = reader.number(element.find("mass"), "mass")
    r_BG = reader.components(element.find("rGB"))
    moi = element.find("moi")
    assert moi is not None  # the schema requires it
    entries = reader.numbers(moi, _ENTRIES, "inertia")
    J = symmetric(*entries)
    if attribute(moi, "about", "G") == "B":
        J = about_mass_centre(J, mass, r_BG)
    return _at_start(element, mass, r_BG, J, reader), entries


def body_at_start(
    element: Element,
    mass: float,
    r_BG: Vector,
    inertia: Matrix,
    reader: Reader,
    largest: float | None = None,
) -> RigidBody:
    """Return the record of a body of any kind, with the name and the start that its element gives:
    position in inertial axes, all else in its own. ``inertia`` is about G in body axes, ``largest``
    the largest entry that the deck gives of it, if it gives any.
    """
    given = _at_start(element, mass, r_BG, inertia, reader)
    return _checked(element, given, largest, reader)


def _at_start(
    element: Element, mass: float, r_BG: Vector, inertia: Matrix, reader: Reader
) -> RigidBody:
    name = reader.name(element)
    start = element.find("initialConditions")
    start = element if start is None else start  # then none of its children is found either
    return RigidBody(
        name=name,
        mass=mass,
        r_BG=r_BG,
        inertia=inertia,
        position=reader.vector(start.find("position"), own=name, wanted=INERTIAL),
        orientation=reader.orientation(element),
        velocity=reader.vector(start.find("velocity"), own=name, wanted=name),
        angular_velocity=reader.vector(start.find("angularVelocity"), own=name, wanted=name),
    )


def _checked(element: Element, body: RigidBody, largest: float | None, reader: Reader) -> RigidBody:
    """Return a body as joints place it, once it is checked."""
    by_joints = reader.starts.get(body.name)
    if by_joints is not None:
        found = {key: value for key, value in asdict(by_joints).items() if value is not None}
        body = replace(body, **found)
    _check(element, body, largest, reader)
    return body


def _check(element: Element, body: RigidBody, largest: float | None, reader: Reader) -> None:
    """Add what is wrong with mass and inertia; a tensor about B counts only if the mass and the
    place of the mass centre, by which it is taken to G, are right."""
    findings = list(body_findings(body, largest))
    moi = element.find("moi")
    if moi is not None and attribute(moi, "about", "G") == "B":
        others = [*element.iterfind("mass"), *element.iterfind("rGB")]
        if body.mass <= 0.0 or not all(map(reader.faults.sound, others)):
            findings = [finding for finding in findings if finding.part != "inertia"]
    reader.add(element, findings)


def symmetric(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Matrix:
    """Return the symmetric matrix of its six entries."""
    return ((xx, xy, xz), (xy, yy, yz), (xz, yz, zz))


def about_mass_centre(J_B: Matrix, mass: float, r: Vector) -> Matrix:
    """Return ``J_G = J_B - m (r.r 1 - r r^T)``, the parallel-axis theorem; ``r`` from B to G."""
    x, y, z = r
    part = symmetric(y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    return (
        axpy(-mass, part[0], J_B[0]),
        axpy(-mass, part[1], J_B[1]),
        axpy(-mass, part[2], J_B[2]),
    )


BODIES: Mapping[str, Callable[[Element, Reader], Ground | RigidBody]] = {
    "ground": read_ground,
    "rigidBody": read_rigid_body,
}
"""Readers by element, of all kinds but beams."""
