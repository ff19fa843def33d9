"""Reader of MJCF: a ``<mujoco>`` model with default classes, included files, a tree of bodies.

MuJoCo's equalities are soft; here they are exact.
"""

from collections.abc import Sequence
from pathlib import Path

from msahl.deck.faults import Element, attribute
from msahl.importers.meshes import MeshFiles
from msahl.importers.mjcf_actuators import Targets, has_activation, read_actuators
from msahl.importers.mjcf_bodies import Tree, read_world
from msahl.importers.mjcf_contacts import read_contacts
from msahl.importers.mjcf_equalities import read_equalities
from msahl.importers.mjcf_files import merge_includes
from msahl.importers.mjcf_geoms import Geoms
from msahl.importers.mjcf_inertia import ReferenceInertia, set_spring_dampers
from msahl.importers.mjcf_joints import COORDINATES, note_forces, set_coordinates
from msahl.importers.mjcf_replicate import expand_replicates
from msahl.importers.mjcf_settings import note_unread, read_settings, several
from msahl.importers.mjcf_tendons import Tendons, read_tendons
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import Drive, Inertia, Robot, Thrust

READ = (
    "compiler", "option", "default", "asset", "worldbody", "contact", "equality", "tendon",
    "actuator", "keyframe",
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
    expand_replicates(root, settings, log)
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
    tendons = read_tendons(root, settings, tree.axes, options, log)
    read_equalities(root, tree, tendons.terms, robot, log)
    robot.touches = read_contacts(root, tree.solids, tree.links, settings, log)
    controls = _add_forces(root, robot, tree, tendons, log)
    _disable_limits(root, tree)
    _set_keyframe(root, controls, tree, options, log)
    log.raise_if_any()
    return robot


def _add_forces(
    root: Element, robot: Robot, tree: Tree, tendons: Tendons, log: Log
) -> list[Drive | Thrust | None]:
    """Add the forces of joints, tendons and actuators, and return the latter in the order of their
    controls."""
    inertia = ReferenceInertia(robot)
    set_spring_dampers(tree.axes, inertia, log)
    for axis in tree.axes.values():
        note_forces(axis, log)
    targets = Targets(tree.settings, tree.axes, tendons.terms, tendons.unread, tree.sites, inertia)
    controls = read_actuators(root, targets, log)
    robot.drives = [*tendons.drives, *(c for c in controls if isinstance(c, Drive))]
    robot.thrusts = [c for c in controls if isinstance(c, Thrust)]
    return controls


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
        note_unread(compiler, COMPILER, log)
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


def _set_keyframe(
    root: Element,
    controls: Sequence[Drive | Thrust | None],
    tree: Tree,
    options: ImportOptions,
    log: Log,
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
        _apply(key, tree, log)
        _set_controls(key, root, controls, log)


def _apply(key: Element, tree: Tree, log: Log) -> None:
    """Set coordinates and rates of a keyframe."""
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


def _set_controls(
    key: Element, root: Element, controls: Sequence[Drive | Thrust | None], log: Log
) -> None:
    """Set the controls and the states of actuators, which count as well if they are not carried
    over."""
    pairs = list(zip(root.iterfind("actuator/*"), controls, strict=True))
    states = [actuator for element, actuator in pairs if has_activation(element)]
    for name, field, actuators in (("ctrl", "value", controls), ("act", "activation", states)):
        values = several(key, name, log, 10**6)
        for actuator, value in zip(actuators, values, strict=False):
            if actuator is not None and actuator.control is not None:
                setattr(actuator.control, field, value)
