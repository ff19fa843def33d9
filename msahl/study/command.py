"""Write the runs of a study as command lines, and run and time these commands."""

import os
import shlex
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from msahl.records import record
from msahl.results.read import ResultError, read_run
from msahl.run.options import command_words
from msahl.study.errors import compute_state_errors
from msahl.study.plan import Plan
from msahl.study.reference import Reference
from msahl.study.runs import Case, with_case

ENTRY = "from msahl.cli.start import main; main()"


@record(slots=False)
class Command:
    """A run by the command ``line``: seconds of the complete command and of its time loop, and the
    largest error of the studied metric.
    """

    line: str
    seconds: float
    loop: float
    error: float | None


def command_arguments(
    case: Case, plan: Plan, deck: str, t_final: float | None = None, settings: Sequence[str] = ()
) -> list[str]:
    """Return the arguments of ``msahl`` for the run of a ``case``; ``t_final`` only if it is not
    the deck's, and ``settings`` are numbers of the deck that are changed.
    """
    given: dict[str, Any] = {"scheme": case.scheme, "t_final": t_final}
    if case.chooses_steps:
        interval = with_case(plan.model, case).simulation.output_interval
        given |= {"tolerance": case.size, "output_interval": interval}
    else:
        given["dt"] = case.size
    changes = [word for setting in settings for word in ("--set", setting)]
    return ["run", deck, *changes, *command_words(given)]


def command_line(arguments: list[str]) -> str:
    """Return the command as it is typed in a shell."""
    return shlex.join(["msahl", *arguments])


def run_command(
    arguments: list[str], case: Case, plan: Plan, reference: Reference, seconds: float
) -> Command | None:
    """Run the command in a process of its own; return None if it takes more than ``seconds`` or
    leaves no complete results.
    """
    with TemporaryDirectory(prefix="msahl-study-") as folder:
        out = Path(folder) / "run"
        process = [sys.executable, "-c", ENTRY, *arguments, "-q", "-o", str(out)]
        began = time.perf_counter()
        try:
            subprocess.run(
                process, capture_output=True, timeout=max(seconds, 0.1), env=os.environ, check=False
            )
            total = time.perf_counter() - began
            run = read_run(out)
        except (subprocess.TimeoutExpired, ResultError, OSError):
            return None
        if run.partial:
            return None
        statistics = compute_state_errors(run, reference).statistics.get(plan.metric)
        loop = float(run.info.get("seconds", {}).get("loop", float("nan")))
        error = statistics.max if statistics else None
        return Command(command_line(arguments), total, loop, error)
