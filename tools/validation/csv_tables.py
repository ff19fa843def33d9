"""Write records to CSV tables and read them again."""

import csv
from collections.abc import Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar, get_args, get_type_hints

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

Record = TypeVar("Record", bound="DataclassInstance")


def write_records(
    path: Path, kind: type[Record], records: Iterable[Record], digits: int, omit: Iterable[str] = ()
) -> None:
    """Write one line per record; floats have ``digits`` digits, None is empty.

    Fields in ``omit`` are not written.
    """
    names = [field.name for field in fields(kind) if field.name not in set(omit)]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(names)
        for record in records:
            values = asdict(record)
            writer.writerow(_text(values[name], digits) for name in names)


def _text(value: object, digits: int) -> str:
    if value is None:
        return ""
    return f"{value:.{digits}g}" if isinstance(value, float) else str(value)


def read_records(path: Path, kind: type[Record]) -> list[Record]:
    """Return the records of a table that ``write_records`` has written."""
    hints = get_type_hints(kind)
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [kind(**{key: _value(hints[key], text) for key, text in row.items()}) for row in rows]


def _value(hint: object, text: str) -> str | float | int | None:
    """Return the value of a field whose type is ``hint``, possibly a union of types."""
    kinds = get_args(hint) or (hint,)
    if text == "" and type(None) in kinds:
        return None
    if int in kinds:
        return int(text)
    if float in kinds:
        try:
            return float(text)
        except ValueError:
            return text  # the name of a deck in place of a number
    return text
