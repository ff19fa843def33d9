"""Places of nodes: of an Abaqus or CalculiX input (*NODE), Nastran bulk data (GRID), or a table.

Files that these include are not read: the file that has the nodes is given instead.
"""

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from msahl.reduction.cards import cards_of
from msahl.reduction.elastic_model import MOST_EQUATIONS, Nodes
from msahl.reduction.faults import ReductionError, shown
from msahl.reduction.text_files import head_of, lines_of, natural, not_a_number, real

Place = tuple[int, float, float, float]


def read_nodes(path: Path) -> Nodes:
    """Return the nodes of a file; raises ``ReductionError``."""
    head = head_of(path).decode("latin-1").upper()
    reader = _reader_of(f"\n{head}")
    found: list[Place] = []
    for node in reader(path):
        found.append(node)
        if len(found) > MOST_EQUATIONS:
            raise ReductionError(str(path), f"more than {MOST_EQUATIONS} nodes")
    if not found:
        raise ReductionError(
            str(path), "there are no nodes (*NODE, GRID, or lines 'number, x, y, z') in it; files "
            "that it includes are not read: give the one that has them by --nodes",
        )  # fmt: skip
    table = np.array(found)
    return Nodes(np.array([node[0] for node in found]), table[:, 1:])


def _reader_of(head: str) -> Callable[[Path], Iterator[Place]]:
    if "\nGRID" in head or "\nBEGIN" in head or "\n$" in head:
        return _grids
    return _input_nodes if "\n*" in head else _table


def _table(path: Path) -> Iterator[Place]:
    for number, line in lines_of(path):
        words = line.replace(",", " ").split()
        # A first line with the names of the columns.
        if words and not words[0].startswith(("#", "%")) and not (number == 1 and _is_text(words)):
            yield _place(path, number, words)


def _is_text(words: list[str]) -> bool:
    return all(real(word) is None for word in words)


def _place(path: Path, number: int, words: list[str]) -> Place:
    """Return the node of a line: its label and up to three coordinates."""
    label = natural(words[0])
    if label is None:
        raise ReductionError(
            str(path), f"'{shown(words[0])}' is not the number of a node; correct the line", number
        )
    values = []
    for word in [*words[1:4], *["0"] * (4 - len(words))]:
        value = real(word or "0")
        if value is None:
            raise not_a_number(path, number, word)
        values.append(value)
    return label, values[0], values[1], values[2]


def _input_nodes(path: Path) -> Iterator[Place]:
    """Yield the nodes of an input of Abaqus or CalculiX."""
    reading = False
    for number, line in lines_of(path):
        text = line.strip()
        if not text or text.startswith("**"):
            continue
        if text.startswith("*"):
            reading = _keyword(path, number, text.upper().replace(" ", ""))
        elif reading:
            yield _place(path, number, [word.strip() for word in text.split(",")])


def _keyword(path: Path, number: int, text: str) -> bool:
    """Return whether the lines after a keyword are nodes."""
    name, *given = text.split(",")
    if name == "*SYSTEM" or (name == "*NODE" and any(one.startswith("SYSTEM=") for one in given)):
        raise ReductionError(
            str(path), "nodes in a coordinate system of their own are not read; write global "
            "coordinates", number,
        )  # fmt: skip
    if name == "*NODE" and any(one.startswith("INPUT=") for one in given):
        raise ReductionError(
            str(path), "the nodes are in another file; give that by --nodes", number
        )
    return name == "*NODE"


def _grids(path: Path) -> Iterator[Place]:
    """Yield the grid points of Nastran's bulk data."""
    for card in cards_of(path, ("GRID",)):
        fields = [*card.fields, *[""] * 6]
        for system in (fields[1], fields[5]):
            if system.strip() not in ("", "0"):
                raise ReductionError(
                    str(path), f"GRID {shown(fields[0])} refers to coordinate system "
                    f"{shown(system)}; write basic coordinates", card.line,
                )  # fmt: skip
        yield _place(path, card.line, [fields[0], *fields[2:5]])
