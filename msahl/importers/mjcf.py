"""Reader of MJCF: a ``<mujoco>`` model with default classes, included files, a tree of bodies.

MuJoCo's equalities are soft; here they are exact.
"""

from pathlib import Path

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.build import world_pose
from msahl.importers.meshes import MeshFiles
from msahl.importers.mjcf_actuators import read_actuators
from msahl.importers.mjcf_bodies import WORLD, Tree, read_world
from msahl.importers.mjcf_contacts import read_contacts
from msahl.importers.mjcf_files import merge_includes
from msahl.importers.mjcf_geoms import Geoms
from msahl.importers.mjcf_joints import COORDINATES, set_coordinates
from msahl.importers.mjcf_settings import read_settings, resolved, several
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import HERE, Closure, Inertia, Pose, Relation, Robot

READ = (
    "compiler", "option", "default", "asset", "worldbody", "contact", "equality", "actuator",
    "keyframe",
)  # fmt: skip
OF_MUJOCO = ("size", "visual", "statistic")
"""Sections about MuJoCo itself and its views."""
ASSETS = ("mesh", "material", "texture")
COMPILER = (
    "angle", "autolimits", "eulerseq", "coordinate", "meshdir", "assetdir", "texturedir",
    "strippath", "inertiafromgeom", "inertiagrouprange", "balanceinertia", "boundmass",
    "boundinertia", "settotalmass", "fusestatic", "discardvisual", "usethread", "convexhull",
    "fitaabb", "alignfree", "saveinertial", "exactmeshinertia",
)  # fmt: skip
EXACT = "MuJoCo's equality is soft; here it is exact"
FLAGS = ("equality", "frictionloss", "passive", "spring", "damper", "actuation", "clampctrl")
"""What MuJoCo can switch off and msahl takes as the elements say."""
FORCES = ("wind", "density", "viscosity")
"""Options of forces of a fluid."""


def read_mjcf(
    root: Element, path: Path, options: ImportOptions, meshes: MeshFiles, log: Log
) -> Robot:
    """Return the robot of a ``<mujoco>``; faults and what is not carried over go to ``log``."""
    merge_includes(root, path, options.packages, log)
    log.raise_if_any()
    settings = read_settings(root, log)
    _note_sections(root, log)
    tree = Tree(settings, Geoms(root, settings, meshes, log), meshes, options, log)
    for world in root.iterfind("worldbody"):
        read_world(world, tree)
    log.raise_if_any()
    if not tree.links:
        log.stop(root, "it has no <worldbody>; nothing moves")
    _set_total_mass(root, tree, log)
    name = attribute(root, "model", "MuJoCo Model")
    robot = Robot(name, tree.links, _gravity(root, log))
    _read_equalities(root, tree, robot, log)
    _disable_limits(root, tree)
    robot.touches = read_contacts(root, tree.solids, tree.links, settings, log)
    robot.drives = read_actuators(root, settings, tree.axes, log)
    _set_keyframe(root, robot, tree, options, log)
    log.raise_if_any()
    return robot


def _note_sections(root: Element, log: Log) -> None:
    """Note what msahl has nothing for: sections, their elements, options."""
    for section in root:
        tag = str(section.tag)
        if tag in OF_MUJOCO:
            log.lost(section, "settings of MuJoCo itself")
        elif tag not in READ:
            for element in section if len(section) else [section]:
                log.lost(element, "msahl has no such element")
    for element in root.iterfind("asset/*"):
        if element.tag not in ASSETS:
            log.lost(element, "msahl has no such element")
    for compiler in root.iterfind("compiler"):
        for name in map(str, compiler.attrib):
            if name not in COMPILER:
                log.lost(compiler, f"its {name}")
    for element in root.iterfind("contact/*"):
        if element.tag not in ("pair", "exclude"):
            log.lost(element, "msahl has no such element")
    for flag in root.iterfind("option/flag"):
        for name in FLAGS:
            if flag.get(name) == "disable":
                log.lost(flag, f"it disables {name}, which acts here")
    for option in root.iterfind("option"):
        forces = [n for n in FORCES if any(several(option, n, log, 3))]
        if forces:
            log.lost(option, f"forces of a fluid: {', '.join(forces)}")


def _gravity(root: Element, log: Log) -> tuple[float, float, float]:
    x, y, z = 0.0, 0.0, -9.81
    for option in root.iterfind("option"):
        x, y, z = numbers(option, "gravity", log, (x, y, z))
    for flag in root.iterfind("option/flag"):
        if flag.get("gravity") == "disable":
            x, y, z = 0.0, 0.0, 0.0
    return (x, y, z)


def _disable_limits(root: Element, tree: Tree) -> None:
    """Remove all limits of joints if the options of the file do."""
    flags = list(root.iterfind("option/flag"))
    if any(flag.get(name) == "disable" for flag in flags for name in ("limit", "constraint")):
        for axis in tree.axes.values():
            axis.limit = axis.lower = axis.upper = None


def _set_total_mass(root: Element, tree: Tree, log: Log) -> None:
    """Scale all masses if the compiler gives their sum."""
    for compiler in root.iterfind("compiler"):
        wanted = number(compiler, "settotalmass", log, -1.0)
        total = sum(link.inertia.mass for link in tree.links.values())
        for link in tree.links.values() if wanted > 0.0 and total > 0.0 else ():
            factor = wanted / total
            mass, c, J = link.inertia
            link.inertia = Inertia(mass * factor, c, J * factor)


def _read_equalities(root: Element, tree: Tree, robot: Robot, log: Log) -> None:
    for element in root.iterfind("equality/*"):
        resolved(element, tree.settings, log)
        if element.get("active") == "false":
            log.lost(element, "it is not active")
        elif element.tag == "joint":
            _read_relation(element, tree, robot, log)
        elif element.tag in ("connect", "weld"):
            _read_closure(element, tree, robot, log)
        else:
            log.lost(element, "msahl has no such element")


def _read_relation(element: Element, tree: Tree, robot: Robot, log: Log) -> None:
    """Read a linear equality of two joints: y - y0 = a0 + a1 (x - x0)."""
    y = tree.axes.get(attribute(element, "joint1"))
    x = tree.axes.get(attribute(element, "joint2"))
    a = [*several(element, "polycoef", log, 5), 0.0, 0.0, 0.0, 0.0, 0.0][:5]
    if "polycoef" not in element.attrib:
        a[1] = 1.0
    if y is None or ("joint2" in element.attrib and x is None):
        log.fault(element, "it names a joint that is none")
    elif x is None or any(a[2:]) or {x.kind, y.kind} - {"hinge", "slide"}:
        log.lost(element, "msahl couples two coordinates in proportion only")
    else:
        offset = y.zero + a[0] - a[1] * x.zero
        robot.relations.append(Relation(x.name, y.name, a[1], offset, element))
        log.changed(element, EXACT)


def _read_closure(element: Element, tree: Tree, robot: Robot, log: Log) -> None:
    """Read a ``<connect>`` or ``<weld>``: it is satisfied at the pose of the file."""
    found = _sides(element, tree, log)
    if found is None:
        return
    links, point, given = found
    zero = [HERE if n == WORLD else world_pose(robot.links[n], robot, False) for n in links]
    if given is not None:
        poses = point, given
    else:
        there = zero[0].after(point)
        poses = point, zero[1].inverse().after(there)
    kind = {"connect": "spherical", "weld": "rigid"}[str(element.tag)]
    if kind == "rigid" and any(several(element, "relpose", log, 7)):
        log.lost(element, "a weld with a relpose of its own")
        return
    name = attribute(element, "name") or f"{links[1]} to {links[0]}"
    robot.closures.append(Closure(name, kind, (links[0], links[1]), poses, element))
    log.changed(element, EXACT)


def _sides(
    element: Element, tree: Tree, log: Log
) -> tuple[tuple[str, str], Pose, Pose | None] | None:
    """Return the names of both links, the frame of the joint on the first, and on the second if it
    is given as well; None with a fault."""
    if "site1" in element.attrib:
        sites = [tree.sites.get(attribute(element, f"site{k}")) for k in (1, 2)]
        if sites[0] is None or sites[1] is None:
            log.fault(element, "it names a site that is none")
            return None
        (a, here), (b, there) = sites[0], sites[1]
        return (a, b), here, there
    names = [attribute(element, f"body{k}", WORLD if k == 2 else "") for k in (1, 2)]
    for name in names:
        if name not in tree.links:
            log.fault(element, f"'{name}' is no body")
            return None
    anchor = np.array(numbers(element, "anchor", log))
    if element.tag == "weld":
        anchor = np.zeros(3)
    return (names[0], names[1]), Pose(np.eye(3), anchor), None


def _set_keyframe(
    root: Element, robot: Robot, tree: Tree, options: ImportOptions, log: Log
) -> None:
    """Set the coordinates at t = 0 by the keyframe that the user names."""
    keys = list(root.iterfind("keyframe/key"))
    names = [attribute(key, "name") or str(number_) for number_, key in enumerate(keys)]
    chosen = [key for key, name in zip(keys, names, strict=True) if name == options.key]
    if options.key and not chosen:
        log.fault(
            root, f"there is no keyframe '{options.key}'; those there are: {', '.join(names)}"
        )
    for key, name in zip(keys, names, strict=True):
        if key not in chosen:
            log.lost(key, f"--key {name} starts there" if name else "it has no name")
    for key in chosen[:1]:
        _apply(key, tree, robot, log)


def _apply(key: Element, tree: Tree, robot: Robot, log: Log) -> None:
    """Set coordinates, rates and controls of a keyframe."""
    axes = tree.axes.values()
    counts = [COORDINATES[axis.kind] for axis in axes]
    sizes = [sum(count[level] for count in counts) for level in (0, 1)]
    q, v = several(key, "qpos", log, 10**6), several(key, "qvel", log, 10**6)
    for name, given, size in (("qpos", q, sizes[0]), ("qvel", v, sizes[1])):
        if given and len(given) != size:
            log.fault(key, f"{name} has {len(given)} numbers; the joints have {size}")
            return
    v = v or [0.0] * sizes[1]
    for axis, (m, n) in zip(axes, counts, strict=True):
        if q:
            set_coordinates(axis, q[:m], v[:n])
        elif n == 1:
            axis.rate = v[0]
        q, v = q[m:], v[n:]
    for drive, value in zip(robot.drives, several(key, "ctrl", log, 10**6), strict=False):
        drive.control = value
