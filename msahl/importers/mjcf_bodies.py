"""The tree of bodies of MJCF: links with their joints, geoms and sites."""

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.inertia import checked
from msahl.importers.meshes import MeshFiles
from msahl.importers.mjcf_contacts import Geom, read_bits
from msahl.importers.mjcf_geoms import Geoms
from msahl.importers.mjcf_joints import read_joint
from msahl.importers.mjcf_settings import MAIN, Settings, pose, resolved
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import HERE, Axis, Inertia, Link, Pose, together

WORLD = "world"
MOST_DEEP = 200
"""Bodies inside one another."""
INERTIAL_GROUPS = (0.0, 5.0)
"""Groups of geoms that have mass."""


@dataclass
class Tree:
    """What is read of the tree so far: links and joints by name, in the order of coordinates."""

    settings: Settings
    geoms: Geoms
    meshes: MeshFiles
    options: ImportOptions
    log: Log
    links: dict[str, Link] = field(default_factory=dict)
    axes: dict[str, Axis] = field(default_factory=dict)
    sites: dict[str, tuple[str, Pose]] = field(default_factory=dict)
    solids: list[Geom] = field(default_factory=list)


def read_world(world: Element, tree: Tree) -> None:
    """Read a ``<worldbody>`` and all bodies in it."""
    link = tree.links.setdefault(WORLD, Link(WORLD, world))
    waiting = _read_contents(world, link, HERE, MAIN, tree)
    while waiting:
        element, parent, frame, childclass = waiting.pop(0)
        link = _read_body(element, parent, frame, tree)
        childclass = attribute(element, "childclass") or childclass
        waiting = _read_contents(element, link, HERE, childclass, tree) + waiting


Child = tuple[Element, str, Pose, str]
"""A body, the name of the link around it, the frame that it is given in, and its class."""


def _read_body(element: Element, parent: str, frame: Pose, tree: Tree) -> Link:
    name = _unique(element, "body", tree.links, tree.log)
    link = Link(name, element, parent, frame.after(pose(element, tree.settings, tree.log)))
    tree.links[name] = link
    link.compensated = number(element, "gravcomp", tree.log)
    return link


def _unique(element: Element, tag: str, taken: dict[str, Link] | dict[str, Axis], log: Log) -> str:
    """Return the name of an element; one with a number if it has none."""
    name = attribute(element, "name")
    if name in taken:
        log.fault(element, f"the name is taken by another {tag}; choose another")
    number_ = len(taken)
    while not name or (name in taken and not attribute(element, "name")):
        name, number_ = f"{tag} {number_}", number_ + 1
    return name


def _read_contents(
    element: Element, link: Link, frame: Pose, childclass: str, tree: Tree
) -> list[Child]:
    """Read what a body contains, and return the bodies in it."""
    inertias: list[Inertia] = []
    inner: list[Child] = []
    for child, place, class_ in _flat(element, frame, childclass, tree):
        tag = str(child.tag)
        if tag == "body":
            inner.append((child, link.name, place, class_))
        elif tag in ("joint", "freejoint"):
            _read_axis(child, link, place, class_, tree)
        elif tag == "geom":
            inertias += _read_geom(child, link, place, class_, tree)
        elif tag == "site":
            _read_site(child, link, place, class_, tree)
        elif tag != "inertial":
            tree.log.lost(child, "msahl has no such element")
    if link.name != WORLD:
        _set_inertia(element, link, frame, inertias, tree)
    if len(list(element.iterancestors())) > MOST_DEEP:
        tree.log.stop(element, f"more than {MOST_DEEP} bodies inside one another")
    return inner


def _flat(
    element: Element, frame: Pose, childclass: str, tree: Tree
) -> Iterator[tuple[Element, Pose, str]]:
    """Yield the children of a body, and those of every ``<frame>`` in it, each with the frame and
    the class that it is given in."""
    waiting = [(child, frame, childclass) for child in element]
    while waiting:
        child, place, class_ = waiting.pop(0)
        if child.tag != "frame":
            yield child, place, class_
            continue
        class_ = attribute(child, "childclass") or class_
        place = place.after(pose(child, tree.settings, tree.log))
        waiting = [(inside, place, class_) for inside in child] + waiting


def _read_axis(element: Element, link: Link, place: Pose, class_: str, tree: Tree) -> None:
    if link.name == WORLD:
        tree.log.fault(element, "the world has no joints; put it into a body")
        return
    if element.tag == "joint":
        resolved(element, tree.settings, tree.log, class_)
    name = _unique(element, "joint", tree.axes, tree.log)
    axis = read_joint(element, name, place, tree.settings, tree.log)
    if axis.kind == "free" and (link.axes or link.parent != WORLD):
        tree.log.fault(element, "only a body in the world may be free, without other joints")
    elif any(other.kind == "free" for other in link.axes):
        tree.log.fault(element, "a free body has no other joints; delete this one")
    else:
        link.axes.append(axis)
    tree.axes[name] = axis


def _read_geom(element: Element, link: Link, place: Pose, class_: str, tree: Tree) -> list[Inertia]:
    """Read a geom of a link, and return its inertia if it counts."""
    resolved(element, tree.settings, tree.log, class_)
    shown = tree.geoms.read(element)
    for look in shown.looks:
        look.pose = place.after(look.pose)
    link.looks += shown.looks
    bits = read_bits(element, tree.log)
    at = place.after(shown.place)
    tree.solids.append(Geom(element, link.name, shown.kind, at, shown.size, bits))
    least, most = INERTIAL_GROUPS
    words = tree.settings.compiler.get("inertiagrouprange", "").split()
    if len(words) == 2 and all(word.isascii() and word.isdigit() for word in words):
        least, most = float(words[0]), float(words[1])
    counts = least <= number(element, "group", tree.log) <= most
    return [shown.inertia.seen_from(place)] if shown.inertia is not None and counts else []


def _read_site(element: Element, link: Link, place: Pose, class_: str, tree: Tree) -> None:
    """Read a site: those with names become markers."""
    name = attribute(element, "name")
    resolved(element, tree.settings, tree.log, class_)
    frame = place.after(pose(element, tree.settings, tree.log))
    if name:
        link.frames.append((name, frame))
        tree.sites[name] = (link.name, frame)


def _set_inertia(
    element: Element, link: Link, frame: Pose, inertias: list[Inertia], tree: Tree
) -> None:
    """Set the inertia of a link: by its geoms, or by its ``<inertial>``."""
    compiler, log = tree.settings.compiler, tree.log
    inertial = element.find("inertial")
    by_geoms = compiler.get("inertiafromgeom", "auto")
    if by_geoms == "true" or (by_geoms == "auto" and inertial is None):
        if inertial is not None:
            log.changed(inertial, "inertiafromgeom is true: the geoms are taken instead")
        found, place = together(inertias), element
    elif inertial is not None:
        found, place = _inertial(inertial, tree).seen_from(frame), inertial
    else:
        return
    found = _bounded(found, link, compiler, tree)
    link.inertia = checked(found, link, place, tree.options, tree.meshes, log)


def _inertial(element: Element, tree: Tree) -> Inertia:
    """Return what an ``<inertial>`` says."""
    log = tree.log
    place = pose(element, tree.settings, log)
    if "fullinertia" in element.attrib:
        xx, yy, zz, xy, xz, yz = numbers(element, "fullinertia", log, count=6)
        J = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    else:
        J = np.diag(numbers(element, "diaginertia", log))
    return Inertia(number(element, "mass", log), np.zeros(3), J).seen_from(place)


def _bounded(given: Inertia, link: Link, compiler: dict[str, str], tree: Tree) -> Inertia:
    """Return an inertia as the compiler's bounds and its balancing change it."""
    try:
        mass = max(given.mass, float(compiler.get("boundmass", "0")))
        least = float(compiler.get("boundinertia", "0"))
    except ValueError:
        tree.log.fault(link.element, "boundmass or boundinertia of <compiler> is no number")
        return given
    moments, axes = np.linalg.eigh(given.J)
    found = np.maximum(moments, least) if least > 0.0 else moments
    balance = compiler.get("balanceinertia") == "true"
    if balance and 2.0 * found.max() > found.sum():
        found = np.full(3, found.mean())
    if mass == given.mass and (found == moments).all():
        return given
    tree.log.changed(link.element, "the compiler's bounds or balancing change its inertia")
    return Inertia(mass, given.c, axes @ np.diag(found) @ axes.T)
