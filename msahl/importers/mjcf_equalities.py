"""Equalities of MJCF: couplings of joints and of fixed tendons, and joints that close loops.

MuJoCo's equalities are soft; here they are exact.
"""

from collections.abc import Mapping

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.build import world_pose
from msahl.importers.mjcf_bodies import WORLD, Tree
from msahl.importers.mjcf_settings import resolved, rotation_of, several
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import HERE, Closure, Pose, Relation, Robot, Terms

EXACT = "MuJoCo's equality is soft; here it is exact"
PROPORTION = "msahl couples two coordinates in proportion only"


def read_equalities(
    root: Element, tree: Tree, tendons: Mapping[str, Terms], robot: Robot, log: Log
) -> None:
    """Read the equalities that couple joints or close loops; others are noted."""
    for element in root.iterfind("equality/*"):
        resolved(element, tree.settings, log)
        if element.get("active") == "false":
            log.lost(element, "it is not active")
        elif element.tag == "joint":
            _read_relation(element, tree, robot, log)
        elif element.tag == "tendon":
            _read_tendons(element, tendons, tree, robot, log)
        elif element.tag in ("connect", "weld"):
            _read_closure(element, tree, robot, log)
        else:
            log.lost(element, "msahl has no such element")


def _read_relation(element: Element, tree: Tree, robot: Robot, log: Log) -> None:
    """Read an equality of two joints: y - y0 = a0 + a1 (x - x0)."""
    y = tree.axes.get(attribute(element, "joint1"))
    x = tree.axes.get(attribute(element, "joint2"))
    if y is None or ("joint2" in element.attrib and x is None):
        log.fault(element, "it names a joint that is none")
    elif x is None or {x.kind, y.kind} - {"hinge", "slide"}:
        log.lost(element, PROPORTION)
    else:
        _relate(element, {y.name: 1.0}, {x.name: 1.0}, tree, robot, log)


def _read_tendons(
    element: Element, tendons: Mapping[str, Terms], tree: Tree, robot: Robot, log: Log
) -> None:
    """Read an equality of two tendons: L - L_0 = a0 + a1 (L_2 - L_2_0)."""
    names = [attribute(element, name) for name in ("tendon1", "tendon2") if name in element.attrib]
    if any(name not in tendons for name in names):
        log.lost(element, "one of its tendons is not carried over")
        return
    sums: list[dict[str, float]] = [{}, {}]
    for total, name in zip(sums, names, strict=False):
        for joint, (c,) in tendons[name]:
            total[joint] = total.get(joint, 0.0) + c
    _relate(element, sums[0], sums[1], tree, robot, log)


def _relate(
    element: Element,
    left: Mapping[str, float],
    right: Mapping[str, float],
    tree: Tree,
    robot: Robot,
    log: Log,
) -> None:
    """Add the relation y = a0 + a1 x between sums of coordinates, each counted from the pose of the
    file, if two joints take part in it."""
    a = [*several(element, "polycoef", log, 5), 0.0, 0.0, 0.0, 0.0, 0.0][:5]
    if "polycoef" not in element.attrib:
        a[1] = 1.0
    sums = dict(left)
    for joint, c in right.items():
        sums[joint] = sums.get(joint, 0.0) - a[1] * c
    pairs = [(joint, c) for joint, c in sums.items() if c]
    if any(a[2:]) or len(pairs) != 2:
        log.lost(element, PROPORTION)
        return
    (second, c_2), (first, c_1) = pairs
    offset = sum(c * tree.axes[joint].zero for joint, c in pairs) + a[0]
    robot.relations.append(Relation(first, second, -c_1 / c_2, offset / c_2, element))
    log.changed(element, EXACT)


def _read_closure(element: Element, tree: Tree, robot: Robot, log: Log) -> None:
    """Read a ``<connect>`` or ``<weld>``: it is satisfied at the pose of the file, unless it says
    otherwise. A weld without torques is a connect."""
    found = _sides(element, tree, log)
    if found is None:
        return
    links, which, point, given = found
    kind = {"connect": "spherical", "weld": "rigid"}[str(element.tag)]
    if kind == "rigid" and number(element, "torquescale", log, 1.0) == 0.0:
        kind = "spherical"
    if given is None:
        zero = [HERE if n == WORLD else world_pose(robot.links[n], robot, False) for n in links]
        given = zero[1 - which].inverse().after(zero[which].after(point))
    poses = (given, point) if which else (point, given)
    name = attribute(element, "name") or f"{links[1]} to {links[0]}"
    robot.closures.append(Closure(name, kind, links, poses, element))
    log.changed(element, EXACT)


def _sides(
    element: Element, tree: Tree, log: Log
) -> tuple[tuple[str, str], int, Pose, Pose | None] | None:
    """Return the names of both links, the number of the one whose frame is given (0 or 1), this
    frame, and that on the other link if it is given as well; None with a fault."""
    if "site1" in element.attrib:
        sites = [tree.sites.get(attribute(element, f"site{k}")) for k in (1, 2)]
        if sites[0] is None or sites[1] is None:
            log.fault(element, "it names a site that is none")
            return None
        (a, here), (b, there) = sites[0], sites[1]
        return (a, b), 0, here, there
    names = [attribute(element, f"body{k}", WORLD if k == 2 else "") for k in (1, 2)]
    for name in names:
        if name not in tree.links:
            log.fault(element, f"'{name}' is no body")
            return None
    anchor = Pose(np.eye(3), np.array(numbers(element, "anchor", log)))
    if element.tag == "connect":
        return (names[0], names[1]), 0, anchor, None
    return (names[0], names[1]), 1, anchor, _relative_pose(element, log)


def _relative_pose(element: Element, log: Log) -> Pose | None:
    """Return the frame on the first body that the anchor's frame on the second one stays in; None
    for that of the file, which a quaternion of zeros stands for."""
    x, y, z, *quaternion = numbers(element, "relpose", log, (0.0, 1.0, *[0.0] * 5), 7)
    if not any(quaternion):
        return None
    return Pose(rotation_of(np.array(quaternion)), np.array([x, y, z]))
