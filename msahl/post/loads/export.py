"""Write the loads of the bodies of a run: tables, and load cards for each body."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path

from msahl.post.loads.abaqus import abaqus
from msahl.post.loads.body_cards import BodyCards, cards_of
from msahl.post.loads.instants import extreme_rows, nearest_rows
from msahl.post.loads.nastran import nastran
from msahl.post.loads.table import loads_table, motions_table
from msahl.post.loads.wrenches import BodyLoads, Instant
from msahl.results.read import Run

FORMATS: dict[str, tuple[str, Callable[[BodyCards], str]]] = {
    "nastran": (".bdf", nastran),
    "abaqus": (".inp", abaqus),
}
"""Ending of files and writer of each format of cards; that of Abaqus is CalculiX's as well."""


def instants_of(run: Run, times: Sequence[float] = (), everything: bool = False) -> list[Instant]:
    """Return all loads at the extreme instants of a ``run``, at the output times nearest to
    ``times`` [s], or at all. Raises ``ResultError``."""
    loads = BodyLoads(run)
    if everything:
        rows = list(range(len(run.time)))
    else:
        rows = nearest_rows(run, times) if times else extreme_rows(run)
    return [loads.at(row) for row in rows]


def texts(run: Run, instants: Sequence[Instant], formats: Sequence[str]) -> dict[str, str]:
    """Return the files by name."""
    files = {"loads.csv": loads_table(instants), "motions.csv": motions_table(instants)}
    for number, cards in enumerate(cards_of(run.model, instants), start=1):
        for name in formats:
            ending, write = FORMATS[name]
            files[f"{number}_{re.sub(r'[^A-Za-z0-9-]', '_', cards.body)}{ending}"] = write(cards)
    return files


def write_loads(folder: Path, files: dict[str, str]) -> None:
    """Write files into a folder, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
