"""Verdicts of many runs as a table: those of their ``run.json``, if their tables bear them out."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from msahl.deck import DeckError
from msahl.post.table import Cell, Column, Table
from msahl.printable import shown_path
from msahl.results.read import ResultError, find_table, read_info, read_run
from msahl.run.verdict import FAIL

COLUMNS = (
    Column("run", "run"),
    Column("verdict", "verdict"),
    Column("t", "t [s]", form="g"),
    Column("steps", "steps", form="d"),
    Column("energy", "energy error", form=".1e"),
    Column("gap", "gap [m]", form=".1e"),
    Column("error", "error [m]", form=".1e"),
    Column("trusted", "trusted to [s]", form="g", missing=""),
    Column("reasons", "reasons"),
)


class Judged(NamedTuple):
    """A run and what its ``run.json`` says."""

    folder: Path
    word: str
    reasons: list[str]
    info: dict[str, Any]


def read_judged(folder: Path) -> Judged:
    """The verdict on the run in ``folder``; one that was cut off by force has failed, and so has
    one whose tables are not as it left them.

    Raises ``ResultError`` if there is no run, or one of a program without verdicts.
    """
    info = read_info(folder)
    if not info and find_table(folder, "states.csv"):
        reason = "no run.json: the run was cut off by force; run the deck again"
        return Judged(folder, FAIL, [reason], info)
    if "verdict" not in info:
        raise ResultError(f"{shown_path(folder)}: no verdict in run.json; make one: msahl run")
    word, reasons = info["verdict"]["word"], info["verdict"]["reasons"]
    if word != FAIL:
        try:
            read_run(folder)
        except (ResultError, DeckError) as error:
            return Judged(folder, FAIL, [str(error).replace("\n", "; ")], info)
    return Judged(folder, word, reasons, info)


def verdict_table(runs: Sequence[Judged]) -> Table:
    """One row a run."""
    return Table(COLUMNS, tuple(map(_row, runs)))


def _row(run: Judged) -> tuple[Cell, ...]:
    extremes = run.info.get("extremes", {})
    error = run.info.get("error") or {}
    known = [error[name] for name in ("position", "orientation") if name in error]
    return (
        str(run.folder),
        run.word,
        run.info.get("time"),
        run.info.get("steps"),
        extremes.get("energyErrorMaxRelative"),
        extremes.get("constraintViolationMax"),
        max(known, default=None),
        error.get("trustHorizon"),
        "; ".join(run.reasons),
    )
