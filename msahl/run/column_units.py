"""Quantity and unit of a column of a run's tables, by its name.

A column is NAME.SUFFIX; the suffix determines the quantity (docs/results.md lists all of them). A
signal or auxiliary state is a NAME alone, whose unit the deck may state. A load has one unit or
another, by its coordinate.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from msahl.joints.coordinates import SUFFIXES, is_angle
from msahl.model import Model
from msahl.model.couplings import COORDINATES
from msahl.model.signals import SignalTable
from msahl.run.tables import ERROR_OF
from msahl.system.names import AMPLITUDE

TIME = "time"


@dataclass(frozen=True, slots=True, order=True)
class Quantity:
    """What a column is: a ``word`` for a label, its SI ``unit`` ("" where none is known)."""

    word: str
    unit: str

    def __str__(self) -> str:
        return f"{self.word} [{self.unit}]" if self.unit else self.word


POSITION, ORIENTATION = Quantity("position", "m"), Quantity("orientation parameter", "-")
VELOCITY, SPIN = Quantity("velocity", "m/s"), Quantity("angular velocity", "rad/s")
FORCE, MOMENT = Quantity("force", "N"), Quantity("moment", "N m")
ENERGY, POWER = Quantity("energy", "J"), Quantity("power", "W")
SIGNAL = Quantity("signal", "SI")
UNKNOWN = Quantity("value", "")


def _axes(letters: str, quantity: Quantity) -> dict[str, Quantity]:
    return {f"{letters}{axis}": quantity for axis in "xyz"}


def _coordinate(name: str, word: str, unit: str) -> dict[str, Quantity]:
    """Return a coordinate, its rate and its acceleration."""
    words = (word, f"rate of {word}", f"acceleration of {word}")
    units = (unit, f"{unit}/s", f"{unit}/s^2")
    triples = zip(SUFFIXES, words, units, strict=True)
    return {name + end: Quantity(each, per) for end, each, per in triples}


def _coordinates(names: Sequence[str], word: str, unit: str) -> dict[str, Quantity]:
    return {key: triple for name in names for key, triple in _coordinate(name, word, unit).items()}


QUANTITIES = {
    **_axes("", POSITION),
    **{f"P{i}": ORIENTATION for i in (1, 2, 3)},
    **{f"q{i}": Quantity("quaternion", "-") for i in range(4)},
    **_axes("v", VELOCITY),
    **_axes("w", SPIN),
    **_axes("a", Quantity("acceleration", "m/s^2")),
    **_axes("alpha", Quantity("angular acceleration", "rad/s^2")),
    **_axes("p", Quantity("momentum", "kg m/s")),
    **_axes("L", Quantity("angular momentum", "kg m^2/s")),
    **_axes("F", FORCE),
    **_axes("M", MOMENT),
    **_coordinates(("angle", "angle1", "angle2"), "angle", "rad"),
    **_coordinates(("slide", "slide1", "slide2"), "slide", "m"),
    **_coordinates(("distance",), "distance", "m"),
    **_coordinates((AMPLITUDE,), "amplitude", "m"),
    **dict.fromkeys(("stretch", "shear2", "shear3"), Quantity("strain", "-")),
    **dict.fromkeys(("twist", "curvature2", "curvature3"), Quantity("curvature", "1/m")),
    **{f"n{i}": FORCE for i in (1, 2, 3)},
    **{f"m{i}": MOMENT for i in (1, 2, 3)},
    "kinetic": ENERGY,
    "potential": ENERGY,
    "energy": ENERGY,
    "work": Quantity("work", "J"),
    "power": POWER,
    "factor": Quantity("factor", "-"),
    "load": Quantity("load", "N or N m"),
    "error": Quantity("error bar", "N or N m"),
}
"""Quantity of a column by the part of its name after the last point."""
ERRORS = {
    "position": Quantity("estimated error", "m"),
    "orientation": Quantity("estimated error", "m"),
    "missingForce": Quantity("missing force", "N"),
}
"""Quantities of the table of estimated errors, and of the column of ``drives.csv`` that belongs to
no drive."""
LOADS = ("load", "error")


def quantity(column: str, model: Model | None = None) -> Quantity:
    """Return the quantity of a column; with the ``model`` also the unit of a load or a signal."""
    name, point, suffix = column.rpartition(".")
    if column == TIME:
        return Quantity("time", "s")
    if suffix == ERROR_OF:
        return Quantity(ERRORS["position"].word, quantity(name, model).unit)
    if not point:
        return ERRORS.get(column) or (_signal(column, model) if model else SIGNAL)
    found = QUANTITIES.get(suffix, UNKNOWN)
    along = _along(name, model) if suffix in LOADS and model is not None else ""
    return Quantity(found.word, "N m" if is_angle(along) else "N") if along else found


def _signal(name: str, model: Model) -> Quantity:
    """Return the quantity of a signal or an auxiliary state."""
    units = (s.unit for s in model.signals if s.name == name and not isinstance(s, SignalTable))
    return Quantity(SIGNAL.word, shown_unit(next(units, "")) or SIGNAL.unit)


def shown_unit(unit: str) -> str:
    """Return a unit of a deck, such as ``N-m/sec``, as tables and pages write it: ``N m/s``."""
    return re.sub(r"(?<=[\w)])-(?=[A-Za-z(])", " ", unit.replace("sec", "s"))


def _along(name: str, model: Model) -> str:
    """Return the coordinate along which a coupling, motion, actuator or drive acts, "" if there is
    none of this name; a drive that is not of the deck is called JOINT.COORDINATE."""
    for coupling in model.couplings:
        if coupling.name == name:
            return COORDINATES[coupling.kind][1]
    for element in (*model.motions, *model.loads):
        if element.name == name:
            return getattr(element, "coordinate", "slide")
    for side in (*model.contact_sides, *model.compliant_sides):
        if side.name == name:
            return getattr(side.contact, "coordinate", "slide")
    joint, _, coordinate = name.rpartition(".")
    return coordinate if any(each.name == joint for each in model.joints) else ""
