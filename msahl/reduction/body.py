"""Reduced bodies: what a floating frame needs of an elastic body, and their files.

A file is an ``.npz`` of numpy whose arrays are the fields of ``ReducedBody`` and of its invariants,
in SI units, and ``format``.
"""

import io
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from msahl.reduction.arrays import arrays_of, read_arrays
from msahl.reduction.faults import ReductionError
from msahl.reduction.invariants import Invariants
from msahl.reduction.skin import Skin
from msahl.reduction.stiffening import Stiffening

FORMAT = "msahl elastic body 1"
PARTS = {"invariants": "invariant", "stiffening": "stiffening", "skin": "skin"}
"""Fields of a body that are records, and what the names of their arrays begin with."""


@dataclass(frozen=True, eq=False, slots=True)
class ReducedBody:
    """An elastic body with p interface nodes, n nodes, q modes of unit modal mass. Vectors are in
    the axes of the model's file; the frame's origin is the undeformed mass centre."""

    frame: str  # "mean", or the name of the interface to which the frame is fixed
    centre: np.ndarray  # (3,) [m]: mass centre, in the coordinates of the model's file
    eigenvalues: np.ndarray  # (q,) [rad^2/s^2]
    damping: np.ndarray  # (q, q) [1/s]
    interface_names: np.ndarray  # (p,)
    interface_places: np.ndarray  # (p, 3) [m], from the centre
    interface_shapes: np.ndarray  # (p, 6, q): translations and rotations
    interface_rotates: np.ndarray  # (p,): whether rotations of the node are known
    node_labels: np.ndarray  # (n,)
    node_places: np.ndarray  # (n, 3) [m], from the centre
    node_shapes: np.ndarray  # (n, 3, q): translations
    frequency_errors: np.ndarray  # (q,): relative, infinite above the omitted frequencies
    following_frequency: float  # [Hz]: the lowest omitted one, with the interface held
    effective_mass: np.ndarray  # (6,)
    static_residual: float
    invariants: Invariants
    stiffening: Stiffening | None = None
    skin: Skin | None = None

    @property
    def frequencies(self) -> np.ndarray:
        """Natural frequencies (q,) [Hz] of the free body, or with the frame's node fixed."""
        result: np.ndarray = np.sqrt(self.eigenvalues) / (2.0 * np.pi)
        return result


def body_bytes(body: ReducedBody) -> bytes:
    """Return the contents of the file of a body."""
    arrays = {one.name: getattr(body, one.name) for one in fields(body)}
    for name, prefix in PARTS.items():
        part = arrays.pop(name)
        if part is not None:
            arrays |= {f"{prefix}_{one.name}": getattr(part, one.name) for one in fields(part)}
    stream = io.BytesIO()
    np.savez_compressed(stream, format=np.array(FORMAT), **arrays)
    return stream.getvalue()


def read_body(path: Path) -> ReducedBody:
    """Return the body of a file that ``body_bytes`` made; raises ``ReductionError``."""
    return _of_arrays(path, read_arrays(path))


def read_body_bytes(name: str, data: bytes) -> ReducedBody:
    """Return the body of the contents of such a file, which messages call ``name``."""
    return _of_arrays(Path(name), arrays_of(name, io.BytesIO(data)))


def _of_arrays(path: Path, arrays: dict[str, np.ndarray]) -> ReducedBody:
    if str(arrays.get("format", "")) != FORMAT:
        raise ReductionError(str(path), f"it is no '{FORMAT}'; msahl reduce makes one")
    try:
        taken = {one.name: _taken(arrays, f"invariant_{one.name}") for one in fields(Invariants)}
        own = {
            one.name: _taken(arrays, one.name)
            for one in fields(ReducedBody)
            if one.name not in PARTS
        }
    except KeyError as error:
        raise ReductionError(str(path), f"{error.args[0]} is missing; make it again") from None
    _check_shapes(path, own, taken)
    return ReducedBody(
        **own,
        invariants=Invariants(**taken),
        stiffening=_stiffening(path, arrays, own),
        skin=_skin(path, arrays, np.size(own["eigenvalues"])),
    )


def _stiffening(
    path: Path, arrays: dict[str, np.ndarray], own: dict[str, Any]
) -> Stiffening | None:
    """Return the stiffening of a file, None of one that has none."""
    names = [one.name for one in fields(Stiffening)]
    found = [arrays.get(f"stiffening_{name}") for name in names]
    q, p = np.size(own["eigenvalues"]), np.size(own["interface_names"])
    for name, array, shape in zip(names, found, ((3, 3, q, q), (p, 6, q, q)), strict=True):
        if array is None:
            return None
        if array.shape != shape:
            text = f"stiffening_{name} is {array.shape}, not {shape}; make it again"
            raise ReductionError(str(path), text)
    moment, interface = (arrays[f"stiffening_{name}"] for name in names)
    return Stiffening(moment, interface)


def _skin(path: Path, arrays: dict[str, np.ndarray], q: int) -> Skin | None:
    """Return the skin of a file, None of one that has none."""
    found = [arrays.get(f"skin_{one.name}") for one in fields(Skin)]
    if any(array is None for array in found):
        return None
    places, shapes, triangles = (np.asarray(array) for array in found)
    s = len(places) if places.ndim else 0
    fits = places.shape == (s, 3) and shapes.shape == (s, 3, q) and triangles.shape[1:] == (3,)
    numbers = triangles.dtype.kind in "iu" and not np.any((triangles < 0) | (triangles >= s))
    if not (fits and numbers and np.isfinite(places).all() and np.isfinite(shapes).all()):
        raise ReductionError(str(path), "the arrays of its skin do not fit together; make it again")
    return Skin(places, shapes, triangles)


def _taken(arrays: dict[str, np.ndarray], name: str) -> Any:
    """Return an array of a file; one number or text as such."""
    array = arrays[name]
    return array.item() if array.ndim == 0 else array


def _check_shapes(path: Path, own: dict[str, Any], taken: dict[str, Any]) -> None:
    """Raise ``ReductionError`` unless the arrays fit together."""
    q, p = np.size(own["eigenvalues"]), np.size(own["interface_names"])
    n = np.size(own["node_labels"])
    expected = {
        "centre": (3,), "eigenvalues": (q,), "damping": (q, q), "interface_names": (p,),
        "interface_places": (p, 3), "interface_shapes": (p, 6, q), "interface_rotates": (p,),
        "node_labels": (n,), "node_places": (n, 3), "node_shapes": (n, 3, q),
        "frequency_errors": (q,), "effective_mass": (6,),
        "inertia": (3, 3), "translation": (3, q), "rotation": (3, q), "moment": (3, 3, q),
        "gyration": (3, q, q), "inertia_slope": (3, 3, q), "inertia_curve": (3, 3, q, q),
    }  # fmt: skip
    for name, shape in expected.items():
        found = np.shape({**own, **taken}[name])
        if found != shape:
            raise ReductionError(str(path), f"{name} is {found}, not {shape}; make it again")
