"""A small table of figures, and its forms: aligned text, CSV, JSON."""

import csv
import io
import json
import math
from dataclasses import dataclass

Cell = str | int | float | None


@dataclass(frozen=True, slots=True)
class Column:
    """``key`` heads it in CSV and JSON, ``label`` with unit elsewhere, under a common ``group``.

    ``form`` is the format of its numbers; ``missing`` stands for ``None``.
    """

    key: str
    label: str
    group: str = ""
    form: str = ""
    missing: str = "n/a"

    def show(self, cell: Cell) -> str:
        """``cell`` for a reader."""
        if cell is None:
            return self.missing
        return cell if isinstance(cell, str) else format(cell, self.form)


@dataclass(frozen=True, slots=True)
class Table:
    """Columns and rows; a ``None`` is a figure that is undefined or not available."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def shown(self) -> list[list[str]]:
        """The rows as a reader sees them."""
        return [
            [c.show(cell) for c, cell in zip(self.columns, row, strict=True)] for row in self.rows
        ]

    def numeric(self) -> list[bool]:
        """Which columns hold numbers (and stand to the right)."""
        return [bool(column.form) for column in self.columns]

    def without(self, key: str) -> "Table":
        """The table without the column ``key``."""
        kept = [i for i, column in enumerate(self.columns) if column.key != key]
        rows = tuple(tuple(row[i] for i in kept) for row in self.rows)
        return Table(tuple(self.columns[i] for i in kept), rows)

    def filled(self) -> "Table":
        """The table without the columns that are empty in every row."""
        empty = [
            c.key
            for c, cells in zip(self.columns, zip(*self.rows, strict=True), strict=True)
            if all(cell is None for cell in cells)
        ]
        table = self
        for key in empty:
            table = table.without(key)
        return table

    def transposed(self) -> "Table":
        """A table of one row as lines of header and figure, without the blank ones."""
        (figures,) = self.shown()
        columns = (Column("figure", "figure"), Column("value", "value", form="g"))
        rows = zip(self.headers(), figures, strict=True)
        return Table(columns, tuple((header, figure) for header, figure in rows if figure))

    def headers(self) -> list[str]:
        """One line of headers: group and label."""
        return [f"{c.group}: {c.label}" if c.group else c.label for c in self.columns]


def as_text(table: Table) -> str:
    """Aligned columns, groups of columns under a common header."""
    lines = [[column.label for column in table.columns], *table.shown()]
    widths = [max(map(len, cells)) for cells in zip(*lines, strict=True)]
    groups = _group_line(table, widths)
    texts = [groups] if groups else []
    for line in lines:
        cells = zip(line, widths, table.numeric(), strict=True)
        texts.append(
            "  ".join(c.rjust(w) if right else c.ljust(w) for c, w, right in cells).rstrip()
        )
    return "\n".join(texts) + "\n"


def _group_line(table: Table, widths: list[int]) -> str:
    """Each group's name from where its first column starts; widens its last column if it must."""
    spans: list[tuple[str, list[int]]] = []
    for i, column in enumerate(table.columns):
        if spans and spans[-1][0] == column.group:
            spans[-1][1].append(i)
        else:
            spans.append((column.group, [i]))
    parts = []
    for group, columns in spans:
        width = sum(widths[i] for i in columns) + 2 * (len(columns) - 1)
        widths[columns[0]] += max(0, len(group) - width)
        parts.append(group.center(max(width, len(group)), "-" if group else " "))
    return "  ".join(parts).rstrip()


def as_csv(table: Table) -> str:
    """Comma-separated, numbers as the shortest decimals that give the same double."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(column.key for column in table.columns)
    writer.writerows(table.rows)
    return stream.getvalue()


def as_json(table: Table) -> str:
    """A list of objects, one a row; ``null`` for what is undefined or not finite."""
    keys = [column.key for column in table.columns]
    objects = [dict(zip(keys, map(_finite, row), strict=True)) for row in table.rows]
    return json.dumps(objects, indent=2) + "\n"


def _finite(cell: Cell) -> Cell:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell
