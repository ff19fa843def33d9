"""Matrices of Nastran, punched as DMIG cards, whose names begin with K and M: KAAX, MAAX.

A header (field 3 is 0) states the form of a matrix: 6 symmetric, of which one triangle may be
written, or 1 square. Each further card is a column: node and component, and node, component and
number of each entry. Places of the nodes are GRID cards, in this file or in another one.
"""

from dataclasses import dataclass, field
from pathlib import Path

from msahl.reduction.cards import Card, cards_of
from msahl.reduction.elastic_model import Matrices
from msahl.reduction.entries import Entries, assembled
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.text_files import natural, real

SQUARE, SYMMETRIC = "1", "6"
KINDS = {"K": "stiffness", "M": "mass", "B": "damping"}
"""What a matrix is, by the first letter of its name; the second of M2GG, K2PP counts as well."""
STEP = 4
"""Fields of an entry: node, component, real and imaginary part."""


@dataclass(slots=True)
class _Punched:
    entries: dict[str, Entries] = field(default_factory=dict)
    names: dict[str, str] = field(default_factory=dict)


def read_dmig(path: Path) -> Matrices:
    """Return the matrices of a file; raises ``ReductionError``."""
    found = _Punched()
    for card in cards_of(path, ("DMIG",)):
        _take(path, card, found)
    for what in ("stiffness", "mass"):
        if what not in found.entries:
            raise ReductionError(
                str(path), f"there is no matrix of {what}; punch KAAX and MAAX into one file"
            )
    return assembled(str(path), found.entries)


def _take(path: Path, card: Card, found: _Punched) -> None:
    """Add the entries of a card."""
    name = card.fields[0].upper()
    what = KINDS.get(name[:1])
    if what is None:
        return
    if found.names.setdefault(what, name) != name:
        raise ReductionError(
            str(path), f"{found.names[what]} and {shown(name)} are both matrices of {what}; "
            "delete one", card.line,
        )  # fmt: skip
    if card.fields[1] == "0":
        _check_header(path, card)
        return
    entries = found.entries.setdefault(what, Entries())
    column = _row(path, card, card.fields[1], card.fields[2])
    for k in range(STEP, len(card.fields) - 2, STEP):
        node, component, number = card.fields[k : k + 3]
        if not node:
            continue
        value = real(number)
        if value is None:
            raise ReductionError(
                str(path), f"column {card.fields[1]}, {card.fields[2]}: '{shown(number)}' is not a "
                "number; correct the card", card.line,
            )  # fmt: skip
        entries.add(_row(path, card, node, component), column, value)


def _check_header(path: Path, card: Card) -> None:
    form, kind = card.fields[2], card.fields[3]
    if form not in (SQUARE, SYMMETRIC) or kind not in ("1", "2"):
        raise ReductionError(
            str(path), f"{card.fields[0]} has form {shown(form)} and type {shown(kind)}; punch a "
            "real symmetric matrix (form 6, type 1 or 2)", card.line,
        )  # fmt: skip


def _row(path: Path, card: Card, node: str, component: str) -> tuple[int, int]:
    """Return label and component, from 0, of a row."""
    label, number = natural(node), natural(component or "0")
    if label is None or number is None or number > 6:
        raise ReductionError(
            str(path), f"'{shown(node)}', '{shown(component)}' is no component of a node; correct "
            "the card", card.line,
        )  # fmt: skip
    if number == 0:
        raise ReductionError(
            str(path), f"point {label} is a scalar: an amplitude of a mode without a place; punch "
            "the matrices of the nodes, without a reduction to modes", card.line,
        )  # fmt: skip
    return label, number - 1
