"""Write the page on the mechanisms from what is stored."""

from collections.abc import Iterable
from pathlib import Path
from types import ModuleType

from benchmarks.curves import TARGETS, Curve, Reached
from benchmarks.mechanisms.peers import MISSING, PEERS
from benchmarks.mechanisms.pictures import draw_problems
from benchmarks.mechanisms.problems import ABOUT
from benchmarks.mechanisms.store import microseconds, refusals
from benchmarks.precision_asked import OURS, Found
from benchmarks.verdict import Verdict, table_of_verdicts

PAGE, PICTURE, MACHINE = "mechanisms.md", "mechanisms.png", "mechanisms_machine.txt"
JUDGED = 1e-6
"""Error [m] at which ratios are asked for."""
AHEAD_OF_EXUDYN = 20.0
NOT_SLOWER = 7
"""Mechanisms on which neither MuJoCo nor Drake is to be faster."""
RUNG = 1.5
"""Ratio of neighbouring steps of a ladder."""
OTHERS = ("exudyn", "mujoco", "drake")
BOUNDS = {"<=": "≤ ", ">=": "> ", "": ""}


WHY = """\
Why:

- An error of 1e-3 m takes a few dozen steps. A step of MuJoCo's RK4 evaluates four accelerations
  of few coordinates, without iterations; a step of gauss evaluates all its nodes three to ten
  times, the loads of elements one node after the other.
- The robot is an open tree of few coordinates for all programs. Its dampers are stiff for the small
  wrist, so long steps of gauss are solved in redundant coordinates, 66 unknowns. Its motion is
  smooth: explicit formulas of order 4 to 6 need few steps.
- The suspension and the squeezer are trees of few coordinates in MuJoCo, too, with two and three
  loops, and move smoothly.
- The net has more equations of loops than msahl solves in joint coordinates. All s stages of a
  gauss step are solved at once, and the work of their factorisation grows with the third power of
  s; MuJoCo factors the mass matrix of a tree.
- Where MuJoCo closes loops its constraints are soft, and its motion is of order 2 in the step,
  whatever the integrator. Drake's discrete solver has order 1."""


def write_page(found: list[Found], machine: list[str], folder: Path) -> None:
    """Write page and picture; an empty ``machine`` keeps what is known of it."""
    if machine:
        (folder / MACHINE).write_text("\n".join(f"- {line}" for line in machine) + "\n")
    draw_problems(found, folder / PICTURE)
    (folder / PAGE).write_text(report(found, folder))


def report(found: list[Found], folder: Path) -> str:
    """Return the page's text."""
    parts = [
        "# Mechanisms",
        "Joints other than balls: processor seconds of the time loop, without start-up, "
        "compiling and building the model, until the largest position error of any mass centre "
        "at the output times is 1e-3, 1e-6 and 1e-9 m. How to read the columns: "
        "[Benchmarks](../README.md#how-to-read-resultsmechanismsmd).",
        (folder / MACHINE).read_text().strip(),
        missing(found, ABOUT),
        f"## The fastest code of each program, 1e-6 m\n\n{_summary(found)}",
        f"![error against time]({PICTURE})",
        f"## Asked and measured\n\n{table_of_verdicts(verdicts(found))}",
        f"## Where another program is faster\n\n{lost(found)}\n\n{WHY}",
        *(_section(one, folder) for one in found),
        f"## Codes and settings\n\n{_settings()}",
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def missing(found: list[Found], about: dict[str, str]) -> str:
    """Return which of the problems that are described were not measured."""
    names = [name for name in about if name not in {one.problem.name for one in found}]
    return f"Not measured yet: {', '.join(names)}." if names else ""


def _summary(found: list[Found]) -> str:
    programs = (OURS, *OTHERS)
    lines = [f"| mechanism | {' | '.join(programs)} |", "|---|" + "---|" * len(programs)]
    for one in found:
        cells = [one.best_cell(program, JUDGED, in_milliseconds) for program in programs]
        lines.append(f"| {one.problem.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def milliseconds(reached: Reached) -> str:
    """Return the milliseconds of a run, with what they are a bound of."""
    return "-" if reached.how == "-" else f"{BOUNDS[reached.how]}{1e3 * reached.seconds:.3g}"


def in_milliseconds(reached: Reached) -> str:
    """Return ``milliseconds`` with their unit."""
    return f"{milliseconds(reached)} ms"


def verdicts(found: list[Found]) -> list[Verdict]:
    """Return what was asked beside what was measured."""
    made = [_exudyn(one) for one in found]
    ahead = [one for one in found if _not_slower(one, JUDGED)]
    slower = [one.problem.name for one in found if one not in ahead]
    text = f"{len(ahead)} of {len(found)}" + (f"; slower: {', '.join(slower)}" if slower else "")
    what = f"mechanisms on which neither MuJoCo nor Drake is faster, {JUDGED:.0e} m"
    return [*made, Verdict(what, f">= {NOT_SLOWER}", text, len(ahead) >= NOT_SLOWER)]


def _exudyn(found: Found) -> Verdict:
    peer, ours = found.best("exudyn", JUDGED), found.best(OURS, JUDGED)
    what = f"{found.problem.name}, {JUDGED:.0e} m: Exudyn / msahl"
    if peer is None or ours is None:
        return Verdict(what, f">= {AHEAD_OF_EXUDYN:g}", "not measured", False)
    ratio = at_least(peer[1]) / ours[1].seconds
    bound = "at least " if peer[1].how == ">=" or ours[1].how == "<=" else ""
    text = f"{bound}{ratio:.3g} ({peer[0]} / {ours[0]})"
    return Verdict(what, f">= {AHEAD_OF_EXUDYN:g}", text, ratio >= AHEAD_OF_EXUDYN)


def _not_slower(found: Found, target: float) -> bool:
    ours = found.best(OURS, target)
    peers = [best for name in ("mujoco", "drake") if (best := found.best(name, target))]
    return ours is not None and all(ours[1].seconds <= at_least(peer[1]) for peer in peers)


def at_least(reached: Reached) -> float:
    """Return the least seconds that a peer may need: where its coarsest run that succeeds is better
    than asked, the next coarser step of the ladder failed.
    """
    return reached.seconds / (RUNG if reached.how == "<=" else 1.0)


def lost(found: list[Found]) -> str:
    """Return every problem and error at which another program takes less time."""
    lines = []
    for one in found:
        for target in TARGETS:
            ours = one.best(OURS, target)
            peers = [best for name in OTHERS if (best := one.best(name, target))]
            if ours is None or not peers:
                continue
            code, reached = min(peers, key=lambda best: best[1].seconds)
            if reached.how != ">=" and reached.seconds < ours[1].seconds:
                ratio = ours[1].seconds / reached.seconds
                lines.append(
                    f"- {one.problem.name}, {target:.0e} m: {code} takes {milliseconds(reached)} "
                    f"ms, {ours[0]} {milliseconds(ours[1])} ms: {ratio:.2g} times as long."
                )
    return "\n".join(lines) or "Nowhere."


def _section(found: Found, folder: Path) -> str:
    name = found.problem.name
    parts = [
        f"## {name[0].upper()}{name[1:]}",
        ABOUT[name],
        f"Reference: {found.known.words}, {found.known.apart:.1e} m apart.",
        _table(found.curves),
        reasons_of(refusals(found.problem, folder)),
    ]
    return "\n\n".join(part for part in parts if part)


def reasons_of(refused: dict[str, str]) -> str:
    """Return which codes cannot take a model, by the reason."""
    reasons = {why: [c for c in refused if refused[c] == why] for why in refused.values()}
    return "\n".join(f"- {', '.join(codes)}: {why}." for why, codes in reasons.items())


def _table(curves: Iterable[Curve]) -> str:
    heads = [f"{target:.0e} m [ms]" for target in TARGETS]
    lines = [
        f"| code | {' | '.join(heads)} | µs/step | remark |",
        "|---|" + "---|" * (len(heads) + 2),
    ]
    for curve in curves:
        reached = [curve.reach(target) for target in TARGETS]
        reasons = dict.fromkeys(r.reason for r in reached if r.reason and r.how != "<=")
        near = curve.at(JUDGED) or (curve.sorted()[-1] if curve.points else None)
        cells = [*map(cell, reached), f"{microseconds(near):.3g}", "; ".join(reasons)]
        lines.append(f"| {curve.code.name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def cell(reached: Reached) -> str:
    """Return milliseconds for a table, in parentheses if they are those of an extrapolation."""
    return f"- ({milliseconds(reached)})" if reached.how == ">=" else milliseconds(reached)


def _settings() -> str:
    ours = (
        "- **msahl**: `--solver newton`, each scheme by its name, its defaults, step fixed; "
        "*by tolerance*: the scheme `auto`, with a tolerance of the sum of local errors."
    )
    return "\n".join([ours, *settings_of(PEERS, MISSING)])


def settings_of(peers: dict[str, ModuleType], missing: dict[str, str]) -> list[str]:
    """Return the settings of the other programs, and why some are missing, by package."""
    lines = []
    for package, module in peers.items():
        lines.append(f"- {package} {module.VERSION}:")
        lines += [f"    - **{code}**: {text}." for code, text in module.SETTINGS.items()]
    return [*lines, *(f"- {package} is missing ({why})." for package, why in missing.items())]
