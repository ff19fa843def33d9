"""Describe a scene and its motion as a glTF document: nodes, meshes, materials, one animation."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from msahl.post.glb.animation import Keys
from msahl.post.glb.container import INDICES, JOINTS, VERTICES, Numbers, glb
from msahl.post.glb.springs import Stretched, choose_spring_keys, ends, motion, surfaces
from msahl.post.scene.beams import rings_at_nodes
from msahl.post.scene.elastic import amplitudes
from msahl.post.scene.geometry import Shape, floats, smallest_rotation
from msahl.post.scene.triangles import Triangles, triangles
from msahl.version import VERSION

Node = dict[str, Any]
GREY = "#9aa3ad"
"""Colour of the ground's shapes that have none."""
SPRING = "#6c7683"
"""Colour of springs and dampers, as in the viewer."""
UP = (0.0, 1.0, 0.0)
"""Direction that glTF has upwards."""
METALLIC, ROUGHNESS = 0.1, 0.6


def write_glb(
    scene: Mapping[str, Any], time: np.ndarray, poses: np.ndarray, keys: Sequence[Keys]
) -> bytes:
    """Return a GLB file of a scene and the ``poses`` (rows, bodies, 7) of its bodies at ``time``
    (rows,) [s]: positions [m] and unit quaternions, scalar first. ``keys`` are those of each body.
    """
    file = _File(scene)
    nodes = []
    for index, (body, key) in enumerate(zip(scene["bodies"], keys, strict=True)):
        node = file.add_body(body["name"], body["shapes"], body["colour"], poses[0, index])
        nodes.append(node)
        if len(key.rows) > 1:
            file.animate(node, time[key.rows], poses[key.rows, index])
    for beam in scene["beams"]:
        file.add_beam(beam, nodes)
    for elastic in scene["elastic"]:
        _add_elastic(file, elastic, nodes, time, poses, keys)
    for spring in scene["springs"]:
        stretched = motion(ends(spring, poses), scene["size"])
        rows = choose_spring_keys(time, stretched, scene["size"])
        for node in file.add_spring(spring, scene["size"], stretched):
            if len(rows) > 1:
                scales = np.column_stack([np.ones((len(rows), 2)), stretched.lengths[rows]])
                file.animate(node, time[rows], stretched.poses[rows], scales)
    ground = scene["ground"]
    if ground["shapes"]:
        file.add_body(", ".join(ground["names"]) or "ground", ground["shapes"], GREY, None)
    return file.finish(scene["title"])


def _add_elastic(
    file: "_File",
    elastic: Mapping[str, Any],
    nodes: Sequence[int],
    time: np.ndarray,
    poses: np.ndarray,
    keys: Sequence[Keys],
) -> None:
    """Add the skin of an elastic body, at the key poses of all that carry its amplitudes."""
    values = amplitudes(elastic, poses)
    node = file.add_elastic(elastic, nodes[elastic["frame"]], values[0])
    bodies = {elastic["frame"], *(body for body, _ in elastic["carriers"])}
    rows = np.unique(np.concatenate([keys[body].rows for body in bodies]))
    if len(rows) > 1:
        file.sample(node, "weights", time[rows], values[rows].ravel())


class _File:
    """A document as it is built. Node 0 is the root, whose children are bodies and ground."""

    def __init__(self, scene: Mapping[str, Any]) -> None:
        self.nodes: list[Node] = [{"name": scene["title"] or "model", "children": []}]
        self.nodes[0]["rotation"] = _xyzw(smallest_rotation(scene["up"], UP))
        self.numbers = Numbers()
        self.meshes: dict[tuple[Any, ...], int] = {}
        self.mesh_list: list[dict[str, Any]] = []
        self.materials: dict[str, int] = {}
        self.material_list: list[dict[str, Any]] = []
        self.skins: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.samplers: list[dict[str, Any]] = []

    def add_body(
        self, name: str, shapes: Sequence[Shape], colour: str, pose: np.ndarray | None
    ) -> int:
        """Add a node for a body, with a child for each shape; return its index."""
        node: Node = {"name": name}
        if pose is not None:
            node |= {"translation": pose[:3].tolist(), "rotation": _xyzw(pose[3:])}
        place = len(self.nodes)
        self.nodes.append(node)
        self.nodes[0]["children"].append(place)
        for shape in shapes:
            child: Node = {"name": shape["name"] or shape["kind"]}
            child["mesh"] = self._mesh(shape, shape["colour"] or colour)
            child |= {"translation": shape["position"], "rotation": _xyzw(shape["orientation"])}
            self.nodes.append(child)
            node.setdefault("children", []).append(len(self.nodes) - 1)
        return place

    def add_spring(self, spring: Mapping[str, Any], size: float, first: Stretched) -> list[int]:
        """Add nodes for the surfaces of a spring that begins as ``first``; return their indices."""
        places = []
        length = float(first.lengths[0])
        for k, surface in enumerate(surfaces(spring["glyph"], size, length)):
            key = (spring["glyph"], k, length)
            if key not in self.meshes:
                self.meshes[key] = self._surface(spring["glyph"], surface, SPRING)
            pose = {
                "translation": first.poses[0, :3].tolist(),
                "rotation": _xyzw(first.poses[0, 3:]),
            }
            places.append(len(self.nodes))
            drawn = {"mesh": self.meshes[key], "scale": [1.0, 1.0, length]}
            self.nodes.append({"name": spring["name"], **pose, **drawn})
            self.nodes[0]["children"].append(places[-1])
        return places

    def add_beam(self, beam: Mapping[str, Any], nodes: Sequence[int]) -> None:
        """Add the surface of a beam as a skin: each outline moves with one of the ``nodes`` of the
        document, which are those of all bodies."""
        rings, faces = rings_at_nodes(dict(beam))
        count, corners = rings.shape[:2]
        carriers = np.zeros((count * corners, 4))
        weights = np.zeros((count * corners, 4))
        carriers[:, 0], weights[:, 0] = np.repeat(np.arange(count), corners), 1.0
        attributes = {
            # Outlines are given in the axes of their nodes.
            "POSITION": self.numbers.add(rings.reshape(-1, 3), VERTICES, bounds=True),
            "JOINTS_0": self.numbers.add(carriers, JOINTS),
            "WEIGHTS_0": self.numbers.add(weights, VERTICES),
        }
        primitive = {
            "attributes": attributes,
            "indices": self.numbers.add(faces.ravel(), INDICES),
            "material": self._material(beam["colour"]),
        }
        self.mesh_list.append({"name": beam["name"], "primitives": [primitive]})
        self.skins.append({"joints": [nodes[body] for body in beam["nodes"]]})
        place = len(self.nodes)
        drawn = {"mesh": len(self.mesh_list) - 1, "skin": len(self.skins) - 1}
        self.nodes.append({"name": beam["name"], **drawn})
        self.nodes[0]["children"].append(place)

    def add_elastic(self, entry: Mapping[str, Any], frame: int, weights: np.ndarray) -> int:
        """Add the skin of an elastic body to the node of its ``frame``, with a morph target by
        amplitude, whose first are ``weights`` (q,); return its index."""
        shapes = np.reshape(entry["shapes"], (len(weights), -1, 3))
        points = np.reshape(entry["points"], (-1, 3))
        primitive = {
            "attributes": {"POSITION": self.numbers.add(points, VERTICES, bounds=True)},
            "indices": self.numbers.add(np.array(entry["triangles"]), INDICES),
            "material": self._material(entry["colour"]),
            "targets": [
                {"POSITION": self.numbers.add(shape, VERTICES, bounds=True)} for shape in shapes
            ],
        }
        mesh = {"name": entry["name"], "primitives": [primitive], "weights": weights.tolist()}
        self.mesh_list.append(mesh)
        place = len(self.nodes)
        self.nodes.append({"name": f"{entry['name']}, skin", "mesh": len(self.mesh_list) - 1})
        self.nodes[frame].setdefault("children", []).append(place)
        return place

    def _mesh(self, shape: Shape, colour: str) -> int:
        """Return the index of the mesh of a shape; equal ones are stored once."""
        numbers = (shape["size"], shape.get("vertices", ()), shape.get("faces", ()))
        key = (shape["kind"], colour, *map(tuple, numbers))
        if key not in self.meshes:
            self.meshes[key] = self._surface(key_name(shape), triangles(shape), colour)
        return self.meshes[key]

    def _surface(self, name: str, surface: Triangles, colour: str) -> int:
        """Store a surface; return the index of its mesh."""
        vertices, normals, faces = surface
        attributes = {"POSITION": self.numbers.add(vertices, VERTICES, bounds=True)}
        if normals is not None:
            attributes["NORMAL"] = self.numbers.add(normals, VERTICES)
        primitive = {
            "attributes": attributes,
            "indices": self.numbers.add(faces.ravel(), INDICES),
            "material": self._material(colour),
        }
        self.mesh_list.append({"name": name, "primitives": [primitive]})
        return len(self.mesh_list) - 1

    def _material(self, colour: str) -> int:
        if colour not in self.materials:
            self.materials[colour] = len(self.material_list)
            surface = {
                "baseColorFactor": [*linear(colour), 1.0],
                "metallicFactor": METALLIC,
                "roughnessFactor": ROUGHNESS,
            }
            # Triangles of files may have their outside on either side.
            self.material_list.append(
                {"name": colour, "pbrMetallicRoughness": surface, "doubleSided": True}
            )
        return self.materials[colour]

    def animate(
        self, node: int, time: np.ndarray, poses: np.ndarray, scales: np.ndarray | None = None
    ) -> None:
        """Add samplers of translation and rotation of a node, and of its ``scales`` (rows, 3)."""
        times = self.numbers.add(time, bounds=True)
        # glTF has the scalar last.
        paths = {"translation": poses[:, :3], "rotation": poses[:, [4, 5, 6, 3]]}
        for path, values in (paths if scales is None else {**paths, "scale": scales}).items():
            self._sample(node, path, times, values)

    def sample(self, node: int, path: str, time: np.ndarray, values: np.ndarray) -> None:
        """Add a sampler of the ``values`` of one path of a node."""
        self._sample(node, path, self.numbers.add(time, bounds=True), values)

    def _sample(self, node: int, path: str, times: int, values: np.ndarray) -> None:
        output = self.numbers.add(values)
        self.channels.append(
            {"sampler": len(self.samplers), "target": {"node": node, "path": path}}
        )
        self.samplers.append({"input": times, "output": output, "interpolation": "LINEAR"})

    def finish(self, title: str) -> bytes:
        """Return the bytes of the file."""
        document: dict[str, Any] = {
            "asset": {"version": "2.0", "generator": f"msahl {VERSION}"},
            "scene": 0,
            "scenes": [{"name": title or "model", "nodes": [0]}],
            "nodes": self.nodes,
            "meshes": self.mesh_list,
            "materials": self.material_list,
        }
        if self.skins:
            document["skins"] = self.skins
        if self.channels:
            animation = {"name": title or "motion", "channels": self.channels}
            document["animations"] = [animation | {"samplers": self.samplers}]
        return glb(document, self.numbers)


def key_name(shape: Shape) -> str:
    """Return the name of a shape's mesh: its file, or its kind and sizes [m]."""
    sizes = " x ".join(f"{size:.4g}" for size in shape["size"])
    return shape["name"] or f"{shape['kind']} {sizes}"


def linear(colour: str) -> list[float]:
    """Return red, green, blue in linear light, from 0 to 1, of a colour #rrggbb (sRGB)."""
    parts = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    return [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]


def _xyzw(q: Sequence[float] | np.ndarray) -> list[float]:
    """Return a quaternion [w, x, y, z] with its scalar last, as glTF has it."""
    w, x, y, z = floats(q)
    return [x, y, z, w]
