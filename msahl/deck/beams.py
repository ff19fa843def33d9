"""Reader of beams: elements -> records of the beam, of its nodes, and of its outline."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import plain_vector
from msahl.algebra.vector import IDENTITY, ZERO, Vector
from msahl.beams import sections
from msahl.beams.lines import Arc, CentreLine, LineError, Spline, Straight, frames
from msahl.beams.sections import RIGID, SIZES, Geometry, Material
from msahl.check.beams import beam_findings, geometry_findings
from msahl.check.context import INERTIAL
from msahl.check.faults import number_findings
from msahl.deck.faults import Element, attribute, text
from msahl.deck.states import with_states
from msahl.deck.units import UNITS
from msahl.deck.values import Reader
from msahl.elements.beams.build import Line, build_beam
from msahl.model.beams import Beam, Section
from msahl.model.bodies import RigidBody
from msahl.model.shapes import BeamShape, Points
from msahl.records import record

STIFFNESSES = ("EA", "GA2", "GA3", "GJ", "EI2", "EI3")
"""Stiffnesses of a section in the order of strains; the first three are forces."""

FACTORS = ("torsionConstant", "shearFactor2", "shearFactor3")

THIN = 0.1
"""Largest size of the outline of a section given by stiffnesses, by the beam's length."""


@record
class BuiltBeam:
    """A beam, its nodes, and what it looks like; ``nodes`` are named in any case, and ``beam`` is
    None if it has a fault."""

    beam: Beam | None
    nodes: tuple[RigidBody, ...]
    shape: BeamShape | None


class _Frame(NamedTuple):
    """Where the axes are in which a beam is described, and how they move: origin, axes, velocities
    [SI], all in inertial axes."""

    x: np.ndarray
    R: np.ndarray
    v: np.ndarray
    w: np.ndarray


SectionOf = Callable[[float], Section]


NOTHING = BuiltBeam(None, (), None)
"""Stands for a beam with faults."""


def read_beam(element: Element, reader: Reader) -> BuiltBeam:
    """Return the records of a ``<beam>``, and make its nodes known by axes and place."""
    try:
        with np.errstate(all="ignore"):
            return _read_beam(element, reader)
    except LineError as error:
        place = element.find(error.part) if error.part else None
        reader.faults.add(element if place is None else place, str(error))
    except (ArithmeticError, ValueError, np.linalg.LinAlgError):
        message = "its numbers are too large or too small to compute with; correct them"
        reader.faults.add(element, message)
    return NOTHING


def _read_beam(element: Element, reader: Reader) -> BuiltBeam:
    name = text(element.find("name"))
    mesh = reader.meshes[name]
    for k in range(1, mesh.count + 1):
        reader.context.axes[f"{name}.{k}"] = IDENTITY
    frame = _read_frame(element, name, reader)
    line = _read_line(element, reader)
    read = _read_sections(element, reader)
    tau = reader.number(element.find("dampingTime"), "time")
    if tau < 0.0:
        reader.faults.add(element, "<dampingTime> is less than zero; give zero or more")
    if line is None or read is None or not reader.faults.sound(element):
        return NOTHING
    section, outlines = read
    axes = _axes(element, line, mesh.stations * line.length, reader)
    beam, nodes = build_beam(
        name,
        Line(
            mesh.degree,
            np.diff(mesh.ends) * line.length,
            frame.x + line.points(mesh.stations * line.length) @ frame.R.T,
            axes if np.array_equal(frame.R, np.eye(3)) else frame.R @ axes,
        ),
        lambda s: section(s / line.length),
        _damping(tau, attribute(element, "theory", "timoshenko")),
    )
    nodes = tuple(_moving(node, frame) for node in nodes)
    given = element.find("nodes")
    if given is not None:
        nodes = with_states(nodes, given, "nodes", reader)
    if not reader.faults.sound(element):
        return NOTHING
    reader.add(element, [*number_findings(beam), *beam_findings(beam, nodes)])
    if not reader.faults.sound(element):
        return NOTHING
    for node in nodes:
        reader.context.axes[node.name] = matrix(node.orientation)
        reader.context.place(node.name, node.position)
        reader.bodies[node.name] = node
    reader.lengths[name] = line.length
    colour = attribute(element, "colour").lower()
    start, end = (_outline(o, line.length) for o in outlines)
    return BuiltBeam(beam, nodes, BeamShape(name, start, end, colour))


def _damping(tau: float, theory: str) -> tuple[float, float, float, float, float, float]:
    """Return tau by strain; there is none where the strain is zero."""
    a, b, c, d, e, f = (0.0 if i in RIGID[theory] else tau for i in range(6))
    return (a, b, c, d, e, f)


def _read_frame(element: Element, name: str, reader: Reader) -> _Frame:
    """Return the axes of a beam, by its initial conditions."""
    start = element.find("initialConditions")
    vectors = [
        ZERO if start is None else reader.vector(start.find(tag), own=name, wanted=INERTIAL)
        for tag in ("position", "velocity", "angularVelocity")
    ]
    x, v, w = map(np.array, vectors)
    return _Frame(x, np.array(reader.context.axes[name]), v, w)


def _moving(node: RigidBody, frame: _Frame) -> RigidBody:
    """Return a node that moves with the beam's axes as one rigid body."""
    R = np.array(matrix(node.orientation))
    v = R.T @ (frame.v + np.cross(frame.w, np.array(node.position) - frame.x))
    return replace(node, velocity=plain_vector(v), angular_velocity=plain_vector(R.T @ frame.w))


def _axes(element: Element, line: CentreLine, s: np.ndarray, reader: Reader) -> np.ndarray:
    """Return the section's axes at arc lengths, in the axes of the beam."""
    name, given = text(element.find("name")), element.find("reference")
    reference = None
    if given is not None:
        reference = np.array(reader.vector(given, own=name, wanted=name))
        if not reference.any():
            raise LineError("reference", "the direction is zero; give another")
    return frames(line, s, reference, reader.number(element.find("twist"), "angle"))


def _read_line(element: Element, reader: Reader) -> CentreLine | None:
    """Return the centre line in the axes of the beam; None with a fault."""
    holder = element.find("centreLine")
    assert holder is not None  # the schema requires it
    (given,) = holder
    try:
        return LINES[str(given.tag)](given, reader)
    except LineError as error:
        place = given.find(error.part) if error.part else None
        reader.faults.add(given if place is None else place, str(error))
        return None


def _straight(given: Element, reader: Reader) -> CentreLine:
    start, end = (np.array(reader.components(given.find(tag))) for tag in ("start", "end"))
    return Straight(start, end)


def _arc(given: Element, reader: Reader) -> CentreLine:
    name = text(_beam_of(given).find("name"))
    start, centre = (np.array(reader.components(given.find(tag))) for tag in ("start", "centre"))
    axis = reader.vector(given.find("axis"), own=name, wanted=name)
    if not any(axis):
        raise LineError("axis", "the axis is zero; give a direction")
    return Arc(start, centre, np.array(axis), reader.number(given.find("angle"), "angle"))


def _spline(given: Element, reader: Reader) -> CentreLine:
    return Spline([reader.components(point) for point in given])


def _beam_of(element: Element) -> Element:
    return next(step for step in element.iterancestors() if step.tag == "beam")


LINES: dict[str, Callable[[Element, Reader], CentreLine]] = {
    "straight": _straight,
    "arc": _arc,
    "spline": _spline,
}


def _read_sections(
    element: Element, reader: Reader
) -> tuple[SectionOf, tuple[Points | None, Points | None]] | None:
    """Return the section by relative arc length, and the outlines at both ends; None with a fault.

    Its sizes, or stiffnesses, are linear between those at the ends.
    """
    holder, taper = element.find("section"), element.find("endSection")
    assert holder is not None  # the schema requires it
    (first,) = holder
    last = first if taper is None else taper[0]
    if first.tag != last.tag:
        message = f"the section is <{last.tag}> at the end but <{first.tag}> at the start"
        reader.faults.add(last, f"{message}; give both of one kind")
        return None
    theory = attribute(element, "theory", "timoshenko")
    if first.tag == "stiffnesses":
        ends = [_read_stiffnesses(given, theory, reader) for given in (first, last)]
        outlines = [_equivalent(K) for K, _, _ in ends]
    else:
        material = _read_material(element, reader)
        shapes = [_read_geometry(given, reader) for given in (first, last)]
        if material is None or not reader.faults.sound(element):
            return None
        return _of_shapes(str(first.tag), shapes, material, theory)
    if not reader.faults.sound(element):
        return None
    (K, m, i), (K1, m1, i1) = ends

    def of_stiffnesses(t: float) -> Section:
        inertia = plain_vector((1.0 - t) * np.array(i) + t * np.array(i1))
        return sections.section((1.0 - t) * K + t * K1, (1.0 - t) * m + t * m1, inertia, theory)

    return of_stiffnesses, (outlines[0], outlines[1])


_Shape = tuple[tuple[float, ...], dict[str, float]]
"""Sizes of a section's shape, and its torsion constant and shear factors where they are given."""


def _of_shapes(
    kind: str, shapes: list[_Shape], material: Material, theory: str
) -> tuple[SectionOf, tuple[Points, Points]]:
    """Return the section by relative arc length of a shape with sizes at both ends."""
    (first, given), (last, given_last) = shapes

    def section(t: float) -> Section:
        sizes = tuple((1.0 - t) * a + t * b for a, b in zip(first, last, strict=True))
        found = sections.geometry(kind, sizes, material.poisson)
        for tag, field in zip(FACTORS, ("torsion", "k2", "k3"), strict=True):
            if tag in given and tag in given_last:
                value = (1.0 - t) * given[tag] + t * given_last[tag]
                found = Geometry(**(found._asdict() | {field: value}))
        return sections.of_geometry(found, material, theory)

    return section, (sections.outline(kind, first), sections.outline(kind, last))


def _read_geometry(given: Element, reader: Reader) -> _Shape:
    """Return the sizes of a shape, and what it gives of torsion constant and shear factors."""
    sizes = reader.numbers(given, SIZES[str(given.tag)], "length")
    quantities = ("areaMoment", "", "")
    others = {
        tag: reader.number(place, quantity)
        for tag, quantity in zip(FACTORS, quantities, strict=True)
        if (place := given.find(tag)) is not None
    }
    reader.add(given, geometry_findings(str(given.tag), sizes, others))
    return sizes, others


def _read_material(element: Element, reader: Reader) -> Material | None:
    """Return the material; None with a fault."""
    given = element.find("material")
    if given is None:
        reader.faults.add(element, "<material> is missing; add it")
        return None
    E = reader.number(given.find("youngsModulus"), "stress")
    density = reader.number(given.find("density"), "density")
    shear, ratio = given.find("shearModulus"), given.find("poissonsRatio")
    if (shear is None) == (ratio is None):
        wrong = (
            "neither <poissonsRatio> nor <shearModulus>; add one"
            if shear is None
            else ("both <poissonsRatio> and <shearModulus>; keep one")
        )
        reader.faults.add(given, f"it has {wrong}")
        return None
    nu = reader.number(ratio)
    if not -1.0 < nu <= 0.5:
        reader.faults.add(given, f"Poisson's ratio is {nu:g}; it must be above -1, and at most 0.5")
        return None
    G = reader.number(shear, "stress") if shear is not None else 0.5 * E / (1.0 + nu)
    for tag, value in (("youngsModulus", E), ("shearModulus", G), ("density", density)):
        if not value > 0.0 and given.find(tag) is not None:
            reader.faults.add(given, f"<{tag}> is {value:g}; it must be greater than zero")
    return Material(E, G, density) if reader.faults.sound(given) else None


def _read_stiffnesses(
    given: Element, theory: str, reader: Reader
) -> tuple[np.ndarray, float, Vector]:
    """Return K (6, 6), mass per length and rotary inertia per length [SI]."""
    mass = reader.number(given.find("mass"), "massPerLength")
    place = given.find("inertia")
    x, y, z = (0.0,) * 3 if place is None else reader.numbers(place, "xyz", "inertiaPerLength")
    if place is not None and place.find("y") is None and place.find("z") is None:
        y = z = 0.5 * x
    if not mass > 0.0:
        reader.faults.add(given, "<mass> is not greater than zero; give the mass per length")
    matrix_given = given.find("matrix")
    if matrix_given is not None:
        K = _read_matrix(matrix_given, reader)
    else:
        K = np.diag(
            [
                reader.number(given.find(tag), "force" if i < 3 else "bendingStiffness")
                for i, tag in enumerate(STIFFNESSES)
            ]
        )
    free = [i for i in range(6) if i not in RIGID[theory]]
    missing = [STIFFNESSES[i] for i in free if not K[i, i] > 0.0]
    if missing and reader.faults.sound(given):
        words = f"<{'>, <'.join(missing)}>"
        reader.faults.add(given, f"theory {theory} needs {words} greater than zero; add them")
    elif np.linalg.eigvalsh(K[np.ix_(free, free)]).min() <= 0.0 and reader.faults.sound(given):
        message = "the matrix is not positive definite, so some strain would release energy"
        reader.faults.add(given, f"{message}; correct it")
    return K, mass, (x, y, z)


def _read_matrix(element: Element, reader: Reader) -> np.ndarray:
    """Return K of 36 numbers, by rows, or the 21 of its upper triangle, in SI."""
    numbers = np.array([float(word) for word in text(element).split()])
    K = np.eye(6)
    if numbers.size == 36:
        K = numbers.reshape(6, 6)
    elif numbers.size == 21:
        K[np.triu_indices(6)] = numbers
        K = np.triu(K) + np.triu(K, 1).T
    else:
        message = f"it has {numbers.size} numbers; give 36, by rows, or the 21 on and above"
        reader.faults.add(element, f"{message} the diagonal")
    if np.abs(K - K.T).max() > 1e-9 * np.abs(K).max():
        reader.faults.add(element, "the matrix is not symmetric; correct it")
    if not np.isfinite(K).all():
        reader.faults.add(element, "a number is too large; give smaller ones")
        return np.eye(6)
    if reader.unit_system == "US":
        force, foot = float(UNITS["force"]["lbf"]), float(UNITS["length"]["ft"])
        arms = np.array([1.0, 1.0, 1.0, foot, foot, foot])
        K = force * arms[:, None] * K * arms
    return np.asarray(K)


def _equivalent(K: np.ndarray) -> Points | None:
    """Return the outline of the rectangle with the same radii of gyration; None if they are not
    known."""
    if not min(K[0, 0], K[4, 4], K[5, 5]) > 0.0:
        return None
    b, h = (math.sqrt(12.0 * K[i, i] / K[0, 0]) for i in (5, 4))
    return sections.outline("rectangle", (b, h))


def _outline(points: Points | None, length: float) -> Points:
    """Return an outline for views, neither unknown nor thick."""
    if points is None:
        return sections.circle(0.01 * length)
    size = max(math.hypot(*point) for point in points)
    share = min(1.0, THIN * length / size)
    return tuple((share * y, share * z) for y, z in points)
