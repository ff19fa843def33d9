"""Properties of a mesh: those of its material, and of the cross-section of beams.

Text of properties: ``E=210e9, nu=0.3, rho=7850``, or the name of a file with such text, a property
or more in each line, ``#`` before comments. Numbers are in the units of the mesh.
"""

import math
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from msahl.beams.sections import SIZES, Geometry, geometry
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.text_files import lines_of, real

MATERIAL = "E=210e9, nu=0.3, rho=7850"
SECTION = "width=0.02, height=0.01, d3=0:0:1"
GENERAL = ("A", "I2", "I3", "J")
FACTORS = ("k2", "k3")
SHAPES = {"iSection": "height", "rectangle": "width", "tube": "thickness", "circle": "radius"}
"""Shapes of sections in the order in which they are tried."""


@dataclass(frozen=True, slots=True)
class Material:
    """Young's modulus ``E``, Poisson's ratio ``nu``, density ``rho``, in the units of the mesh."""

    E: float
    nu: float
    rho: float

    @property
    def shear(self) -> float:
        """Shear modulus."""
        return 0.5 * self.E / (1.0 + self.nu)


@dataclass(frozen=True, slots=True)
class BeamSection:
    """Geometry of a cross-section; ``height`` is the direction of d_3, None if it does not matter.
    Shear factors 0 mean no deformation by shear."""

    geometry: Geometry
    height: tuple[float, float, float] | None


def material_of(text: str) -> Material:
    """Return the material that a text or a file describes; raises ``ReductionError``."""
    place = f"--material {shown(text)}"
    given = _properties(text, place, MATERIAL)
    E, nu, rho = _numbers(given, ("E", "nu", "rho"), place, MATERIAL)
    if not (E > 0.0 and rho > 0.0):
        raise ReductionError(place, f"E={E:g} and rho={rho:g}: both are positive")
    if not -1.0 < nu < 0.5:
        reason = "; a material that keeps its volume has nu=0.49 or less here" if nu >= 0.5 else ""
        raise ReductionError(place, f"nu={nu:g}: it is between -1 and 0.5{reason}")
    return Material(E, nu, rho)


def section_of(text: str, poisson: float) -> BeamSection:
    """Return the cross-section that a text or a file describes; raises ``ReductionError``."""
    place = f"--section {shown(text)}"
    given = _properties(text, place, SECTION)
    height = _direction(given.pop("d3", ""), place)
    found = _general(given, place) if "A" in given else _shape(given, poisson, place)
    if not min(found[:4]) > 0.0 or min(found[4:]) < 0.0:
        raise ReductionError(place, "sizes, areas and moments are positive")
    if height is None and not math.isclose(found.I2, found.I3, rel_tol=1e-6):
        raise ReductionError(
            place, "the section is not the same in all directions; give the direction of its "
            "height, d_3, such as d3=0:0:1",
        )  # fmt: skip
    return BeamSection(found, height)


def _general(given: dict[str, str], place: str) -> Geometry:
    """Return the geometry of an area, moments and shear factors."""
    words = given | {name: given.get(name, "0") for name in FACTORS}
    A, I2, I3, J, k2, k3 = _numbers(words, (*GENERAL, *FACTORS), place, "A=, I2=, I3=, J=")
    return Geometry(A, I2, I3, J, k2, k3)


def _shape(given: dict[str, str], poisson: float, place: str) -> Geometry:
    """Return the geometry of the shape that has these sizes."""
    for kind in SHAPES:
        if set(given) == set(SIZES[kind]):
            sizes = _numbers(given, SIZES[kind], place, SECTION)
            if not min(sizes) > 0.0:
                raise ReductionError(place, "sizes are positive")
            _require_walls(kind, sizes, place)
            return geometry(kind, tuple(sizes), poisson)
    known = "; ".join(", ".join(SIZES[kind]) for kind in SHAPES)
    raise ReductionError(
        place, f"expected the sizes of a section ({known}), or {', '.join(GENERAL)}, k2, k3"
    )


def _require_walls(kind: str, sizes: list[float], place: str) -> None:
    """Raise ``ReductionError`` for walls that do not fit into their section."""
    if kind == "tube" and sizes[1] >= sizes[0]:
        raise ReductionError(place, "the thickness of a tube is less than its radius")
    if kind == "iSection" and (2.0 * sizes[2] >= sizes[1] or sizes[3] >= sizes[0]):
        raise ReductionError(place, "flanges and web are thicker than the section")


def _direction(text: str, place: str) -> tuple[float, float, float] | None:
    if not text:
        return None
    values = [real(word) for word in text.split(":")]
    given = [value for value in values if value is not None]
    if len(given) != len(values) or len(values) != 3 or not any(given):
        raise ReductionError(place, f"d3={shown(text)}: expected a direction such as 0:0:1")
    x, y, z = np.array(given) / np.abs(given).max()
    return float(x), float(y), float(z)


def _properties(text: str, place: str, example: str) -> dict[str, str]:
    """Return the properties of a text, or of the file that it names, by their names."""
    if "=" not in text:
        path = Path(text)
        if not path.exists():
            raise ReductionError(place, f"expected properties such as {example}, or their file")
        text = "\n".join(line.partition("#")[0] for _, line in lines_of(path))
    found: dict[str, str] = {}
    joined = re.sub(r"\s*=\s*", "=", text)
    for word in filter(None, re.split(r"[,;\s]+", joined)):
        name, sign, value = word.partition("=")
        if not sign or name in found:
            raise ReductionError(place, f"'{shown(word)}': expected each property once: {example}")
        found[name] = value
    return found


def _numbers(
    given: dict[str, str], names: tuple[str, ...], place: str, example: str
) -> list[float]:
    """Return the numbers of these properties, which are all that there are."""
    for name in given:
        if name not in names:
            raise ReductionError(place, f"unknown property '{shown(name)}'; expected {example}")
    values = []
    for name in names:
        value = real(given.get(name, ""))
        if value is None:
            what = f"{name}={shown(given[name])} is no number" if name in given else f"no {name}"
            raise ReductionError(place, f"{what}; expected {example}")
        values.append(value)
    return values
