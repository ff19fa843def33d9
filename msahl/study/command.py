"""Runs of a study as command lines, and what they take from start to end."""

import os
import shlex
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from msahl.results.read import ResultError, read_run
from msahl.study.errors import state_figures
from msahl.study.plan import Plan
from msahl.study.reference import Reference
from msahl.study.runs import Case, variant
from msahl.study.study import Command

ENTRY = "from msahl.cli.main import main; main()"


def words_of(case: Case, plan: Plan, deck: str, t_final: float | None = None) -> list[str]:
    """The arguments of ``msahl`` that make the run of a ``case``; ``t_final`` if it is not the
    deck's.
    """
    words = ["run", deck, "--scheme", case.scheme]
    if case.chooses:
        interval = variant(plan.model, case).simulation.output_interval
        words += ["--tolerance", f"{case.size:.15g}", "--output-interval", f"{interval:.15g}"]
    else:
        words += ["--dt", f"{case.size:.15g}"]
    return words if t_final is None else [*words, "--t-final", f"{t_final:.15g}"]


def shown(words: list[str]) -> str:
    """The words as a reader types them."""
    return shlex.join(["msahl", *words])


def carry_out(
    words: list[str], case: Case, plan: Plan, reference: Reference, seconds: float
) -> Command | None:
    """Make the run of these ``words`` by a process of its own; None if it takes more than so many
    ``seconds`` or leaves no complete results.
    """
    with TemporaryDirectory(prefix="msahl-study-") as folder:
        out = Path(folder) / "run"
        line = [sys.executable, "-c", ENTRY, *words, "-q", "-o", str(out)]
        began = time.perf_counter()
        try:
            subprocess.run(
                line, capture_output=True, timeout=max(seconds, 0.1), env=os.environ, check=False
            )
            whole = time.perf_counter() - began
            run = read_run(out)
        except (subprocess.TimeoutExpired, ResultError, OSError):
            return None
        if run.partial:
            return None
        spread = state_figures(run, reference).figures.get(plan.measure)
        loop = float(run.info.get("seconds", {}).get("loop", float("nan")))
        return Command(shown(words), whole, loop, spread.max if spread else None)
