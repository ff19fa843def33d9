"""Tabulate the verdicts of many runs: those of ``run.json``, if the tables are still intact."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from msahl.deck import DeckError
from msahl.post.table import Cell, Column, Table
from msahl.printable import shown_path
from msahl.results.folder import find
from msahl.results.read import ResultError, read_info, read_run
from msahl.run.verdict import FAIL

COLUMNS = (
    Column("run", "run"),
    Column("verdict", "verdict"),
    Column("t", "t [s]", form="g"),
    Column("steps", "steps", form="d"),
    Column("energy_error", "relative energy error", form=".1e"),
    Column("constraint_violation", "constraint violation [m]", form=".1e"),
    Column("position_error", "position error [m]", form=".1e"),
    Column("trusted", "trusted to [s]", form="g", missing=""),
    Column("reasons", "reasons"),
)


class RunVerdict(NamedTuple):
    """The verdict on the run in ``folder``, its reasons, and what ``run.json`` holds."""

    folder: Path
    word: str
    reasons: list[str]
    info: dict[str, Any]


def read_verdict(folder: Path) -> RunVerdict:
    """Read the verdict on the run in ``folder``. It is FAIL for a run that was killed, and for a
    run whose tables were damaged afterwards.

    Raises ``ResultError`` if there is no run, or its program version wrote no verdicts.
    """
    info = read_info(folder)
    if not info and find(folder, "states.csv"):
        reason = "no run.json: the run was killed; run the deck again"
        return RunVerdict(folder, FAIL, [reason], info)
    if "verdict" not in info:
        raise ResultError(f"{shown_path(folder)}: no verdict in run.json; run the deck: msahl run")
    verdict = info["verdict"]
    if verdict["word"] != FAIL:
        try:
            verdict = read_run(folder).info["verdict"]
        except (ResultError, DeckError) as error:
            return RunVerdict(folder, FAIL, [str(error).replace("\n", "; ")], info)
    return RunVerdict(folder, verdict["word"], verdict["reasons"], info)


def verdict_table(runs: Sequence[RunVerdict]) -> Table:
    """Return a table with one line per run."""
    return Table(COLUMNS, tuple(map(_cells, runs)))


def _cells(run: RunVerdict) -> tuple[Cell, ...]:
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
