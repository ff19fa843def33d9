"""Compute the scene of a model: what viewers and exporters draw, as one JSON-able dictionary.

``build_scene(model)`` returns it. SI units throughout; vectors are lists of floats; orientations
are unit quaternions [w, x, y, z], which take components in the rotated axes to components in the
axes that they are given in. Bodies are numbered as in ``states.csv``, from 0; every ground is -1,
and its axes are the inertial ones. A *point* of a body is given from the body's reference point, in
its axes.

    {
      "title": str,
      "bodies": [{
        "name": str,
        "pose": [x, y, z, w, x, y, z],       # of reference point and axes, inertial axes, t = 0
        "centre": [3],                       # mass centre, body axes
        "mass": float,
        "colour": "#rrggbb",                 # of its name, path and shapes without a colour
        "shapes": [Shape],
        "beam": int or null,                 # of a node of a beam: its place in ``beams``
        "hidden": bool,                      # carries amplitudes or mass of an elastic body
      }],
      "beams": [{                            # outlines swept along their nodes
        "name": str,
        "nodes": [int, ...],                 # bodies, in order; axes d_1 along the beam, d_2, d_3
        "colour": "#rrggbb",
        "degree": int,                       # p of elements with p + 1 nodes, p Gauss points
        "lengths": [float, ...],             # of the elements
        "outlines": [[y, z, y, ...], [y, z, y, ...]],  # of both ends, along d_2 and d_3
        "rings": [[float, ...], ...],        # weights of the nodes at equally spaced places of an
                                             # element: of positions and of directions d_2, d_3
        "values": [[float, ...], ...],       # likewise at its Gauss points, and
        "slopes": [[float, ...], ...],       # derivatives by a coordinate from -1 to 1
        "fromPoints": [[float, ...], ...],   # weights of the Gauss points at the places of rings
        "strain": [[6], ...],                # of the unstressed beam, at every Gauss point
        "stiffness": [[36], ...],            # K, row by row; zero for strains that cannot change
      }],
      "elastic": [{                          # reduced elastic bodies whose files have a skin
        "name": str,
        "frame": int,                        # the body in whose axes its points are
        "carriers": [[int, int], ...],       # of each amplitude the body and the axis of the frame
                                             # along which it is the displacement from
        "rest": [float, ...],                # the place of the body without an amplitude [m]
        "points": [x, y, z, x, ...],         # of the undeformed skin
        "shapes": [x, y, z, x, ...],         # by 1 m of each amplitude: of all points
        "triangles": [int, ...],
        "colour": "#rrggbb",
      }],
      "ground": {"names": [str], "shapes": [Shape]},
      "joints": [{                           # joints, then couplings, in the deck's order
        "name": str,
        "kind": str,                         # tag of the element in the deck, such as "revolute"
        "glyph": str,                        # see ``joints.kind_properties``, and for couplings
                                             # COUPLING_GLYPHS in ``glyphs.py``
        "parent": int, "parentPoint": [3],
        "child": int, "childPoint": [3],
        "axis": [3] or null,                 # unit vector, axes of the parent
        "childAxis": [3] or null,            # unit vector, axes of the child
        "parameters": {str: float},          # radius, pitch, length, ratio, ... where they have one
        "joints": [int, int] or null,        # of a coupling: the places of its joints in this list
      }],
      "motions": [{
        "name": str,
        "joint": int or null, "coordinate": "angle" or "slide" or null,
        "body": int or null, "point": [3] or null,
        "direction": [3] or null,            # unit vector, inertial axes
      }],
      "springs": [{
        "name": str,
        "glyph": "coil" or "damper" or "strut" (a coil around a damper)
            or "torsion" or "drum" (a damper of rotation) or "bushing",
        "a": int, "aPoint": [3], "b": int, "bPoint": [3],
        "joint": int or null,                # of springs along a joint's coordinate
        "axis": [3] or null,                 # of these: unit vector, axes of a
      }],
      "loads": [{                            # all other loads
        "name": str,
        "kind": "force" or "drag" or "friction" or "actuator",
        "body": int or null, "point": [3] or null,
        "force": [3] or null, "forceBasis": int,    # N; the body in whose axes it is constant
        "moment": [3] or null, "momentBasis": int,  # N m
        "varies": bool,                      # whether force and moment are multiplied by a law
        "joint": int or null, "coordinate": "angle" or "slide" or null,
        "a": int or null, "aPoint": [3] or null,    # of an actuator between two points
        "b": int or null, "bPoint": [3] or null,
      }],
      "markers": [{"name": str, "body": int, "point": [3], "orientation": [4]}],  # in body axes
      "sensors": [{"name": str, "kind": "distance" or "angle", "markers": [int, ...]}],
      "extent": [[3], [3]],                  # least and greatest coordinates at t = 0
      "size": float,                         # length to which sizes of glyphs are relative
      "gravity": [3],
      "up": [3],                             # unit vector against gravity; z without gravity
      "normal": [3] or null,                 # of a planar mechanism: the direction of all its axes
      "notes": [str],                        # what is wrong with files of meshes, which are omitted
    }

    Shape = {
      "kind": "box" | "cylinder" | "sphere" | "capsule" | "cone" | "rod" | "disc" | "mesh",
      "size": [float, ...],
      "position": [3],                       # of its middle, body axes
      "orientation": [4],                    # its axes, in body axes
      "colour": "#rrggbb" or null,
      "derived": bool,                       # from inertia and joints; false: given in the deck
      "name": str,                           # of a mesh, its file; else ""
      "vertices": [x, y, z, x, ...],         # of a mesh only: metres, axes of the shape
      "faces": [i, j, k, i, ...],            # of a mesh only: triangles, counted from 0
    }

Sizes: box [x, y, z] lengths of edges; sphere [radius]; cylinder, rod, disc [radius, length];
capsule [radius, length between the centres of its half spheres]; cone [radius of the base, height];
mesh the lengths of its box. Axes of revolution are along the shape's z, and its middle is the
origin of the shape's axes; a cone's apex is at z = +height/2. A mesh keeps the origin of its file.
A rod and a disc are cylinders; the two words say what a derived shape stands for.
"""

from pathlib import Path
from typing import Any, Protocol

from msahl.model import Model
from msahl.post.scene.build import build_scene

__all__ = ["build_scene", "scene_of_run"]


class ModelOfRun(Protocol):
    """What is needed of a run: its folder, its model, and what its ``run.json`` says."""

    @property
    def folder(self) -> Path:
        """Folder of the run."""

    @property
    def model(self) -> Model:
        """The model that was run."""

    @property
    def info(self) -> dict[str, Any]:
        """The content of ``run.json``."""


def scene_of_run(run: ModelOfRun) -> dict[str, Any]:
    """Return the scene of the model that was run; files of meshes are those beside its deck."""
    deck = run.info.get("deck", {})
    folders = [run.folder]
    if "relative" in deck:
        folders.append((run.folder / deck["relative"]).parent)
    if "path" in deck:
        folders.append(Path(deck["path"]).parent)
    # Usually both are one folder, which messages call by the name that the user gave it.
    different = {folder.resolve(): folder for folder in folders}
    return build_scene(run.model, run.folder.resolve().name, list(different.values()))
