"""Reader of URDF: a ``<robot>`` of links and joints, as ROS has it.

Axes and origins: a joint's frame is that of its child at the value zero; roll, pitch and yaw rotate
about x, y and z of the parent, in this order. A joint without ``<axis>`` has x. Inertia tensors are
about the mass centre in the axes of ``<inertial><origin>``.
"""

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.inertia import checked
from msahl.importers.joints import motion
from msahl.importers.meshes import MeshFiles
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, direction, number, numbers, unknown
from msahl.importers.robot import HERE, Axis, Inertia, Link, Look, Pose, Relation, Robot

KINDS = {
    "revolute": "hinge",
    "continuous": "hinge",
    "prismatic": "slide",
    "planar": "planar",
    "floating": "free",
    "fixed": "",
}
"""Types of joints, and what they are here."""
WORLD = "world"
"""A root of this name without mass is the ground."""
CONTACT = "shapes are not made contacts"
LIMITED = ("revolute", "prismatic")
"""Types of joints that have limits."""


def read_urdf(root: Element, options: ImportOptions, meshes: MeshFiles, log: Log) -> Robot:
    """Return the robot of a ``<robot>``; faults and what is not carried over go to ``log``."""
    unknown(root, ("link", "joint", "material"), log)
    colours = {attribute(e, "name"): _colour(e, {}, log) for e in root.iterfind("material")}
    links: dict[str, Link] = {}
    for element in root.iterfind("link"):
        name = _name(element, links, log)
        links[name] = Link(name, element)
        _read_link(links[name], colours, options, meshes, log)
    robot = Robot(attribute(root, "name"), links)
    if not links:
        log.stop(root, "it has no <link>; nothing moves")
    axes: dict[str, Axis] = {}
    for element in root.iterfind("joint"):
        _read_joint(element, robot, axes, log)
    log.raise_if_any()
    _set_relations(root, axes, robot, log)
    _set_base(robot, options)
    robot.links = _sorted(robot, log)
    log.raise_if_any()
    return robot


def _name(element: Element, taken: dict[str, Link] | dict[str, Axis], log: Log) -> str:
    name = attribute(element, "name")
    if not name:
        log.fault(element, f"the {element.tag} has no name; give one")
    elif name in taken:
        log.fault(element, f"the name is taken by another {element.tag}; choose another")
    return name


def origin(element: Element | None, log: Log) -> Pose:
    """Return the frame that an ``<origin>`` gives."""
    if element is None:
        return HERE
    rpy = numbers(element, "rpy", log)
    return Pose(roll_pitch_yaw(*rpy), np.array(numbers(element, "xyz", log)))


def roll_pitch_yaw(roll: float, pitch: float, yaw: float) -> np.ndarray:
    """Return R = R_z(yaw) R_y(pitch) R_x(roll)."""
    (a, b, c), (x, y, z) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    about_x = np.array([[1.0, 0.0, 0.0], [0.0, a, -x], [0.0, x, a]])
    about_y = np.array([[b, 0.0, y], [0.0, 1.0, 0.0], [-y, 0.0, b]])
    about_z = np.array([[c, -z, 0.0], [z, c, 0.0], [0.0, 0.0, 1.0]])
    return np.asarray(about_z @ about_y @ about_x)


def _read_link(
    link: Link, colours: dict[str, str], options: ImportOptions, meshes: MeshFiles, log: Log
) -> None:
    """Read inertia and shapes of a link: the visual ones, or else those for collisions."""
    element = link.element
    unknown(element, ("inertial", "visual", "collision"), log)
    for visual in element.iterfind("visual"):
        link.looks += _look(visual, colours, meshes, log)
    is_seen = bool(link.looks)
    for collision in element.iterfind("collision"):
        log.lost(collision, CONTACT)
        if not is_seen:
            link.looks += _look(collision, colours, meshes, Log(log.file))
    inertial = element.find("inertial")
    if inertial is not None:
        link.inertia = checked(_inertia(inertial, log), link, inertial, options, meshes, log)


def _inertia(element: Element, log: Log) -> Inertia:
    """Return what an ``<inertial>`` says."""
    mass, tensor = element.find("mass"), element.find("inertia")
    m = number(mass, "value", log) if mass is not None else 0.0
    J = np.zeros((3, 3))
    if tensor is not None:
        for (i, j), name in zip(
            ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)),
            ("ixx", "iyy", "izz", "ixy", "ixz", "iyz"),
            strict=True,
        ):
            J[i, j] = J[j, i] = number(tensor, name, log)
    return Inertia(m, np.zeros(3), J).seen_from(origin(element.find("origin"), log))


def _colour(element: Element | None, known: dict[str, str], log: Log) -> str:
    """Return the colour of a ``<material>`` as #rrggbb, "" for none."""
    if element is None:
        return ""
    colour = element.find("color")
    if colour is None:
        return known.get(attribute(element, "name"), "")
    return hexadecimal(numbers(colour, "rgba", log, (0.5, 0.5, 0.5, 1.0), 4))


def hexadecimal(rgba: list[float]) -> str:
    """Return a colour of red, green, blue (and more) from 0 to 1 as #rrggbb."""
    return "#" + "".join(f"{round(255 * min(max(part, 0.0), 1.0)):02x}" for part in rgba[:3])


def _look(visual: Element, colours: dict[str, str], meshes: MeshFiles, log: Log) -> list[Look]:
    """Return the shape of a ``<visual>``; none if msahl has no such one."""
    pose = origin(visual.find("origin"), log)
    colour = _colour(visual.find("material"), colours, log)
    geometry = visual.find("geometry")
    for element in geometry if geometry is not None else ():
        kind = str(element.tag)
        size: tuple[float, ...] = ()
        if kind == "mesh":
            return meshes.look(element, attribute(element, "filename"), pose, colour, log)
        if kind == "box":
            size = tuple(numbers(element, "size", log))
        elif kind == "sphere":
            size = (number(element, "radius", log),)
        elif kind in ("cylinder", "capsule"):
            size = (number(element, "radius", log), number(element, "length", log))
        if size and min(size) > 0.0:
            return [Look(kind, size, pose, colour)]
        log.lost(element, "msahl has no such shape, or its sizes are not positive")
    return []


def _read_joint(element: Element, robot: Robot, axes: dict[str, Axis], log: Log) -> None:
    """Put a joint into the link that it carries."""
    name = _name(element, axes, log)
    known = ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic")
    unknown(element, known, log)
    ends = []
    for side in ("parent", "child"):
        end = element.find(side)
        named = "" if end is None else attribute(end, "link")
        if named not in robot.links:
            log.fault(element if end is None else end, f"its {side} '{named}' is no link")
            return
        ends.append(named)
    kind = attribute(element, "type")
    if kind not in KINDS:
        log.fault(element, f"type '{kind}' is none of {', '.join(KINDS)}")
        return
    link = robot.links[ends[1]]
    if link.parent:
        log.fault(element, f"link '{link.name}' is the child of two joints; a robot is a tree")
        return
    link.parent, link.pose = ends[0], origin(element.find("origin"), log)
    axis = Axis(name, KINDS[kind], element)
    axes[name] = axis
    if not axis.kind:
        return
    _read_axis(axis, log)
    link.axes.append(axis)


def _read_axis(axis: Axis, log: Log) -> None:
    """Read direction, limits and dynamics of a joint that moves."""
    given, dynamics, limit = (axis.element.find(t) for t in ("axis", "dynamics", "limit"))
    if given is not None:
        axis.axis = direction(given, "xyz", log, (1.0, 0.0, 0.0))
    else:
        axis.axis = np.array([1.0, 0.0, 0.0])
    if limit is not None:
        _read_limit(axis, limit, log)
    if dynamics is None:
        return
    damping, friction = number(dynamics, "damping", log), number(dynamics, "friction", log)
    if axis.kind in ("hinge", "slide"):
        axis.damping, axis.friction = damping, friction
    elif damping or friction:
        log.lost(dynamics, f"a {axis.element.get('type')} joint has no damping and friction here")
    if damping < 0.0 or friction < 0.0:
        log.fault(dynamics, "damping and friction must not be negative")


def _read_limit(axis: Axis, limit: Element, log: Log) -> None:
    """Read the range of a joint; what bounds its rate and its load is listed."""
    lower, upper = number(limit, "lower", log), number(limit, "upper", log)
    if axis.element.get("type") in LIMITED:
        if lower < upper:
            axis.lower, axis.upper, axis.limit = lower, upper, limit
        else:
            log.lost(limit, "its range is empty: lower is not less than upper; the joint is free")
    others = [name for name in ("effort", "velocity") if limit.get(name) is not None]
    if others:
        log.lost(limit, f"its {' and '.join(others)}: nothing bounds the load and the rate")


def _set_relations(root: Element, axes: dict[str, Axis], robot: Robot, log: Log) -> None:
    """Read every ``<mimic>``; a joint that follows a fixed one is fixed itself."""
    for element in root.iterfind("joint/mimic"):
        holder = element.getparent()
        second = axes["" if holder is None else attribute(holder, "name")]
        first = axes.get(attribute(element, "joint"))
        ratio, offset = number(element, "multiplier", log, 1.0), number(element, "offset", log)
        if not second.kind:
            log.lost(element, "its joint is fixed")
        elif first is None or first is second or {first.kind, second.kind} & {"planar", "free"}:
            name = attribute(element, "joint")
            log.fault(element, f"joint '{name}' is no other joint that rotates or slides")
        elif not first.kind:
            log.changed(element, f"joint '{first.name}' is fixed, so this one is fixed, too")
            _fix(second, offset, robot)
        else:
            robot.relations.append(Relation(first.name, second.name, ratio, offset, element))


def _fix(axis: Axis, value: float, robot: Robot) -> None:
    """Fix the link of an axis where that has a ``value``."""
    link = next(link for link in robot.links.values() if axis in link.axes)
    axis.value = value
    link.pose, link.axes, axis.kind = link.pose.after(motion(axis)), [], ""


def _set_base(robot: Robot, options: ImportOptions) -> None:
    """Let the roots float, if that is asked for and they are not the world."""
    for link in robot.links.values():
        world = link.name == WORLD and not link.inertia.mass
        if options.base == "free" and not link.parent and not world:
            link.axes = [Axis(f"{link.name} floats", "free", link.element)]


def _sorted(robot: Robot, log: Log) -> dict[str, Link]:
    """Return the links in an order in which parents come first; circles are faults."""
    children: dict[str, list[Link]] = {}
    for link in robot.links.values():
        children.setdefault(link.parent, []).append(link)
    found = list(children.get("", ()))
    for link in found:
        found += children.get(link.name, ())
    if len(found) < len(robot.links):
        reached = {link.name for link in found}
        lost = next(link for link in robot.links.values() if link.name not in reached)
        log.fault(lost.element, "its joints form a circle of parents; delete one of them")
    return {link.name: link for link in found}
