"""Represent a small table of numbers and write it as aligned text, CSV or JSON."""

import csv
import io
import json
import math

from msahl.records import record

Cell = str | int | float | None


@record
class Column:
    """A column of a table: ``key`` is its header in CSV and JSON, ``label`` (with unit) elsewhere.

    Columns of one ``group`` have a common header. ``form`` is the format of numbers; ``missing`` is
    printed for ``None``.
    """

    key: str
    label: str
    group: str = ""
    form: str = ""
    missing: str = "n/a"

    def show(self, cell: Cell) -> str:
        """Return the text of ``cell``."""
        if cell is None:
            return self.missing
        return cell if isinstance(cell, str) else format(cell, self.form)


@record
class Table:
    """Columns and rows; ``None`` is a value that is undefined or not available."""

    columns: tuple[Column, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def shown(self) -> list[list[str]]:
        """Return the text of all cells."""
        return [
            [c.show(cell) for c, cell in zip(self.columns, row, strict=True)] for row in self.rows
        ]

    def numeric(self) -> list[bool]:
        """Say of each column whether it holds numbers, which are aligned to the right."""
        return [bool(column.form) for column in self.columns]

    def without(self, key: str) -> "Table":
        """Return the table without the column ``key``."""
        kept = [i for i, column in enumerate(self.columns) if column.key != key]
        rows = tuple(tuple(row[i] for i in kept) for row in self.rows)
        return Table(tuple(self.columns[i] for i in kept), rows)

    def filled(self) -> "Table":
        """Return the table without the columns that are empty in every row."""
        table = self
        for i, column in enumerate(self.columns):
            if self.rows and all(row[i] is None for row in self.rows):
                table = table.without(column.key)
        return table

    def transposed(self) -> "Table":
        """Return a table of one row as lines of header and value, without the blank ones."""
        (values,) = self.shown()
        columns = (Column("quantity", "quantity"), Column("value", "value", form="g"))
        rows = zip(self.headers(), values, strict=True)
        return Table(columns, tuple((header, value) for header, value in rows if value))

    def headers(self) -> list[str]:
        """Return the header of each column: group and label."""
        return [f"{c.group}: {c.label}" if c.group else c.label for c in self.columns]


def as_text(table: Table) -> str:
    """Return the table as aligned text, groups of columns under a common header."""
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
    """Return the line of group headers; widens the first column of a group if it has to."""
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
    """Return the table as CSV, numbers as the shortest decimals that give the same double."""
    stream = io.StringIO()
    writer = csv.writer(stream, lineterminator="\n")
    writer.writerow(column.key for column in table.columns)
    writer.writerows(table.rows)
    return stream.getvalue()


def as_json(table: Table) -> str:
    """Return a JSON list of objects; ``null`` for a value that is undefined or not finite."""
    keys = [column.key for column in table.columns]
    objects = [dict(zip(keys, map(_finite, row), strict=True)) for row in table.rows]
    return json.dumps(objects, indent=2) + "\n"


def _finite(cell: Cell) -> Cell:
    return None if isinstance(cell, float) and not math.isfinite(cell) else cell
