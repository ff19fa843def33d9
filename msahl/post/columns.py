"""Find columns of a run's tables by patterns."""

from collections.abc import Iterable, Iterator, Sequence
from fnmatch import fnmatchcase

import numpy as np
import pandas as pd

from msahl.model import Model
from msahl.printable import shown_path
from msahl.results.read import ResultError, Run
from msahl.results.write import DRIVES
from msahl.run.column_units import TIME, Quantity, quantity
from msahl.run.hidden_bodies import shown_tables
from msahl.run.tables import ERROR, REACTIONS, STATES, WORK


def tables(run: Run) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield name and content of every table of a run."""
    shown = run.states[shown_tables(run.model)[STATES]] if run.model.hidden else run.states
    parts = {STATES: shown, REACTIONS: run.reactions, WORK: run.work, ERROR: run.errors}
    for name, table in {**parts, **run.others, DRIVES: run.drives}.items():
        if table is not None:
            yield name, table


def all_columns(run: Run) -> list[str]:
    """Return the columns of all tables of a run but the time, each once."""
    names = (str(column) for _, table in tables(run) for column in table.columns)
    return [name for name in dict.fromkeys(names) if name != TIME]


def matching(run: Run, patterns: Sequence[str]) -> list[str]:
    """Return the columns that match one of the patterns (``*``, ``?``, ``[...]``; commas separate
    patterns), in the order of the patterns.

    Raises ``ResultError`` for a pattern that no column matches.
    """
    columns, found = all_columns(run), dict[str, None]()
    for pattern in (part.strip() for given in patterns for part in given.split(",")):
        chosen = [c for c in columns if c == pattern] or [
            c for c in columns if fnmatchcase(c, pattern)
        ]
        if not chosen:
            raise ResultError(
                f"{shown_path(run.folder)}: no column matches '{pattern}'; {_examples(columns)}"
            )
        found.update(dict.fromkeys(chosen))
    return list(found)


def _examples(columns: Sequence[str]) -> str:
    """Say which names there are: all for few, else those before the point."""
    if len(columns) <= 12:
        return f"it has: {', '.join(columns)}"
    names = list(dict.fromkeys(column.rpartition(".")[0] or column for column in columns))
    more = f" and {len(names) - 12} more" if len(names) > 12 else ""
    return f"its columns are of: {', '.join(names[:12])}{more}"


def series(run: Run, column: str) -> tuple[np.ndarray, np.ndarray]:
    """Return times [s] and values (m,) of a column of any table.

    Raises ``ResultError`` if there is none.
    """
    if column == TIME:
        return run.time, run.time
    for _, table in tables(run):
        if column in table.columns:
            return table[TIME].to_numpy(), table[column].to_numpy()
    raise ResultError(
        f"{shown_path(run.folder)}: no column '{column}'; {_examples(all_columns(run))}"
    )


def grouped(columns: Iterable[str], model: Model) -> dict[Quantity, list[str]]:
    """Return columns by their quantity, in the order in which the quantities first appear."""
    groups: dict[Quantity, list[str]] = {}
    for column in columns:
        groups.setdefault(quantity(column, model), []).append(column)
    return groups
