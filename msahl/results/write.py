"""Results on disk: tables that grow row by row and appear whole, and ``run.json``.

A table is written as NAME.part and takes its name when the run has ended well; what is there under
a final name is therefore complete. Numbers are the shortest decimals that read back to the same
double.
"""

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
import orjson

from msahl.model import Model
from msahl.system.names import reaction_columns, state_columns, work_columns, workers

PART = ".part"


class Table:
    """One CSV file under way."""

    def __init__(self, path: Path, columns: list[str]) -> None:
        self.path = path
        self.file = path.with_name(path.name + PART).open("wb")
        self.file.write((",".join(columns) + "\n").encode())

    def write(self, rows: np.ndarray) -> None:
        """Append ``rows`` (m, columns) of finite numbers."""
        text = orjson.dumps(np.ascontiguousarray(rows), option=orjson.OPT_SERIALIZE_NUMPY)
        # A JSON array of arrays is CSV but for its brackets.
        self.file.write(text[2:-2].replace(b"],[", b"\n") + b"\n")
        self.file.flush()

    def close(self, whole: bool) -> None:
        """End the file; give it its name if it is ``whole``."""
        self.file.close()
        if whole:
            Path(self.file.name).replace(self.path)


class RunFolder:
    """The folder of one run; a context that leaves its tables ``.part`` unless told ``whole``."""

    def __init__(self, folder: Path, model: Model, deck: bytes) -> None:
        self.folder = folder
        self.whole = False
        folder.mkdir(parents=True, exist_ok=True)
        _clear(folder)
        write_whole(folder / "deck.xml", deck)
        self.states = Table(folder / "states.csv", state_columns(model))
        self.reactions = self._table(
            "reactions.csv",
            reaction_columns(model),
            bool(model.joints or model.couplings or model.motions),
        )
        self.work = self._table("work.csv", work_columns(model), bool(workers(model)))

    def _table(self, name: str, columns: list[str], needed: bool) -> Table | None:
        return Table(self.folder / name, columns) if needed else None

    def write(self, states: np.ndarray, reactions: np.ndarray, work: np.ndarray) -> None:
        """Append rows to every table the scene has."""
        for table, rows in ((self.states, states), (self.reactions, reactions), (self.work, work)):
            if table is not None:
                table.write(rows)

    def __enter__(self) -> "RunFolder":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        for table in (self.states, self.reactions, self.work):
            if table is not None:
                table.close(self.whole and kind is None)


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write ``content`` whole, indented, to ``path``."""
    write_whole(path, orjson.dumps(content, option=orjson.OPT_INDENT_2 | orjson.OPT_APPEND_NEWLINE))


def write_whole(path: Path, content: bytes) -> None:
    """Write a file that is never seen half-written."""
    part = path.with_name(path.name + PART)
    part.write_bytes(content)
    part.replace(path)


def _clear(folder: Path) -> None:
    """Remove what an earlier run left, so that no file is taken for the new run's."""
    for name in ("states.csv", "reactions.csv", "work.csv", "run.json"):
        (folder / name).unlink(missing_ok=True)
        (folder / (name + PART)).unlink(missing_ok=True)
