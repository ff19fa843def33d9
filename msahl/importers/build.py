"""A robot becomes records of a model, with the coordinates of joints at t = 0 beside them."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from msahl.algebra.rotation_arrays import parameters, plain_vector
from msahl.algebra.vector import IDENTITY, ZERO, Matrix
from msahl.check.directions import clean
from msahl.deck.faults import Element
from msahl.importers.bodies import Part, Parts, carrier, parts_of, tiny_inertia, without
from msahl.importers.contacts import Candidate, candidates
from msahl.importers.drives import add_drive, add_thrust
from msahl.importers.inertia import matrix
from msahl.importers.joints import Ends, Start, groups, motion, placed, rigid
from msahl.importers.loads import add_forces, add_relation
from msahl.importers.made import Along, Ball, Made
from msahl.importers.names import Names
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log
from msahl.importers.robot import HERE, Axis, Closure, Inertia, Link, Look, Pose, Robot
from msahl.importers.spatial_loads import add_free_damping
from msahl.joints.registry import KINDS
from msahl.model import (
    ConcentratedLoad,
    Ground,
    Joint,
    Marker,
    Model,
    RigidBody,
    Shape,
    Simulation,
)
from msahl.model.scheme import AUTO

FIRST_STEP, END, OUTPUT = 1e-3, 2.0, 0.01
"""First step size, end and time between output times of the deck's run [s]."""

FLOAT = "; --base free lets its base move"


class Built(NamedTuple):
    """A model whose bodies stand at the inertial origin unless they are free, and the ``starts`` of
    its joints by name, which place them; ``candidates`` are contacts that it may have where they
    do not overlap then."""

    model: Model
    starts: dict[str, Start]
    candidates: list[Candidate]


def build(robot: Robot, options: ImportOptions, log: Log) -> Built:
    """Return the model of a robot; raises ``DeckError`` for links that cannot move."""
    body_names = Names()
    _mark_driven(robot)
    parts = parts_of(robot, options, body_names, log)
    ground = next(iter(parts.bodies))
    if len(parts.bodies) == 1:
        root = root_of(robot)
        remedy = FLOAT if root.tag == "robot" else "; give one of them a joint"
        log.stop(root, f"nothing in it moves: all links are fixed to the ground{remedy}")
    made = Made(ground, Names(), body_names)
    for part in parts.bodies.values():
        if part.link is not None:
            _add_body(part, part.link, parts, robot, made)
    for closure in robot.closures:
        _close(closure, parts, robot, made)
    add_forces(made, options, log)
    tiny = tiny_inertia(robot)
    for relation in robot.relations:
        add_relation(relation, made, float(tiny.J[0, 0]), log)
    for drive in robot.drives:
        add_drive(drive, made, log)
    for thrust in robot.thrusts:
        add_thrust(thrust, parts, made, log)
    _compensate(robot, parts, made)
    model = Model(
        gravity=robot.gravity,
        grounds=(Ground(ground),),
        bodies=tuple(made.bodies),
        joints=tuple(made.joints),
        loads=tuple(made.loads),
        simulation=Simulation(robot.name, FIRST_STEP, END, scheme=AUTO, output_interval=OUTPUT),
        couplings=tuple(made.couplings),
        markers=(*_markers(parts, body_names), *made.markers),
        signals=tuple(made.signals),
        shapes=tuple(shape for part in parts.bodies.values() for shape in _shapes(part)),
    )
    return Built(model, made.starts, candidates(robot, parts, made, options.restitution))


def root_of(robot: Robot) -> Element:
    """Return the element that all links stand in."""
    return next(iter(robot.links.values())).element.getroottree().getroot()


def _mark_driven(robot: Robot) -> None:
    """Mark the axes that relations and actuators refer to."""
    names = {name for r in robot.relations for name in (r.first, r.second)}
    names |= {name for drive in robot.drives for name, _ in drive.terms}
    for link in robot.links.values():
        for axis in link.axes:
            axis.driven = axis.name in names


def _add_body(part: Part, link: Link, parts: Parts, robot: Robot, made: Made) -> None:
    """Add a body and the joints that carry it, with a small body between each two of them."""
    parent, outer = parts.places[link.parent]
    pose = outer.after(link.pose)
    if part.rigid is not None:
        holder, point = part.rigid
        ends = Ends(made.names.unique(f"{link.name} fixed"), holder, part.name, Pose(HERE.R, point))
        _add_joint(rigid(ends).joint, Start(), made)
    elif link.axes[0].kind == "free":
        _add_free(part, link, pose, parts, robot, made)
        return
    found = groups(link.axes)
    for number, group in enumerate(found):
        last = number == len(found) - 1
        child = part.name if last else made.body_names.unique(f"{group[-1].name} carrier")
        if not last:
            point = found[number + 1][0].point
            made.bodies.append(_body(child, carrier(part.inertia, point)))
        ends = Ends(made.names.unique(group[0].name), parent, child, pose)
        joint, start, coordinates = placed(group, ends)
        _add_joint(joint, start, made)
        for axis in group:
            made.start_of[axis.name] = start
            if axis.name in coordinates:
                place = Along(axis, joint.name, coordinates[axis.name], start)
                made.along[axis.name] = place
            elif axis.kind == "ball":
                frame = matrix_rows(pose.R.T)
                made.balls[axis.name] = Ball(axis, parent, child, frame)
        parent, pose = child, HERE
    made.bodies.append(_body(part.name, without(part.inertia, max(0, len(found) - 1))))


def _add_joint(joint: Joint, start: Start, made: Made) -> None:
    made.joints.append(joint)
    made.starts[joint.name] = start


def _body(name: str, inertia: Inertia) -> RigidBody:
    """Return a body at the inertial origin."""
    zero = (ZERO,) * 4
    return RigidBody(name, inertia.mass, plain_vector(inertia.c), matrix(inertia.J), *zero)


def _add_free(part: Part, link: Link, pose: Pose, parts: Parts, robot: Robot, made: Made) -> None:
    """Add a body without joints, where it is at t = 0."""
    axis = link.axes[0]
    place = world_pose(link, robot).after(parts.places[link.name][1])
    body = _body(part.name, part.inertia)
    v, w = axis.velocity
    made.bodies.append(
        RigidBody(
            *(body.name, body.mass, body.r_BG, body.inertia),
            plain_vector(place.p),
            plain_vector(parameters(place.R)),
            plain_vector(place.R.T @ v),
            plain_vector(w),
        )
    )
    if axis.damping:
        add_free_damping(axis, body.name, made)


def _compensate(robot: Robot, parts: Parts, made: Made) -> None:
    """Add the forces that take off the weight of links, each at the mass centre of its link."""
    for link in robot.links.values():
        body, pose = parts.places[link.name]
        weight = -link.compensated * link.inertia.mass * np.array(robot.gravity)
        if body != made.ground and weight.any():
            name = made.names.unique(f"{link.name} gravity compensation")
            point = plain_vector(pose.p + pose.R @ link.inertia.c)
            load = (name, body, point, plain_vector(weight), made.ground, ZERO, body)
            made.loads.append(ConcentratedLoad(*load))


def world_pose(link: Link, robot: Robot, at_start: bool = True) -> Pose:
    """Return where a link is at t = 0, or at its own pose and those of all its parents."""
    pose = HERE
    while True:
        own = link.pose
        for axis in link.axes if at_start else ():
            if axis.placed is not None:
                return axis.placed.after(pose)
            own = own.after(motion(axis))
        pose = own.after(pose)
        if not link.parent:
            return pose
        link = robot.links[link.parent]


def _close(closure: Closure, parts: Parts, robot: Robot, made: Made) -> None:
    """Add a joint that closes a loop; coordinates of the joints within it become approximate."""
    (parent, outer), (child, inner) = (parts.places[name] for name in closure.links)
    here, there = outer.after(closure.poses[0]), inner.after(closure.poses[1])
    points = plain_vector(here.p), plain_vector(there.p)
    frames = matrix_rows(here.R.T), matrix_rows(there.R.T)
    name = made.names.unique(closure.name)
    given = (("pitch", closure.pitch),) if closure.pitch else ()
    made.joints.append(Joint(name, closure.kind, parent, child, *points, *frames, given))
    if KINDS[closure.kind].axes:  # the deck's text has axes and references in place of frames
        made.starts[name] = Start(approximate=True)
    if closure.axis is not None:
        loose = made.starts[name]
        place = Along(closure.axis, name, closure.axis.coordinate, loose)
        made.along[closure.axis.name] = place
    for axis in loop_axes(closure.links, robot):
        if axis.name in made.start_of:
            made.start_of[axis.name].approximate = True


def loop_axes(links: Iterable[str], robot: Robot) -> list[Axis]:
    """Return the axes of the links between two links and their nearest common parent."""
    chains = []
    for name in links:
        chain = []
        while name:
            chain.append(name)
            name = robot.links[name].parent
        chains.append(chain)
    apart = set(chains[0]) ^ set(chains[1])
    return [axis for name in apart for axis in robot.links[name].axes]


def matrix_rows(R: np.ndarray) -> Matrix:
    """Return a rotation as a frame of records: its rows are unit vectors without rounding errors
    where they are coordinate directions."""
    x, y, z = (clean(plain_vector(row)) for row in R)
    return (x, y, z)


def _markers(parts: Parts, names: Names) -> Iterable[Marker]:
    """Yield a marker for each frame that is fixed in a body."""
    for part in parts.bodies.values():
        for name, pose in part.frames if part.link is not None else ():
            axes = matrix_rows(pose.R.T)
            yield Marker(names.unique(name), part.name, plain_vector(pose.p), axes)


def _shapes(part: Part) -> Iterable[Shape]:
    for look in part.looks:
        yield _shape(part.name, look)


def _shape(body: str, look: Look) -> Shape:
    axes = IDENTITY if look.kind == "sphere" else matrix_rows(look.pose.R.T)
    position = plain_vector(look.pose.p)
    return Shape(body, look.kind, look.size, position, axes, look.colour, look.file)
