"""Geoms of MJCF: shapes of bodies, and the masses and inertias that follow from them.

    sphere      r           V = 4/3 pi r^3              J = 2/5 m r^2
    ellipsoid   a b c       V = 4/3 pi a b c            J_x = m (b^2 + c^2)/5
    box         a b c       V = 8 a b c                 J_x = m (b^2 + c^2)/3
    cylinder    r h         V = 2 pi r^2 h              J_x = m (3 r^2 + 4 h^2)/12
    capsule     r h         a cylinder and two half spheres, each with its mass centre 3 r/8 from
                            its plane

Sizes are half sizes, cylinders and capsules lie along z. Meshes are solids (``importers.solids``).
With ``shellinertia`` the mass is that of the surface, by a density for each area, and J follows
from its second moments s = int x^2 dA.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.meshes import MeshFiles
from msahl.importers.mjcf_settings import (
    Settings,
    pose,
    resolved,
    rotation_of,
    several,
    smallest_to,
)
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import HERE, Inertia, Look, Pose
from msahl.importers.solids import mesh_solid, pyramids
from msahl.importers.urdf import hexadecimal

SIZES = {"sphere": 1, "capsule": 2, "cylinder": 2, "ellipsoid": 3, "box": 3}
"""Sizes of each kind of geom."""
WATER = 1000.0
"""Default density [kg/m^3]."""
THOMSEN = 1.6075
"""Exponent of Thomsen's formula for the area of an ellipsoid."""
SKIN = 1e-6
"""Thickness [m] of the shell of an ellipsoid, as in MuJoCo."""
NOT_SOLID = {"convex": "its convex hull", "shell": "a shell"}
"""Ways of MuJoCo to weigh a mesh that are not those here."""


class Shown(NamedTuple):
    """A geom: its kind and frame, its shapes for views, its inertia (None: it has no mass) and its
    half sizes, of those kinds that have some."""

    kind: str
    place: Pose = HERE
    looks: Sequence[Look] = ()
    inertia: Inertia | None = None
    size: tuple[float, ...] = ()


class Geoms:
    """Reader of geoms; ``materials`` have colours by name, ``meshes`` assets by name."""

    def __init__(self, root: Element, settings: Settings, files: MeshFiles, log: Log) -> None:
        self.settings, self.files, self.log = settings, files, log
        materials, meshes = (
            [resolved(element, settings, log) for element in root.iterfind(f"asset/{tag}")]
            for tag in ("material", "mesh")
        )
        self.materials = {attribute(e, "name"): _rgba(e, log) for e in materials}
        self.meshes = {_mesh_name(e): e for e in meshes}

    def read(self, element: Element) -> Shown:
        """Return what a geom is, in the frame of its body."""
        kind = attribute(element, "type", "mesh" if "mesh" in element.attrib else "sphere")
        shell = element.get("shellinertia") == "true"
        if kind == "mesh":
            if shell:
                self.log.changed(element, "its mesh is a shell; here it counts as a solid")
            return Shown(kind, HERE, *self._mesh(element))
        if kind not in SIZES:
            self.log.lost(element, f"its shape: msahl has no {kind}")
            return Shown(kind, pose(element, self.settings, self.log))
        found = self._place_and_size(element, kind)
        if found is None:
            return Shown(kind)
        place, size = found
        body = shell_of(kind, size) if shell else _solid(kind, size)
        inertia = _weighed(element, body, self.log)
        look = self._look(element, kind, size, place)
        return Shown(
            kind, place, look, None if inertia is None else inertia.seen_from(place), tuple(size)
        )

    def _place_and_size(self, element: Element, kind: str) -> tuple[Pose, list[float]] | None:
        """Return the frame and the half sizes of a geom; None with a fault."""
        size = several(element, "size", self.log, 3)
        place = pose(element, self.settings, self.log)
        if "fromto" in element.attrib:
            a, b = np.array(numbers(element, "fromto", self.log, count=6)).reshape(2, 3)
            half = 0.5 * float(np.sqrt((b - a) @ (b - a)))
            if half == 0.0 or kind == "sphere":
                self.log.fault(element, f"fromto gives a {kind} no length; correct it")
                return None
            # MuJoCo's z axis points from the second point to the first.
            place = Pose(smallest_to((a - b) / (2.0 * half)), 0.5 * (a + b))
            size = [*size[:1] * (SIZES[kind] - 1), half]
        if len(size) < SIZES[kind] or min(size[: SIZES[kind]], default=0.0) <= 0.0:
            self.log.fault(element, f"a {kind} has {SIZES[kind]} sizes greater than zero")
            return None
        return place, size[: SIZES[kind]]

    def _look(self, element: Element, kind: str, size: list[float], place: Pose) -> list[Look]:
        """Return the shape of a geom for views."""
        if kind == "ellipsoid":
            self.log.lost(element, "msahl has no ellipsoid; its inertia is taken")
            return []
        shown = [2.0 * a for a in size] if kind == "box" else [size[0], *(2 * h for h in size[1:])]
        return [Look(kind, tuple(shown), place, self._colour(element))]

    def _colour(self, element: Element) -> str:
        """Return the colour of a geom; that of its material if it has none of its own."""
        if "rgba" in element.attrib:
            return _rgba(element, self.log)
        return self.materials.get(attribute(element, "material"), "")

    def _mesh(self, element: Element) -> tuple[list[Look], Inertia | None]:
        """Return shape and inertia of a geom that is a mesh."""
        asset = self.meshes.get(attribute(element, "mesh"))
        if asset is None:
            self.log.fault(element, f"there is no mesh '{attribute(element, 'mesh')}' in <asset>")
            return [], None
        place = pose(element, self.settings, self.log)
        own = Log(self.log.file)
        file = self._file(asset)
        looks = self.files.look(asset, file, place.after(_asset_pose(asset)), "", own)
        looks = [Look(k.kind, k.size, k.pose, self._colour(element), k.file) for k in looks]
        for note in own.notes:
            self.log.lost(element, note.message)
        if attribute(element, "mass") == "0" or not looks:
            return looks, None
        mesh = self.files.mesh(looks[0])
        by_compiler = self.settings.compiler.get("exactmeshinertia") == "true"
        way = asset.get("inertia", "exact" if by_compiler else "legacy")
        if way in NOT_SOLID:
            self.log.changed(element, f"its mesh counts by its pyramids, not as {NOT_SOLID[way]}")
        of = mesh_solid if way == "exact" else pyramids
        solid = None if mesh is None else of(mesh)
        if solid is None:
            self.log.lost(element, "its mesh is open or flat: no mass follows from it")
            return looks, None
        inertia = _weighed(element, solid, self.log)
        return looks, None if inertia is None else inertia.seen_from(looks[0].pose)

    def _file(self, asset: Element) -> str:
        """Return the path of a mesh's file by the folders that the compiler names."""
        file, compiler = attribute(asset, "file"), self.settings.compiler
        if compiler.get("strippath") == "true":
            file = file.replace("\\", "/").rpartition("/")[2]
        folder = compiler.get("meshdir", compiler.get("assetdir", ""))
        return f"{folder.rstrip('/')}/{file}" if folder else file


def _mesh_name(asset: Element) -> str:
    """Return the name of a mesh, by default that of its file."""
    name = attribute(asset, "file").rpartition("/")[2].rpartition(".")[0]
    return attribute(asset, "name") or name


def _asset_pose(asset: Element) -> Pose:
    """Return the frame of a file in that of its mesh."""
    log = Log("")
    R = rotation_of(np.array(numbers(asset, "refquat", log, (1.0, 0.0, 0.0, 0.0), 4)))
    return Pose(R, np.array(numbers(asset, "refpos", log))).inverse()


def _rgba(element: Element, log: Log) -> str:
    if "rgba" not in element.attrib:
        return ""
    return hexadecimal(numbers(element, "rgba", log, (0.5, 0.5, 0.5, 1.0), 4))


def _weighed(element: Element, solid: Inertia, log: Log) -> Inertia | None:
    """Return a solid of density 1 with the mass of its geom; None if that is zero."""
    mass = number(element, "mass", log, solid.mass * number(element, "density", log, WATER))
    if mass < 0.0:
        log.fault(element, f"its mass is {mass:g} kg; it must not be negative")
    if not mass > 0.0 or not solid.mass > 0.0:
        return None
    return Inertia(mass, solid.c, solid.J * (mass / solid.mass))


def _solid(kind: str, size: list[float]) -> Inertia:
    """Return the inertia of a geom of the density 1, in its own axes."""
    if kind == "capsule":
        return _capsule(*size)
    a, b, c = {1: size * 3, 2: [size[0], *size], 3: size}[len(size)]
    if kind == "cylinder":
        V = 2.0 * math.pi * a * a * c
        second = V * np.array([a * a / 4.0, a * a / 4.0, c * c / 3.0])
    else:
        V = (8.0 if kind == "box" else 4.0 / 3.0 * math.pi) * a * b * c
        second = V * np.array([a * a, b * b, c * c]) / (3.0 if kind == "box" else 5.0)
    return Inertia(V, np.zeros(3), np.diag(second.sum() - second))


def _capsule(r: float, h: float) -> Inertia:
    """Return a capsule: its second moments along x and z are those of the cylinder and of a ball
    whose halves are h away from the middle."""
    V_c, V_s = 2.0 * math.pi * r * r * h, 4.0 / 3.0 * math.pi * r**3
    x = V_c * r * r / 4.0 + V_s * r * r / 5.0
    z = V_c * h * h / 3.0 + V_s * (r * r / 5.0 + 0.75 * r * h + h * h)
    second = np.array([x, x, z])
    return Inertia(V_c + V_s, np.zeros(3), np.diag(second.sum() - second))


def shell_of(kind: str, size: list[float]) -> Inertia:
    """Return the inertia of the surface of a geom, of the density 1 for each area."""
    if kind == "ellipsoid":
        return _ellipsoid_shell(np.array(size))
    if kind == "box":
        a, b, c = size
        faces = 8.0 * np.array([b * c, c * a, a * b])  # both across each axis
        own = np.array(size) ** 2
        area = float(faces.sum())
        second = own * (faces + (area - faces) / 3.0)
    elif kind == "cylinder":
        r, h = size
        side, ends = 4.0 * math.pi * r * h, 2.0 * math.pi * r * r
        area = side + ends
        x = side * r * r / 2.0 + ends * r * r / 4.0
        second = np.array([x, x, side * h * h / 3.0 + ends * h * h])
    else:
        r, h = size[0], size[1] if kind == "capsule" else 0.0
        side, ends = 4.0 * math.pi * r * h, 4.0 * math.pi * r * r
        area = side + ends
        x = side * r * r / 2.0 + ends * r * r / 3.0
        second = np.array([x, x, side * h * h / 3.0 + ends * (r * r / 3.0 + r * h + h * h)])
    return Inertia(area, np.zeros(3), np.diag(second.sum() - second))


def _ellipsoid_shell(half: np.ndarray) -> Inertia:
    """Return the shell of an ellipsoid as MuJoCo has it: its area by Thomsen's formula, which is
    good to 1 %, and the inertia of the space between it and one that is larger by ``SKIN``."""
    a, b, c = half**THOMSEN
    area = 4.0 * math.pi * ((a * b + b * c + c * a) / 3.0) ** (1.0 / THOMSEN)
    outer, inner = (_solid("ellipsoid", (half + more).tolist()) for more in (SKIN, 0.0))
    J = (outer.J - inner.J) / (outer.mass - inner.mass)
    return Inertia(area, np.zeros(3), area * J)
