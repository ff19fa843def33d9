"""Rules about loads and prescribed motions: what they act on, and numbers that have a sign."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from msahl.algebra.functions import Law, build_laws, evaluate
from msahl.algebra.many import dist, hypot
from msahl.algebra.vector import Vector
from msahl.check.context import Context
from msahl.check.ends import apart, arm, ends_findings, frame_findings, is_placed, points, tolerance
from msahl.check.faults import Finding, negative
from msahl.check.joints import coordinate_findings
from msahl.check.signals import (
    expression_findings,
    joint_actuator_findings,
    marker_actuator_findings,
)
from msahl.joints.registry import KINDS
from msahl.laws.law import CoordinateLaw, PointLaw
from msahl.laws.registry import JOINT_LAWS, POINT_LAWS
from msahl.model import (
    Bushing,
    ConcentratedLoad,
    JointActuator,
    JointLoad,
    JointMotion,
    JointSpring,
    MarkerActuator,
    PointLoad,
    PointMotion,
    Simulation,
    SpringDamper,
)
from msahl.model.scheme import AUTO, COLLOCATION

SAME_SPEED, AT_REST, NEAR = 1e-9, 1e-4, 1e-9
"""Jump of a table's rate, relative to the largest, that is round-off of entries, and the slope at
which a spline ends that is meant to be none: it follows samples of a smooth motion. Fraction of an
interval within which the rate at its end is taken."""
UNIT_LENGTH = 1e-9
"""Largest difference from one of the length of a unit vector."""


def moving_body_findings(body: str, context: Context) -> Iterator[Finding]:
    """Find a ground where a body that moves is needed."""
    if body in context.grounds:
        yield Finding("body", f"'{body}' is a ground and never moves; name a rigid body")


def concentrated_findings(load: ConcentratedLoad, context: Context) -> Iterator[Finding]:
    """Find a load on a ground, and what is wrong with its expression."""
    yield from moving_body_findings(load.body, context)
    if load.expression is not None:
        yield from expression_findings("law", load.expression, context)


def point_load_findings(load: PointLoad, context: Context) -> Iterator[Finding]:
    """Find a force on a ground, a law that does not exist, and numbers it does not take."""
    yield from moving_body_findings(load.body, context)
    yield from law_findings(load, POINT_LAWS)


def law_findings(
    load: PointLoad | JointLoad, laws: Mapping[str, PointLaw] | Mapping[str, CoordinateLaw]
) -> Iterator[Finding]:
    """Find a law that is none of the ``laws``, and numbers that are not those of its fields."""
    law = laws.get(load.law)
    if law is None:
        yield Finding("law", f"unknown law '{load.law}'; expected one of {', '.join(laws)}")
        return
    values, wanted = dict(load.parameters), [field.name for field in law.fields]
    if sorted(values) != sorted(wanted):
        message = f"a {load.law} has the parameters {' and '.join(wanted)}; give these"
        yield Finding("parameters", message)
        return
    for field in law.fields:
        value = values[field.name]
        if value < field.least:
            least = f"{field.least:g}" if field.least else "zero"
            yield Finding(field.name, f"it is {value:g}; it must not be less than {least}")
        elif not value > field.above:
            above = f"{field.above:g}" if field.above else "zero"
            yield Finding(field.name, f"it is {value:g}; it must be greater than {above}")


def spring_findings(spring: SpringDamper, context: Context) -> Iterator[Finding]:
    """Find impossible ends and numbers of a spring-damper between two points."""
    yield from ends_findings(spring, context)
    yield from negative("damping", spring.damping)
    yield from negative("free_length", spring.free_length)
    yield from compliance_findings(spring)


def compliance_findings(spring: SpringDamper | JointSpring) -> Iterator[Finding]:
    """Find a law that has no compliance."""
    if not spring.compliance:
        return
    if spring.table is not None:
        message = (
            'form="compliance" is for a linear spring, and <table> is not one; give a <stiffness>, '
            "or delete form"
        )
        yield Finding("table", message)
    elif not spring.stiffness > 0.0:
        message = (
            f'form="compliance" needs the inverse of the stiffness, which is '
            f"{spring.stiffness:g}; give one greater than zero, or delete form"
        )
        yield Finding("stiffness", message)


def length_findings(spring: SpringDamper, context: Context) -> Iterator[Finding]:
    """Find a spring whose points coincide at t = 0, which leaves it without a direction."""
    here, there = points(spring, context)
    if dist(here, there) <= tolerance(here, there, arm(spring), context):
        message = "its length is zero at t = 0, so it has no direction; move one of its points"
        yield Finding("", message)


def joint_spring_findings(spring: JointSpring, context: Context) -> Iterator[Finding]:
    """Find a coordinate that does not exist, and negative damping."""
    yield from coordinate_findings("joint", spring.joint, spring.coordinate, context)
    yield from negative("damping", spring.damping)
    yield from compliance_findings(spring)


def bushing_findings(bushing: Bushing, context: Context) -> Iterator[Finding]:
    """Find impossible ends, frames and numbers of a bushing."""
    yield from ends_findings(bushing, context)
    yield from frame_findings(bushing.parent_axes, "parent_axes")
    yield from frame_findings(bushing.child_axes, "child_axes")
    if min(bushing.damping) < 0.0:
        message = "a damping is less than zero; a damper only removes energy: give zero or more"
        yield Finding("numbers", message)
    if not any((*bushing.stiffness, *bushing.damping)):
        yield Finding("", "it has neither stiffness nor damping; add one")
    if bushing.compliance and (min(bushing.stiffness) < 0.0 or not any(bushing.stiffness)):
        message = (
            'form="compliance" needs the inverse of each stiffness that is not zero, and at least '
            "one; give stiffnesses greater than zero, or delete form"
        )
        yield Finding("numbers", message)


def joint_load_findings(load: JointLoad, context: Context) -> Iterator[Finding]:
    """Find a coordinate or a law that does not exist, numbers it does not take, and a joint whose
    reaction the law needs and which is not modelled.
    """
    yield from coordinate_findings("joint", load.joint, load.coordinate, context)
    kind = KINDS.get(context.kinds.get(load.joint, ""))
    law = JOINT_LAWS.get(load.law)
    if kind is not None and law is not None and law.by_reaction and not kind.bearing:
        known = ", ".join(name for name, other in KINDS.items() if other.bearing)
        yield Finding("joint", f"{law.name} in a {kind.name} is not modelled; name one of {known}")
    yield from law_findings(load, JOINT_LAWS)


def joint_motion_findings(motion: JointMotion, context: Context) -> Iterator[Finding]:
    """Find a coordinate that does not exist."""
    yield from coordinate_findings("joint", motion.joint, motion.coordinate, context)


def point_motion_findings(motion: PointMotion, context: Context) -> Iterator[Finding]:
    """Find a point of a ground, and a direction that is no unit vector."""
    yield from moving_body_findings(motion.body, context)
    yield from direction_findings("direction", motion.direction)
    length = hypot(*motion.direction)
    if length and not abs(length - 1.0) <= UNIT_LENGTH:
        yield Finding("direction", f"its length is {length:g}; give a vector of length 1")


def direction_findings(part: str, a: Vector) -> Iterator[Finding]:
    """Find a direction that is zero."""
    if hypot(*a) == 0.0:
        yield Finding(part, f"the {part} is zero; give a direction, for example 0 0 1")


def start_findings(load: Any, context: Context) -> Iterator[Finding]:
    """Find a spring of no length, and a bushing whose points do not coincide at t = 0."""
    if isinstance(load, SpringDamper) and is_placed(load, context):
        yield from length_findings(load, context)
    counts = isinstance(load, Bushing) and not load.aligned and not context.project
    if counts and is_placed(load, context):
        yield from apart(load, context)


RULES: dict[type, Callable[[Any, Context], Iterator[Finding]]] = {
    ConcentratedLoad: concentrated_findings,
    PointLoad: point_load_findings,
    SpringDamper: spring_findings,
    JointSpring: joint_spring_findings,
    Bushing: bushing_findings,
    JointLoad: joint_load_findings,
    JointMotion: joint_motion_findings,
    PointMotion: point_motion_findings,
    JointActuator: joint_actuator_findings,
    MarkerActuator: marker_actuator_findings,
}
"""The rules of each kind of load and motion that need no places of bodies."""


def element_findings(element: Any, context: Context) -> Iterator[Finding]:
    """Find what is wrong with a load or motion, apart from places, names, laws and sizes."""
    yield from RULES[type(element)](element, context)


def speed_jumps(
    motions: Sequence[JointMotion | PointMotion], simulation: Simulation
) -> Iterator[tuple[int, str]]:
    """Yield (index, message) for each prescribed motion by a linear table whose speed jumps during
    a run by a tolerance: its impulses are in no step, however short.
    """
    given = simulation.local_tolerance is not None or simulation.tolerance is not None
    if simulation.scheme != AUTO and not (given and simulation.scheme in COLLOCATION):
        return
    for index, motion in enumerate(motions):
        if motion.law.kind != "linear":
            continue
        inside = jumps_of_speed(motion.law, simulation.t_final)
        if inside:
            yield (
                index,
                f"the speed of a linear table jumps at its entries, first at t = {inside[0]:g} s, "
                'which no step by a tolerance can follow: write interpolation="cubic" or a <ramp>, '
                "or run it with steps of a given size by the scheme preserving or decaying",
            )


def jumps_of_speed(law: Law, end: float) -> list[float]:
    """Return the times before ``end`` [s] at which the rate of a table jumps: at the entries of a
    linear one, and where a cubic one begins or ends with a slope, as it is constant outside.
    """
    if law.kind not in ("linear", "cubic"):
        return []
    half = len(law.numbers) // 2
    x, y = np.array(law.numbers[:half]), np.array(law.numbers[half:])
    slopes = np.diff(y) / np.diff(x)
    before, after, same = [0.0, *slopes], [*slopes, 0.0], SAME_SPEED
    if law.kind == "cubic":
        laws, near = build_laws([law]), NEAR * np.diff(x)
        first, last = (evaluate(laws, 0, t)[1] for t in (x[0] + near[0], x[-1] - near[-1]))
        x, before, after, same = x[[0, -1]], [0.0, last], [first, 0.0], AT_REST
    jumps = np.abs(np.subtract(after, before)) > same * np.abs(slopes).max()
    return [float(t) for t in x[jumps & (x > 0.0) & (x < end)]]


def repeated_motions(
    motions: Sequence[tuple[str, str]], describe: Callable[[int], str]
) -> Iterator[tuple[int, str]]:
    """Yield (index, message) for each further prescribed motion of one (joint, coordinate)."""
    taken: dict[tuple[str, str], int] = {}
    for index, (joint, coordinate) in enumerate(motions):
        first = taken.setdefault((joint, coordinate), index)
        if first != index:
            place = describe(first)
            message = f"the {coordinate} of '{joint}' already has a prescribed motion ({place})"
            yield index, f"{message}; keep one"
