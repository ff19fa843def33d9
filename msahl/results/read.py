"""A run's folder -> arrays: the model it ran, its tables and its ``run.json``."""

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from msahl.deck import read_deck
from msahl.model import STATION, Model, degree_of, reactions_of
from msahl.results.folder import find
from msahl.results.write import DECK, INFO, PART, STATES
from msahl.system.names import reaction_columns, state_columns, work_columns, workers


class ResultError(Exception):
    """A folder that is not a run's; the message names file and remedy."""


@dataclass(frozen=True)
class Run:
    """One run as read back. Tables have the columns of ``system.names``; rows share ``time``."""

    folder: Path
    model: Model
    info: dict[str, Any]
    states: pd.DataFrame
    reactions: pd.DataFrame | None
    work: pd.DataFrame | None
    partial: bool

    @property
    def time(self) -> np.ndarray:
        """Times of the rows [s]."""
        return self.states["time"].to_numpy()

    @property
    def every(self) -> int:
        """Steps from one row to the next, at least 1: more if the output was thinned. Rows of a
        scheme of higher order are where they are, whatever its steps.

        A run cut off by force has no ``run.json`` to say so; its rows' spacing tells.
        """
        options, dt = self.info.get("options", {}), self.model.simulation.dt
        told = options.get("every")
        if told is not None or len(self.time) < 2:
            interval = None if degree_of(self.model) else options.get("outputInterval")
            return int(told or 1) * max(1, round((interval or dt) / dt))
        spacing = float(self.time[1] - self.time[0])
        return max(1, round(spacing / dt))

    @property
    def at_rows(self) -> bool:
        """Whether reactions are those at the rows' own times, not means over the steps before."""
        return reactions_of(self.model) == STATION

    @property
    def has_means(self) -> bool:
        """Whether the mean reaction of every step is on file."""
        return self.every == 1 and not self.at_rows


def read_run(folder: Path) -> Run:
    """Read the run in ``folder``; a run that stopped early is read as far as it came.

    Raises ``ResultError`` if there is no run, ``DeckError`` if its deck is not valid.
    """
    deck = find(folder, DECK)
    if deck is None:
        raise ResultError(f"{folder}: not the folder of a run (no deck.xml); make one: msahl run")
    model = read_deck(deck)
    columns = {"states.csv": state_columns(model)}
    if model.joints or model.couplings or model.motions:
        columns["reactions.csv"] = reaction_columns(model)
    if workers(model):
        columns["work.csv"] = work_columns(model)
    tables = {name: _table(folder, name, header) for name, header in columns.items()}
    # A run cut off by force may have written more of one table than of another.
    rows = min(map(len, tables.values()))
    if rows == 0:
        raise ResultError(f"{folder}: the run has no rows yet; run the deck again: msahl run")
    tables = {name: table.iloc[:rows] for name, table in tables.items()}
    return Run(
        folder=folder,
        model=model,
        info=read_info(folder),
        states=tables["states.csv"],
        reactions=tables.get("reactions.csv"),
        work=tables.get("work.csv"),
        partial=find_table(folder, STATES) == folder / (STATES + PART),
    )


def find_table(folder: Path, name: str) -> Path | None:
    """Path of the table ``name``, whole or ``.part``; ``None`` if there is neither."""
    return find(folder, name)


def read_table(path: Path) -> pd.DataFrame:
    """A CSV table of numbers, every double as it was written.

    Of a table under way (``.part``) a last row cut short is left out: a number may be cut, too.
    """
    try:
        text = path.read_bytes().decode()
        if path.suffix == PART:
            text = text[: text.rfind("\n") + 1]
        header, _, rows = text.partition("\n")
        columns = header.rstrip("\r").split(",")
        # numpy reads a decimal as the nearest double; pandas does so in some versions only.
        numbers = np.empty((0, len(columns)))
        if rows.strip():
            numbers = np.loadtxt(io.StringIO(rows), delimiter=",", ndmin=2)
        return pd.DataFrame(numbers, columns=columns)
    except (ValueError, OSError) as error:
        raise ResultError(f"{path}: not a table of numbers: {error}") from error


def _table(folder: Path, name: str, columns: list[str]) -> pd.DataFrame:
    """The table ``name``, whole or partial; its columns must be those of the deck."""
    path = find_table(folder, name)
    if path is None:
        raise ResultError(f"{folder / name}: missing; run the deck again: msahl run")
    table = read_table(path)
    if list(table.columns) != columns:
        raise ResultError(f"{path}: its columns are not those of {folder / 'deck.xml'}")
    return table


def read_info(folder: Path) -> dict[str, Any]:
    """What ``run.json`` says: nothing if the run was cut off by force. Raises ``ResultError``."""
    path = find(folder, INFO)
    if path is None or path.name != INFO:
        return {}
    try:
        return dict(json.loads(path.read_text()))
    except ValueError as error:
        raise ResultError(f"{path}: not JSON: {error}") from error
