"""Modes of models for Python: at one configuration, and over a parameter."""

from collections.abc import Callable, Sequence
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from msahl.analysis.equilibria.at import point_at
from msahl.analysis.linearised.point import Point
from msahl.analysis.modes.campbell import (
    COLUMNS,
    CRITICAL_COLUMNS,
    Campbell,
    campbell_rows,
    critical_rows,
)
from msahl.analysis.modes.campbell import campbell as modes_over
from msahl.analysis.modes.files import Over, orders_of, write_campbell, write_modes
from msahl.analysis.modes.following import Request
from msahl.analysis.modes.mode_lines import report
from msahl.analysis.modes.solution import COLUMNS as MODE_COLUMNS
from msahl.analysis.modes.solution import Modes as Found
from msahl.analysis.modes.solution import mode_rows, shape_columns, shape_parts
from msahl.analysis.modes.solution import modes as modes_at
from msahl.api.arguments import require
from msahl.api.html import html_table
from msahl.model import Model as Records
from msahl.run.options import Integer, path_of

if TYPE_CHECKING:
    import pandas as pd


class Modes:
    """Modes of a model: rows as in ``modes.csv``, those that are zero first.

    ``eigenvalues`` (m,) complex [1/s], ``frequency`` (m,) [Hz], ``damping``, ``condition`` and
    ``error`` (m,) [1/s]; ``zeros`` of them are zero, with ``rigid`` independent shapes.
    ``warnings`` say where the modes are not those of an equilibrium or a steady motion.
    """

    def __init__(self, point: Point, found: Found) -> None:
        """``found`` are the modes at a ``point``."""
        self._point, self._found = point, found
        self.eigenvalues, self.condition, self.error = found.value, found.condition, found.error
        self.frequency, self.damping = found.frequency, found.damping
        self.zeros, self.rigid, self.warnings = found.zeros, found.rigid, found.warnings
        self.degrees_of_freedom, self.redundant = found.degrees_of_freedom, found.redundant

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """``modes.csv`` as a pandas frame."""
        import pandas as pd

        return pd.DataFrame(mode_rows(self._found), columns=list(MODE_COLUMNS))

    def shape(self, mode: int) -> dict[str, complex]:
        """Return the shape of a mode (from 1, as in ``modes.csv``): parts by name, such as
        ``"Frame.y"`` [m] and ``"Fork.rz"`` [rad]; raises ``OptionError`` if there is no such mode.
        """
        found = self._found
        require(mode=(mode, Integer(1, found.value.size)))
        names = [column.removesuffix(".real") for column in shape_columns(self._point)[1::2]]
        parts = shape_parts(self._point, found)[mode - 1]
        return dict(zip(names, parts.tolist(), strict=True))

    def write(self, folder: str | PathLike[str]) -> Path:
        """Write ``modes.csv`` and ``shapes.csv``, as ``msahl modes -o`` does; return the folder."""
        path = path_of(folder)
        write_modes(path, self._point, self._found)
        return path

    def page(self, path: str | PathLike[str]) -> Path:
        """Write a page that shows the modes in motion, and return its path. Raises ``ValueError``
        if no mode moves a body.
        """
        from msahl.post.view import viewer_page
        from msahl.post.view.modes import show_modes
        from msahl.results.write import replace_file

        file = path_of(path)
        page = viewer_page([show_modes(self._point, self._found, file)])
        file.parent.mkdir(parents=True, exist_ok=True)
        replace_file(file, page.encode())
        return file

    def __repr__(self) -> str:
        """Return the lines that ``msahl modes`` prints."""
        return "\n".join(report(self._point, self._found))

    def _repr_html_(self) -> str:
        """Return a short table for a notebook."""
        rows = {
            f"mode {m + 1}": f"{self.frequency[m]:.9g} Hz, damping ratio {self.damping[m]:.5f}"
            for m in range(self.zeros, len(self.frequency))
        }
        title = self._point.model.simulation.title or "modes"
        return html_table(title, {"zeros": str(self.zeros), **rows})


class ModesOver:
    """Modes followed over a parameter: a Campbell diagram.

    ``failures`` are the values without modes, and why.
    """

    def __init__(self, found: Campbell, over: Over, title: str) -> None:
        """``found`` are modes over what is varied."""
        self._found, self._over, self._title = found, over, title
        self.failures: list[tuple[float, str]] = found.failures

    @cached_property
    def frame(self) -> "pd.DataFrame":
        """``campbell.csv`` as a pandas frame: a row for each value and mode."""
        import pandas as pd

        return pd.DataFrame(campbell_rows(self._found), columns=list(COLUMNS))

    @cached_property
    def critical(self) -> "pd.DataFrame":
        """``critical.csv`` as a pandas frame: where a mode begins or ceases to grow (order 0), and
        critical speeds.
        """
        import pandas as pd

        return pd.DataFrame(critical_rows(self._found), columns=list(CRITICAL_COLUMNS))

    def write(self, folder: str | PathLike[str]) -> Path:
        """Write the files of ``msahl modes --over -o``, which ``msahl-post modes`` draws; return
        the folder.
        """
        path = path_of(folder)
        write_campbell(path, self._found, self._over, self._title)
        return path


def modes_of(records: Records, at: float | str, wanted: Request) -> Modes:
    """Return the modes of a model at a time or an equilibrium."""
    point = point_at(records, at)
    return Modes(point, modes_at(point, *wanted))


def modes_of_many(
    records_at: Callable[[float], Records],
    values: Sequence[float],
    over: Over,
    at: float | str,
    wanted: Request,
) -> ModesOver:
    """Return the modes followed over ``values`` of what is varied."""
    over = over._replace(orders=orders_of(over.unit, over.orders))
    title: list[str] = []

    def point_of(value: float) -> Point:
        records = records_at(value)
        title.append(records.simulation.title)
        return point_at(records, at)

    found = modes_over(point_of, values, wanted, over.orders, over.speed or 1.0)
    return ModesOver(found, over, title[0] if title else "")
