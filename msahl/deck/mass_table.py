"""Mass tables: a CSV file with a row for each body, as CAD programs export them, read as a part.

    name, mass [kg], cx [mm], cy [mm], cz [mm], Ixx [kg-mm^2], Iyy [kg-mm^2], Izz [kg-mm^2]
    Arm,  3.2,       210,     12,      -4,      8100,          61000,         62500

The header has the unit of every column. ``COLUMNS`` are those that there are; their order is free,
other columns are faults, and those that are not required may be absent or empty. The tensor is
about the mass centre, or, with columns IxxB to IyzB, about the body's reference point. Columns are
separated by commas, semicolons or tabs.
"""

import csv
import io
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from lxml import etree
from lxml.etree import SubElement

from msahl.check.bodies import TENSOR
from msahl.deck.faults import Element, Faults
from msahl.deck.parse import PART
from msahl.deck.units import UNITS
from msahl.deck.values import INERTIAL_BASIS
from msahl.expressions.syntax import nearest

NAME, MASS = "name", "mass"
MOST_COLUMNS = 100
HEADING = re.compile(r"\s*(?P<name>[^\[\]()]*?)\s*(?:[\[(]\s*(?P<unit>[^\[\]()]*?)\s*[\])])?\s*\Z")
NOT_XML = re.compile(r"[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that elements cannot hold."""
COLUMNS: Mapping[str, tuple[str, str]] = {
    NAME: ("name", ""),
    MASS: ("mass", "mass"),
    **{f"c{axis}": (f"rGB/{axis}", "length") for axis in "xyz"},
    **{tag: (f"moi/{tag}", "inertia") for tag in TENSOR},
    **{f"{tag}B": (f"moi/{tag}", "inertia") for tag in TENSOR},
    **{axis: (f"initialConditions/position/{axis}", "length") for axis in "xyz"},
    "phi": ("initialConditions/orientation/eulerRotation/phi", "angle"),
    **{f"u{k}": (f"initialConditions/orientation/eulerRotation/u{k}", "") for k in (1, 2, 3)},
}
"""Path of the element that a column gives, and its physical quantity."""


class _Column(NamedTuple):
    """A column of the table: the element's path, the unit of its numbers, its heading."""

    path: str
    unit: str
    heading: str


def read_mass_table(data: bytes, unit_system: str, faults: Faults) -> Element:
    """Return the tree of a part with the bodies of a table; its elements have the lines of the
    file. Raises ``DeckError`` for a table that cannot be read."""
    rows = _rows(data, faults)
    part = etree.Element(PART)
    SubElement(part, "unitSystem").text = unit_system
    bodies = SubElement(SubElement(part, "system"), "bodies")
    line, header = next(rows, (1, []))
    _place(part, line)
    columns = _columns(header, part, faults)
    for line, cells in rows:
        if any(cell.strip() for cell in cells):
            body = SubElement(bodies, "rigidBody")
            _fill(body, cells, columns, faults, line)
    faults.raise_if_any()
    if not len(bodies):
        faults.stop("the table has no bodies; each row below the header is one")
    return part


def _rows(data: bytes, faults: Faults) -> Iterator[tuple[int, list[str]]]:
    """Yield line and cells of each row."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        faults.stop("the table is not text in UTF-8; export it again")
    foreign = NOT_XML.search(text)
    if foreign:
        line = text.count("\n", 0, foreign.start()) + 1
        faults.stop(f"the character {foreign[0]!a} is not text; delete it", line)
    first = text.lstrip().partition("\n")[0]
    separator = max(",;\t", key=first.count)
    reader = csv.reader(io.StringIO(text), delimiter=separator, skipinitialspace=True)
    try:
        for cells in reader:
            if len(cells) > MOST_COLUMNS:
                faults.stop(
                    f"the row has {len(cells)} cells; at most {MOST_COLUMNS}", reader.line_num
                )
            yield reader.line_num, cells
    except csv.Error as error:
        faults.stop(f"not a table: {error}; export it again", reader.line_num)


def _columns(header: Sequence[str], part: Element, faults: Faults) -> list[_Column]:
    """Return the columns by their headings; those that are wrong or missing are faults."""
    found: list[_Column] = []
    names = [_heading(heading)[0] for heading in header]
    for heading, name in zip(header, names, strict=True):
        path, quantity = COLUMNS.get(name, ("", ""))
        unit = _heading(heading)[1]
        if not path:
            faults.add(part, f"column '{heading.strip()[:60]}' is unknown{nearest(name, COLUMNS)}")
        elif names.count(name) > 1:
            faults.add(part, f"column '{name}' is given twice; delete one")
        elif unit not in (UNITS[quantity] if quantity else ("",)):
            known = f"a unit of {', '.join(UNITS[quantity])}" if quantity else "no unit"
            example = f", such as {name} [{next(iter(UNITS[quantity]))}]" if quantity else ""
            faults.add(part, f"column '{heading.strip()[:60]}': expected {known}{example}")
        found.append(_Column(path, unit, name))
    about_B = [name for name in names if name.endswith("B")]
    tensor = [f"{tag}B" if about_B else tag for tag in TENSOR]
    if about_B and any(name in TENSOR for name in names):
        faults.add(part, "the tensor is given about two points; keep either Ixx or IxxB, ...")
    for name in (NAME, MASS, *tensor[:3]):
        if name not in names:
            faults.add(part, f"column '{name}' is missing; add it")
    faults.raise_if_any()
    return found


def _heading(heading: str) -> tuple[str, str]:
    """Return name and unit of a heading such as ``Ixx [kg-mm^2]``."""
    match = HEADING.match(heading)
    return (match["name"], match["unit"] or "") if match else (heading, "")


def _fill(
    body: Element, cells: Sequence[str], columns: Sequence[_Column], faults: Faults, line: int
) -> None:
    """Add what a row gives to the element of its body, in the order that decks have."""
    _place(body, line)
    given = {c.heading: (c, cell.strip()) for c, cell in zip(columns, cells, strict=False)}
    for name in COLUMNS:
        column, cell = given.get(name, (_Column("", "", name), ""))
        if name == NAME:
            _child(body, NAME, line).text = cell
        elif cell:
            element = _child(body, column.path, line)
            if not _is_number(cell):
                faults.add(element, f"'{cell[:60]}' is not a finite number; correct the cell")
            element.text = cell
            if column.unit:
                element.set("units", column.unit)
        elif name in (MASS, *TENSOR[:3]) and column.path:
            faults.add(body, f"it has no {name}; fill the cell")
    if len(cells) > len(columns):
        faults.add(body, f"the row has {len(cells)} cells, the header {len(columns)}")
    position = body.find("initialConditions/position")
    if position is not None:
        position.set("basis", INERTIAL_BASIS)
    moi = body.find("moi")
    if moi is not None and any(c.heading.endswith("B") for c in columns):
        moi.set("about", "B")


def _child(body: Element, path: str, line: int) -> Element:
    """Return the element at a path, made where it is missing."""
    element = body
    for tag in path.split("/"):
        found = element.find(tag)
        element = SubElement(element, tag) if found is None else found
        _place(element, line)
    return element


def _place(element: Element, line: int) -> None:
    """Give an element the line of its row."""
    element.sourceline = line  # type: ignore[assignment]  # of lxml's stubs


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell)) and "_" not in cell
    except ValueError:
        return False
