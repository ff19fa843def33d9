"""Derivatives of measures by numbers of the deck, asked for by ``msahl run --gradient``."""

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from msahl.analysis.gradients.step_sequence import StepRecord
from msahl.api.derivatives import HEADER, GradientError, Gradients
from msahl.api.gradients import differentiate, make_request, texts_of
from msahl.cli.console import say, stop
from msahl.printable import printable, shown_path
from msahl.results.job import Job
from msahl.results.write import GRADIENTS, replace_file
from msahl.run.report import Report
from msahl.run.tables import MemorySink
from msahl.terminal import echo


class GradientsOfRun:
    """Records what the derivatives need of a run, and computes them at its end."""

    def __init__(self, job: Job, measures: Sequence[str], wrt: Sequence[str]) -> None:
        """Faults of what is asked for end the program."""
        if not measures or not wrt:
            stop("msahl run: --gradient and --wrt belong together, as in --gradient 'Tip.z final' "
                 "--wrt L,m")  # fmt: skip
        try:
            self.request = make_request(job, measures, texts_of(wrt))
        except GradientError as error:
            stop("\n".join(f"msahl run: --{line}" for line in str(error).split("\n")))
        self.deck, self.record = job.source.path, StepRecord()
        self.memory = MemorySink(self.request.tables)
        self.found: Gradients | None = None
        self.faults: list[str] = []

    def compute(self, report: Report) -> None:
        """Compute the derivatives of a run that has ended; say why if there are none."""
        try:
            figures = report.as_json()
            self.found = differentiate(self.request, self.record, figures, self.memory.table)
        except GradientError as error:
            self.faults = str(error).split("\n")
        except KeyboardInterrupt:
            self.faults = ["gradient: stopped before it was complete"]
        report.warnings += self.faults

    def write(self, folder: Path) -> dict[str, Any]:
        """Write ``gradients.csv``; return what ``run.json`` has of it."""
        if self.found is None:
            return {}
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(HEADER)
        for row in self.found.rows():
            writer.writerow([_cell(of) for of in row])
        replace_file(folder / GRADIENTS, text.getvalue().encode())
        return {"gradients": self.found.as_json()}

    def tell(self, quiet: bool) -> None:
        """Print the derivatives and warnings; faults are warnings of the run unless ``quiet``."""
        if self.found is None:
            for fault in self.faults if quiet else ():
                say(f"{shown_path(self.deck)}: {printable(fault)}")
            return
        for remark in self.found.remarks:
            say(f"{shown_path(self.deck)}: WARN: {remark}")
        if not quiet:
            echo("\n".join(lines_of(self.found)))


def lines_of(found: Gradients) -> list[str]:
    """Return a table of the derivatives, in lines."""
    rows = [("measure", "by", "value", "derivative", "error", "unit")]
    for measure, name, value, slope, unit, error in found.rows():
        rows.append((measure, name, _shown(value, 8), _shown(slope, 8), _shown(error, 1), unit))
    widths = [max(len(row[k]) for row in rows) for k in range(6)]
    return [
        "  ".join(
            cell.rjust(width) if 2 <= k <= 4 else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _shown(number: float, digits: int) -> str:
    return f"{number:.{digits}g}" if math.isfinite(number) else "-"


def _cell(of: Any) -> str:
    if isinstance(of, float):
        return repr(of) if math.isfinite(of) else ""
    return str(of)
