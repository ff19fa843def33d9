"""Cards of Nastran: fields of 8 or 16 characters, or between commas, with their continuations."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from msahl.reduction.text_files import lines_of


@dataclass(slots=True)
class Card:
    """The ``fields`` of a card behind its name, and the ``line`` on which it begins."""

    name: str
    line: int
    fields: list[str]


def cards_of(path: Path, names: tuple[str, ...]) -> Iterator[Card]:
    """Yield the cards of these names; raises ``ReductionError``."""
    card: Card | None = None
    for number, line in lines_of(path):
        text = line.split("$")[0].rstrip().expandtabs(8)
        if not text:
            continue
        name, fields = _fields(text)
        if name in ("", "*", "+") or name[:1] in "*+":
            if card is not None:
                card.fields.extend(fields)
            continue
        if card is not None:
            yield card
        card = Card(name, number, fields) if name in names else None
    if card is not None:
        yield card


def _fields(text: str) -> tuple[str, list[str]]:
    """Return the name of a line, upper case and without asterisk, and its fields."""
    if "," in text:
        first, *fields = text.split(",")
        wide = "*" in first
        count = 4 if wide else 8
        fields = [field.strip() for field in fields[:count]]
    else:
        first = text[:8]
        wide = "*" in first
        size, count = (16, 4) if wide else (8, 8)
        fields = [text[8 + size * k : 8 + size * (k + 1)].strip() for k in range(count)]
    fields += [""] * (count - len(fields))
    return first.strip().upper().rstrip("*"), fields
