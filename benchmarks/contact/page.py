"""Write the page on scenes with contact from what is stored."""

import math
from pathlib import Path

from benchmarks.contact.codes import KEPT
from benchmarks.contact.creep import load as load_creep
from benchmarks.contact.peers import MISSING, PEERS
from benchmarks.contact.scenes import ABOUT
from benchmarks.curves import TARGETS, Curve
from benchmarks.mechanisms.page import (
    OTHERS,
    at_least,
    cell,
    in_milliseconds,
    lost,
    missing,
    reasons_of,
    settings_of,
)
from benchmarks.mechanisms.pictures import draw_problems
from benchmarks.mechanisms.store import microseconds, refusals
from benchmarks.precision_asked import OURS, Found
from benchmarks.verdict import Verdict, table_of_verdicts

PAGE, PICTURE, MACHINE = "contact.md", "contact.png", "contact_machine.txt"
COARSE, FINE = 1e-3, 1e-6
"""Errors [m] at which msahl is to be ahead where others reach them, and to be alone."""
LIMITS = (1e-16, 10.0)
"""Errors shown [m]."""
INTRODUCTION = (
    "Scenes with contact: processor seconds of the time loop, without start-up, compiling and "
    "building the model, until the largest position error of any mass centre at the output times "
    "is 1e-3, 1e-6 and 1e-9 m. Seconds are medians of runs taken in turn, of the processor, as "
    "other programs used the machine. How to read the columns: "
    "[Benchmarks](../README.md#how-to-read-resultscontactmd)."
)
WHY = """\
Why:

- An event of msahl takes some milliseconds, whatever the step: contacts open and close in Python,
  one linear system each for the velocities, the impulses and the accelerations. MuJoCo, Drake and
  Exudyn have no events. A scene with one body and a few impacts is a fraction of a millisecond of
  their steps, so an error of 1e-3 m is theirs wherever their contact law reaches it.
- Their contacts are springs and dampers. Error falls with the duration of a contact, so with the
  step, by order 1: each further digit takes ten times as long. An impact that begins between two
  steps scatters, which is why their curves are not smooth."""


def write_page(found: list[Found], machine: list[str], folder: Path) -> None:
    """Write page and picture; an empty ``machine`` keeps what is known of it."""
    if machine:
        (folder / MACHINE).write_text("\n".join(f"- {line}" for line in machine) + "\n")
    draw_problems(found, folder / PICTURE, LIMITS)
    (folder / PAGE).write_text(report(found, folder))


def report(found: list[Found], folder: Path) -> str:
    """Return the page's text."""
    parts = [
        "# Contact",
        INTRODUCTION,
        (folder / MACHINE).read_text().strip(),
        missing(found, ABOUT),
        *(f"## The fastest code of each program, {t:.0e} m\n\n{_summary(found, t)}"
          for t in (COARSE, FINE)),
        f"## The smallest error of each program\n\n{_smallest(found)}",
        f"![error against time]({PICTURE})",
        f"## Asked and measured\n\n{table_of_verdicts(verdicts(found))}",
        f"## Where another program is faster\n\n{lost(found)}\n\n{WHY}",
        f"## Creep on the slope\n\n{_creep(folder)}",
        *(_section(one, folder) for one in found),
        f"## Codes and settings\n\n{_settings()}",
    ]  # fmt: skip
    return "\n\n".join(part for part in parts if part) + "\n"


def _rows(found: list[Found], cells: dict[str, list[str]]) -> str:
    programs = (OURS, *OTHERS)
    lines = [f"| scene | {' | '.join(programs)} |", "|---|" + "---|" * len(programs)]
    lines += [f"| {one.problem.name} | {' | '.join(cells[one.problem.name])} |" for one in found]
    return "\n".join(lines)


def _summary(found: list[Found], target: float) -> str:
    programs = (OURS, *OTHERS)
    cells = {
        one.problem.name: [one.best_cell(p, target, in_milliseconds) for p in programs]
        for one in found
    }
    return _rows(found, cells)


def _smallest(found: list[Found]) -> str:
    programs = (OURS, *OTHERS)
    return _rows(found, {one.problem.name: [_least(one, p) for p in programs] for one in found})


def _least(found: Found, program: str) -> str:
    """The smallest error of any run of a program, its seconds and its code."""
    points = [
        (point.error, point.seconds, curve.code.name)
        for curve in found.curves
        if curve.code.name.startswith(program)
        for point in curve.sorted()
        if math.isfinite(point.error)
    ]
    if not points:
        return "-"
    error, seconds, code = min(points)
    return f"{error:.1e} m in {1e3 * seconds:.3g} ms ({code.removeprefix(program).strip()})"


def reaches(found: Found, program: str, target: float) -> bool:
    """Whether a run of a program has an error of at most ``target`` [m]."""
    curves = [curve for curve in found.curves if curve.code.name.startswith(program)]
    return any(curve.at(target) is not None for curve in curves)


def verdicts(found: list[Found]) -> list[Verdict]:
    """Return what was asked beside what was measured."""
    made = [v for one in found for program in OTHERS if (v := _ahead(one, program)) is not None]
    for one in found:
        others = [program for program in OTHERS if reaches(one, program, FINE)]
        text = f"reached by {', '.join(others)} as well" if others else "alone"
        alone = reaches(one, OURS, FINE) and not others
        what = f"{one.problem.name}, {FINE:.0e} m"
        made.append(Verdict(what, "msahl alone", text, alone))
    return made


def _ahead(found: Found, program: str) -> Verdict | None:
    """Return how the seconds to the coarse error compare, None where it is not reached."""
    if not reaches(found, program, COARSE):
        return None
    peer, ours = found.best(program, COARSE), found.best(OURS, COARSE)
    assert peer is not None
    what = f"{found.problem.name}, {COARSE:.0e} m: {program} / msahl"
    if ours is None:
        return Verdict(what, ">= 1", "msahl does not reach it", False)
    ratio = at_least(peer[1]) / ours[1].seconds
    bound = "at least " if ours[1].how == "<=" else ""
    return Verdict(what, ">= 1", f"{bound}{ratio:.2g} ({peer[0]} / {ours[0]})", ratio >= 1.0)


def _creep(folder: Path) -> str:
    """The box should not move: the speed over the last 5 s of each code's most accurate run."""
    found = load_creep(folder)
    if not found:
        return "Not measured yet."
    lines = ["| code | step [s] or accuracy | creep [µm/s] |", "|---|---|---|"]
    lines += [f"| {one.code} | {one.knob:.3g} | {1e6 * one.speed:.2g} |" for one in found]
    about = "Speed over the last 5 s of the most accurate run of each code; it should be zero."
    return "\n".join([about, "", *lines])


def _section(found: Found, folder: Path) -> str:
    name = found.problem.name
    parts = [
        f"## {name[0].upper()}{name[1:]}",
        ABOUT[name],
        f"Reference: {found.known.words}, {found.known.apart:.1e} m apart.",
        _table(found.curves),
        reasons_of(refusals(found.problem, folder, KEPT)),
    ]
    return "\n\n".join(part for part in parts if part)


def _table(curves: list[Curve]) -> str:
    heads = [f"{target:.0e} m [ms]" for target in TARGETS]
    lines = [
        f"| code | {' | '.join(heads)} | smallest error [m] | µs/step | remark |",
        "|---|" + "---|" * (len(heads) + 3),
    ]
    for curve in curves:
        finite = [point for point in curve.sorted() if math.isfinite(point.error)]
        cells = [cell(curve.reach(target)) for target in TARGETS]
        if finite:
            best = min(finite, key=lambda point: point.error)
            cells += [f"{best.error:.1e}", f"{microseconds(best):.3g}", curve.stopped]
        else:
            notes = dict.fromkeys(p.note for p in curve.sorted() if p.note)
            cells += ["-", "-", "; ".join([*notes][:1]) or curve.stopped]
        lines.append(f"| {curve.code.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _settings() -> str:
    ours = (
        "- **msahl**: `--solver newton`, rigid contacts, each scheme by its name, its defaults, "
        "fixed steps; *by tolerance*: the scheme `auto`, with a tolerance of the sum of local "
        "errors."
    )
    return "\n".join([ours, *settings_of(PEERS, MISSING)])
