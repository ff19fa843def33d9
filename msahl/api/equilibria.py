"""Equilibria of models for Python."""

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.analysis.equilibria.begin import deck_at
from msahl.analysis.equilibria.equilibrium import Solution, search_start
from msahl.analysis.equilibria.search import all_equilibria, find
from msahl.analysis.equilibria.slipping import none_found
from msahl.analysis.equilibria.stability import stability
from msahl.analysis.equilibria.tables import tables
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.steady import residual_in_words
from msahl.api.html import html_table
from msahl.deck import ParsedDeck, Source
from msahl.results.info import NoColumnError, ResultError
from msahl.results.job import Job
from msahl.start.velocities import StartError

if TYPE_CHECKING:
    import pandas as pd

Load = Callable[[ParsedDeck], Any]
"""What makes a ``Model`` of a deck."""


class Equilibrium:
    """A place at which all forces are balanced.

    ``residual`` is the largest force that is not balanced [N], ``relative`` that over the largest
    force; ``method`` and ``iterations`` say how it was found.
    """

    def __init__(self, job: Job, start: Point, solution: Solution, load: Load) -> None:
        """``solution`` was found from the ``start`` of a ``job``'s model; ``load`` makes models."""
        self._job, self._start, self._solution, self._load = job, start, solution, load
        self.residual = solution.place.balance.residual
        self.relative = solution.place.balance.relative
        self.method, self.iterations = solution.method, solution.iterations

    @cached_property
    def stability(self) -> str:
        """Whether it is stable, in words: begins with ``stable`` or ``unstable``."""
        return stability(self._solution.place.point)

    @cached_property
    def _tables(self) -> dict[str, tuple[list[str], np.ndarray]]:
        return tables([self._solution])

    @property
    def tables(self) -> list[str]:
        """Names of the tables: those of a run without time, and ``loads``."""
        return list(self._tables)

    def frame(self, table: str) -> "pd.DataFrame":
        """Return a table as a pandas frame with one row."""
        import pandas as pd

        if not isinstance(table, str) or table not in self._tables:
            raise ResultError(f"there is no table {table!r}; it has {', '.join(self._tables)}")
        columns, rows = self._tables[table]
        return pd.DataFrame(rows[:, 1:], columns=columns[1:])

    def __getitem__(self, column: str) -> float:
        """Return the value of a column of any table, such as ``"Rod.z"`` or ``"Spring.load"``."""
        for columns, rows in self._tables.values():
            if column in columns[1:]:
                return float(rows[0, columns.index(column)])
        raise NoColumnError(
            f"no table has a column {column!r}; the tables are {', '.join(self._tables)}"
        )

    @cached_property
    def xml(self) -> bytes:
        """The deck that begins here. Raises ``StartError`` if a deck cannot say so."""
        return deck_at(self._start, self._solution)

    @property
    def model(self) -> Any:
        """The model that begins here, a ``Model``."""
        return self._load(ParsedDeck(Source(self._job.source.path, self.xml)))

    def _residual(self) -> str:
        return residual_in_words(self.residual, self.relative)

    def __repr__(self) -> str:
        return f"<Equilibrium: {self.stability}; residual {self._residual()}>"

    def _repr_html_(self) -> str:
        """Return a short table for a notebook."""
        found: dict[str, Any] = {
            "stability": self.stability,
            "residual": self._residual(),
            "found by": f"{self.method}, {self.iterations} iterations",
            "tables": ", ".join(self.tables),
        }
        return html_table(self._job.model.simulation.title or "equilibrium", found)


def equilibrium_of(job: Job, rotation: Sequence[float], load: Load) -> Equilibrium:
    """Return the equilibrium to which the model of a ``job`` leads; raises ``StartError``."""
    start = search_start(job.model)
    found = find(start, np.array(rotation, dtype=float))
    if found is None:
        otherwise = (
            "from where the deck has the bodies; place them nearer to one, or search from more "
            "configurations by equilibria(starts=...)"
        )
        raise StartError(none_found(start, otherwise))
    return Equilibrium(job, start, found, load)


def equilibria_of(
    job: Job, starts: int, rotation: Sequence[float], load: Load
) -> list[Equilibrium]:
    """Return all equilibria that are found from ``starts`` configurations."""
    start = search_start(job.model)
    found = all_equilibria(start, np.array(rotation, dtype=float), starts)
    return [Equilibrium(job, start, solution, load) for solution in found]
