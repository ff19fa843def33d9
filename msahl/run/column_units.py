"""Quantity and unit of a column of a run's tables, by its name.

A column is NAME.SUFFIX; the suffix determines the quantity (docs/results.md lists all of them). A
signal or auxiliary state is a NAME alone. Only a load has one unit or another, by its coordinate.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from msahl.joints.coordinates import SUFFIXES, is_angle
from msahl.model import Model
from msahl.model.couplings import COORDINATES
from msahl.run.tables import ERROR_OF

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
}
"""Quantity of a column by the part of its name after the last point."""
ERRORS = {
    "position": Quantity("estimated error", "m"),
    "orientation": Quantity("estimated error", "m"),
}
"""Quantities of the table of estimated errors."""


def quantity(column: str, model: Model | None = None) -> Quantity:
    """Return the quantity of a column; with the ``model`` also the unit of a load."""
    name, point, suffix = column.rpartition(".")
    if suffix == ERROR_OF and name:
        return Quantity(ERRORS["position"].word, quantity(name, model).unit)
    if not point:
        return Quantity("time", "s") if column == TIME else ERRORS.get(column, SIGNAL)
    if suffix == "load" and model is not None:
        return _load(name, model)
    return QUANTITIES.get(suffix, UNKNOWN)


def _load(name: str, model: Model) -> Quantity:
    """Return the quantity of the load of a coupling, motion or actuator: force or moment."""
    for coupling in model.couplings:
        if coupling.name == name:
            along = COORDINATES[coupling.kind][1]
            break
    else:
        elements = (*model.motions, *model.loads)
        found = [each for each in elements if each.name == name]
        along = getattr(found[0], "coordinate", "slide") if found else ""
    if not along:
        return QUANTITIES["load"]
    return Quantity("load", "N m" if is_angle(along) else "N")
