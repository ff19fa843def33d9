"""Reader of SDF 1.4 to 1.11: models of links and joints, alone or in a world, as Gazebo has it.

Poses are those of ``msahl.importers.sdf_frames``. A model that no joint connects to the world
floats, unless it is static. A link without ``<inertial>`` has the mass 1 kg and the moments of
inertia 1 kg m^2, as the format says.
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.inertia import checked
from msahl.importers.meshes import MeshFiles
from msahl.importers.options import ImportOptions
from msahl.importers.reading import Log, floats, unknown
from msahl.importers.robot import HERE, Inertia, Link, Look, Pose, Robot
from msahl.importers.sdf_files import SdfFiles, included
from msahl.importers.sdf_frames import NEST, Scope, add_frames, canonical, links_of, place, pose_in
from msahl.importers.sdf_joints import (
    Connection,
    arrange,
    inner_pose,
    named_frames,
    read_joints,
    read_relations,
)
from msahl.importers.sdf_values import flag, text_of, value, values
from msahl.importers.urdf import hexadecimal

GRAVITY = (0.0, 0.0, -9.8)
"""Of a world that does not state it."""
MODEL = ("pose", "link", "joint", "frame", "model", "include", "static")
WORLD = ("gravity", "joint", "frame", "model", "include")
LINK = ("pose", "inertial", "visual", "collision", "gravity")
INCLUDE = ("uri", "name", "pose", "static", "placement_frame")
CONTACT = "shapes are not made contacts"
LATEST = (1, 12)


def read_sdf(
    root: Element, path: Path, options: ImportOptions, meshes: MeshFiles, log: Log
) -> Robot:
    """Return the robot of an ``<sdf>``; faults and what is not carried over go to ``log``."""
    try:
        return _Reader(path, options, meshes, log).robot_of(root)
    except RecursionError:
        log.stop(root, "its models or frames refer to one another too deeply; simplify the file")


class _Reader:
    """Scopes with their poses, and links, joints so far."""

    def __init__(self, path: Path, options: ImportOptions, meshes: MeshFiles, log: Log) -> None:
        self.options, self.meshes, self.log = options, meshes, log
        self.files = SdfFiles((path.parent, *options.packages), open=[path.resolve()])
        self.robot = Robot("", {})
        self.poses: dict[str, Pose] = {}
        self.static: set[str] = set()
        self.roots: list[str] = []
        self.joints: list[Connection] = []

    def robot_of(self, root: Element) -> Robot:
        """Return the robot of the first world, or of all models, of a file."""
        version = _version(root, self.log)
        unknown(root, ("world", "model"), self.log)
        worlds = root.findall("world")
        for other in worlds[1:]:
            self.log.lost(other, "a file has one world here: the first")
        holder = worlds[0] if worlds else root
        self.robot.name = attribute(holder, "name")
        if worlds:
            unknown(holder, WORLD, self.log)
            x, y, z = values(holder, "gravity", self.log, GRAVITY)
            self.robot.gravity = (x, y, z)
        top = Scope(holder, "", version)
        alone = len(holder.findall("model")) + len(holder.findall("include")) == 1
        self._add_models(top, alone)
        if alone and not self.robot.name:
            self.robot.name = next(iter(top.models), "")
        add_frames(top, self.log)
        self.log.raise_if_any()
        self._read_scope(top, HERE, None, False)
        if not self.robot.links:
            self.log.stop(root, "it has no <link>; nothing moves")
        self.log.raise_if_any()
        everything = [*self.roots, *self.robot.links]
        arrange(self.robot, self.poses, everything, self.static, self.joints, self.log)
        self.log.raise_if_any()
        return self.robot

    def _add_models(self, scope: Scope, alone: bool = False) -> None:
        """Read the nested and the included models of a scope."""
        for element in scope.element:
            if element.tag == "model":
                self._add_model(scope, element, scope.version, None, alone)
            elif element.tag == "include":
                root = included(element, self.files, self.log)
                if root is not None:
                    self._add_included(scope, element, root, alone)
                    self.files.open.pop()

    def _add_included(self, scope: Scope, element: Element, root: Element, alone: bool) -> None:
        unknown(element, INCLUDE, self.log)
        models = root.findall("model")
        if len(models) != 1:
            self.log.fault(element, f"its file has {len(models)} models; one is expected")
        elif attribute(element, "merge").lower() in ("1", "true"):
            self.log.fault(element, "merge is not available: names would be ambiguous; delete it")
        else:
            self._add_model(scope, models[0], _version(root, self.log), element, alone)

    def _add_model(
        self,
        scope: Scope,
        element: Element,
        version: tuple[int, int],
        include: Element | None,
        alone: bool,
    ) -> None:
        """Read a model into a scope, with what an ``<include>`` says of it."""
        name = text_of(include, "name") or attribute(element, "name")
        if not name or name in scope.models:
            self.log.fault(element if include is None else include, "it has no name of its own; "
                           "give one")  # fmt: skip
            return
        unknown(element, MODEL, self.log)
        placement = text_of(include, "placement_frame") or attribute(element, "placement_frame")
        prefix = "" if alone else f"{scope.prefix}{name}{NEST}"
        pose = None if include is None else include.find("pose")
        is_static = flag(include, "static", flag(element, "static"))
        model = Scope(element, prefix, version, placement, pose, is_static)
        scope.models[name] = model
        self._add_models(model)
        add_frames(model, self.log)

    def _read_scope(self, scope: Scope, outer: Pose, parent: Scope | None, static: bool) -> None:
        """Read links, joints and frames of a scope and those within it."""
        pose = place(scope, outer, parent, self.log)
        static = static or scope.is_static
        for name, element in links_of(scope).items():
            full = f"{scope.prefix}{name}"
            self.poses[full] = pose.after(pose_in(scope, name, element, self.log))
            self.robot.links[full] = self._link(full, element)
            if static:
                self.static.add(full)
        root = f"{scope.prefix}{canonical(scope)}"
        if root in self.robot.links:
            self.roots.append(root)
        for model in scope.models.values():
            self._read_scope(model, pose, scope, static)
        joints = read_joints(scope, pose, self.log)
        if static:
            for joint in joints:
                self.log.lost(joint.element, "its model is static")
            joints = []
        self.joints += joints
        read_relations(scope, joints, pose, self.robot, self.log)
        for name, link, frame in named_frames(scope, pose, self.log):
            inner = self.poses[link].inverse().after(frame)
            self.robot.links[link].frames.append((name, inner))

    def _link(self, name: str, element: Element) -> Link:
        """Return a link with its inertia and shapes: the visual ones, or else those for
        collisions."""
        log = self.log
        unknown(element, LINK, log)
        link = Link(name, element)
        if not flag(element, "gravity", True):
            log.lost(element, "gravity acts on all links here")
        for visual in element.iterfind("visual"):
            link.looks += self._look(visual, log)
        is_seen = bool(link.looks)
        for collision in element.iterfind("collision"):
            log.lost(collision, CONTACT)
            if not is_seen:
                link.looks += self._look(collision, Log(log.file, origins=log.origins))
        inertial = element.find("inertial")
        given = _inertia(inertial, log)
        at = element if inertial is None else inertial
        link.inertia = checked(given, link, at, self.options, self.meshes, log)
        return link

    def _look(self, visual: Element, log: Log) -> list[Look]:
        """Return the shape of a visual or collision; none if msahl has no such one."""
        pose, colour = inner_pose(visual, log), _colour(visual)
        geometry = visual.find("geometry")
        for element in geometry if geometry is not None else ():
            kind = str(element.tag)
            size: Sequence[float] = ()
            if kind == "mesh":
                return self._mesh(element, pose, colour, log)
            if kind == "box":
                size = values(element, "size", log, (1.0, 1.0, 1.0))
            elif kind == "sphere":
                size = (value(element, "radius", log, 1.0),)
            elif kind in ("cylinder", "capsule"):
                size = [value(element, name, log, 1.0) for name in ("radius", "length")]
            if size and min(size) > 0.0:
                return [Look(kind, tuple(size), pose, colour)]
            log.lost(element, "msahl has no such shape, or its sizes are not positive")
        return []

    def _mesh(self, element: Element, pose: Pose, colour: str, log: Log) -> list[Look]:
        """Return the shape of a mesh, whose file is named from the folder of its own file."""
        scale = text_of(element, "scale")
        if scale:
            element.set("scale", scale)
        file = text_of(element, "uri")
        folder = Path(log.file_of(element)).resolve().parent
        base = self.files.folders[0].resolve()
        if "://" not in file and folder != base and folder.is_relative_to(base):
            file = (folder.relative_to(base) / file).as_posix()
        return self.meshes.look(element, file, pose, colour, log)


def _version(root: Element, log: Log) -> tuple[int, int]:
    """Return the version of a file."""
    text = attribute(root, "version")
    parts = text.split(".")
    if len(parts) < 2 or not all(part.isascii() and part.isdigit() for part in parts[:2]):
        log.fault(root, f"its version is '{text[:20]}'; expected one such as 1.7")
        return LATEST
    return int(parts[0][:6]), int(parts[1][:6])


def _inertia(element: Element | None, log: Log) -> Inertia:
    """Return what an ``<inertial>`` says."""
    if element is None:
        return Inertia(1.0, HERE.p, np.eye(3))
    unknown(element, ("mass", "pose", "inertia"), log)
    if attribute(element, "auto").lower() in ("1", "true"):
        log.fault(element, "the inertia of its shapes is not computed; write mass and inertia")
    tensor = element.find("inertia")
    J = np.zeros((3, 3))
    for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)):
        name = f"i{'xyz'[i]}{'xyz'[j]}"
        J[i, j] = J[j, i] = value(tensor, name, log, 1.0 if i == j else 0.0)
    mass = value(element, "mass", log, 1.0)
    return Inertia(mass, HERE.p, J).seen_from(inner_pose(element, log))


def _colour(visual: Element) -> str:
    """Return the colour of a ``<material>`` as #rrggbb, "" for none."""
    for tag in ("diffuse", "ambient"):
        found = floats(text_of(visual.find("material"), tag))
        if found is not None and len(found) in (3, 4):
            return hexadecimal(found)
    return ""
