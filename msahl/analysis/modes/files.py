"""Files of modes: tables at one configuration and over a parameter, and what pictures need."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from msahl.analysis.linearised.point import Point
from msahl.analysis.modes.campbell import (
    COLUMNS,
    CRITICAL_COLUMNS,
    Campbell,
    campbell_rows,
    critical_rows,
)
from msahl.analysis.modes.solution import COLUMNS as MODE_COLUMNS
from msahl.analysis.modes.solution import Modes, mode_rows, shape_columns, shape_rows
from msahl.deck.units import parse_unit
from msahl.results.write import write_json, write_tables


class Over(NamedTuple):
    """What is varied: its name, the unit of its values, and the multiples of it, as a speed, that
    frequencies are compared with.
    """

    name: str
    unit: str = ""
    orders: tuple[float, ...] = ()

    @property
    def speed(self) -> float | None:
        """What a value is times in rad/s; None if the unit is none of angular velocities."""
        return speed_unit(self.unit)


def speed_unit(unit: str) -> float | None:
    """Return a unit in rad/s; None if it is none of angular velocities."""
    known, rate = parse_unit(unit) if unit else None, parse_unit("rad/s")
    if known is None or rate is None or known.dimension != rate.dimension:
        return None
    return float(known.factor)


def orders_of(unit: str, wanted: Sequence[float]) -> tuple[float, ...]:
    """Return the orders that are ``wanted``, by default 1 of a speed."""
    return tuple(wanted) or ((1.0,) if speed_unit(unit) is not None else ())


def write_modes(folder: Path, point: Point, found: Modes) -> None:
    """Write modes.csv and shapes.csv into the ``folder``, which is made."""
    shapes = (shape_columns(point), shape_rows(point, found))
    write_tables(folder, {"modes": (MODE_COLUMNS, mode_rows(found)), "shapes": shapes})


def write_campbell(folder: Path, found: Campbell, over: Over, title: str) -> None:
    """Write campbell.csv, critical.csv and campbell.json into the ``folder``, which is made."""
    critical = (CRITICAL_COLUMNS, critical_rows(found))
    write_tables(folder, {"campbell": (COLUMNS, campbell_rows(found)), "critical": critical})
    info = {"title": title, "name": over.name, "unit": over.unit, "orders": list(over.orders)}
    write_json(folder / "campbell.json", {**info, "speed": over.speed})
