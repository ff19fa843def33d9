"""Columns of a table of motion: which coordinate each is, and in what unit.

A header says it itself, ``Shaft.angle [deg]``, quoted or not, or a mapping does:
``q1=Shaft.angle:deg``.
"""

import csv
import re
from collections.abc import Mapping, Sequence

import numpy as np

from msahl.analysis.inverse.drives import InverseError
from msahl.deck.units import parse_unit
from msahl.printable import printable
from msahl.run.column_units import QUANTITIES, TIME

_WITH_UNIT = re.compile(r"(.*\S)\s*[\[(]([^\])]*)[\])]")
"""A name with its unit in brackets or parentheses."""


def header(line: str) -> list[str]:
    """Return the names in the first line of a CSV table."""
    return [name.strip() for name in next(csv.reader([line], skipinitialspace=True), [])]


def mapping_of(texts: Sequence[str]) -> dict[str, str]:
    """Return what ``COLUMN=COORDINATE:UNIT`` says of columns; several are separated by commas.
    Raises ``InverseError``.
    """
    found = {}
    for text in (part.strip() for each in texts for part in each.split(",")):
        name, _, target = text.rpartition("=")
        if not name.strip() or not target.strip():
            raise InverseError(
                f"'{printable(text)}': map a column of the table to a coordinate, with its unit if "
                "that is not SI, such as q1=Shaft.angle:deg"
            )
        found[name.strip()] = target.strip()
    return found


def in_si(
    columns: Sequence[str], numbers: np.ndarray, mapping: Mapping[str, str], source: str
) -> tuple[list[str], np.ndarray]:
    """Return the names of coordinates and (m, columns) numbers in SI of a table; ``mapping`` is
    that of ``mapping_of``. Raises ``InverseError``.
    """
    plain = {name: match[1] for name in columns if (match := _WITH_UNIT.fullmatch(name))}
    for name in mapping:
        if name not in columns and name not in plain.values():
            raise InverseError(
                f"{source}: no column '{printable(name)}' to map; the table has "
                f"{', '.join(printable(each) for each in columns[:8])}"
            )
    names: list[str | None] = []
    factors: list[float] = []
    for column in columns:
        coordinate, factor = _coordinate(column, mapping, source)
        names.append(coordinate)
        factors.append(factor)
    used = [i for i, name in enumerate(names) if name is not None]
    kept = [name for name in names if name is not None]
    return kept, numbers[:, used] * np.array([factors[i] for i in used])


def _coordinate(column: str, mapping: Mapping[str, str], source: str) -> tuple[str | None, float]:
    """Return the coordinate that a column has and its unit in SI."""
    match = _WITH_UNIT.fullmatch(column)
    plain, unit = (match[1], match[2].strip()) if match else (column, "")
    target = mapping.get(column, mapping.get(plain))
    name = plain
    if target is not None:
        name, _, own = target.partition(":")
        name, unit = name.strip(), own.strip() or unit
    elif mapping and name != TIME and "." not in name:
        return None, 1.0  # a table of measurements has more than the motion
    return name, _factor(name, unit, source) if unit else 1.0


def _factor(name: str, unit: str, source: str) -> float:
    """Return a ``unit`` of a coordinate in SI."""
    quantity = QUANTITIES.get(name.rpartition(".")[2])
    si = "s" if name == TIME else quantity.unit if quantity else ""
    known, wanted = parse_unit(unit), parse_unit(si) if si else None
    if unit == si or unit in ("-", "1"):
        return 1.0
    if known is None or wanted is None or known.dimension != wanted.dimension:
        raise InverseError(
            f"{source}: the unit '{printable(unit)}' of {printable(name)} is none of its own; give "
            f"one like {si or 'none'}"
        )
    return float(known.factor / wanted.factor)
