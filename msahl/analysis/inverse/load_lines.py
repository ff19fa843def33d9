"""Inverse dynamics in words: what is given, and a table of the drives' loads."""

import numpy as np

from msahl.analysis.inverse.run_tables import integrated
from msahl.analysis.inverse.solution import Solution
from msahl.analysis.inverse.verdict import MOST_NAMED
from msahl.run.verdict import Verdict


def lines(solution: Solution, shown_verdict: Verdict) -> list[str]:
    """Return the report on the loads."""
    motion, model = solution.motion, solution.model
    d, k = solution.degrees_of_freedom, len(solution.drives)
    redundant = f", {solution.redundant} redundant constraint equations"
    return [
        f"{model.simulation.title or 'model'}: loads of the motion in {motion.source}, "
        f"{motion.time.size} times to {motion.time[-1]:.6g} s",
        f"{d} {'degree' if d == 1 else 'degrees'} of freedom, {k} drive{'' if k == 1 else 's'}"
        f"{redundant if solution.redundant else ''}",
        f"given: {_given(solution)}",
        "",
        *_table(solution),
        "",
        *(f"{finding.word}: {finding.text}" for finding in shown_verdict.findings),
    ]


def _given(solution: Solution) -> str:
    """Return what the table gives, and how its derivatives are obtained."""
    tracks = solution.motion.tracks
    names = [track.name for track in tracks]
    bodies = len(solution.model.bodies)
    if len(names) == 4 * bodies and all(track.kind == "body" for track in tracks):
        names = [f"positions and orientations of all bodies ({bodies})"]
    shown = ", ".join(names[:MOST_NAMED])
    more = len(names) - MOST_NAMED
    shown += f" and {more} more" if more > 0 else ""
    if solution.noise > 0.0:
        return f"{shown}; smoothed by splines of degree 5, noise {solution.noise:g} m or rad"
    second = solution.motion.has_accelerations
    first = all(track.rates is not None for track in tracks)
    with_them = "rates and accelerations" if second else "rates" if first else ""
    text = f"{shown}, with {with_them}" if with_them else shown
    return text if second else f"{text}; splines of degree 5"


def _table(solution: Solution) -> list[str]:
    """Return the lines of the table of drives."""
    rows, time = solution.rows, solution.motion.time
    cells = [
        ["drive", "unit", "largest load", "at [s]", "error bar", "power [W]", "work [J]", "unique"]
    ]
    work = integrated(time, rows.power)
    for k, drive in enumerate(solution.drives):
        at = int(np.argmax(np.abs(rows.loads[:, k])))
        power = rows.power[int(np.argmax(np.abs(rows.power[:, k]))), k]
        cells.append([
            *(drive.name, drive.unit, f"{rows.loads[at, k]:.7g}", f"{time[at]:.4g}"),
            *(f"{rows.error[:, k].max():.1e}", f"{power:.5g}", f"{work[-1, k]:.6g}"),
            "yes" if solution.unique[k] else "no",
        ])  # fmt: skip
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if i < 2 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        for line in cells
    ]
