"""Write docs/validation/error.md from the cells of ``error``."""

from collections.abc import Iterator, Sequence

import numpy as np

from msahl.post.document import Block, Heading, Items, Paragraph
from msahl.post.table import Cell, Column, Table
from tools.validation.error import (
    CLEAR,
    GLOBAL,
    LOCAL,
    ROUND_OFF,
    SCHEMES,
    TOLERANCES,
    Comparison,
    comparisons,
)
from tools.validation.error import Cell as Run
from tools.validation.error_cases import CASES
from tools.validation.generated import write_generated
from tools.validation.thesis_runs import OUT

LEAST, MOST = 0.3, 10.0
"""Limits of the ratio of estimated and true error."""
NEVER = 0.1
"""Smallest accepted ratio of estimated and true error of a run with verdict PASS."""
SHOWN = 40
"""Largest number of cells outside these limits that are listed."""


def write_page(cells: Sequence[Run]) -> None:
    """Write the page."""
    write_generated(OUT / "error.md", "tools.validation.error", build(cells))


def build(cells: Sequence[Run]) -> Iterator[Block]:
    """Yield the blocks of the page."""
    yield Heading(1, "Error estimates and true errors")
    yield Paragraph(
        f"{len({cell.model for cell in cells})} models, each by {len(SCHEMES)} schemes at three "
        "fixed step sizes and by scheme auto to three tolerances. Every run estimates its own "
        "global error. On this page the estimates are compared with true errors: the largest of "
        "all bodies at all output times, of position [m], of orientation (angle times the body's "
        "length) [m], of velocity [m/s], and of auxiliary states and signals, each over its "
        "largest value. All numbers are in error.csv, the times in error_seconds.csv."
    )
    yield Paragraph(
        "The reference is a solution of equations of motion that share no code with the engine "
        "(tools/validation/reference.py): accelerations by least squares from the constraints' "
        "second derivatives, orientations as quaternions, integrated by scipy's DOP853 at a "
        "relative tolerance of 1e-13 between the breakpoints of the laws. Of machines with "
        "expressions, states and kinks it is a solution of equations by hand "
        "(tools/validation/error_scenes.py), between the times and events at which these change. "
        "Of machines with beams it is that of the same mesh by two other schemes at small steps, "
        "and for positions that of a mesh of four times the elements of degree 4: their errors are "
        "those of steps and mesh together, as in the estimate (tools/validation/error_beams.py). "
        "The floor of an error is the difference from a second solution at 1e-12, whose initial "
        "state is rounded "
        f"differently, but at least {ROUND_OFF:g} of the model's size and the constraint violation "
        f"at the start. A true error below {CLEAR:g} times the floor is not known: such a cell is "
        f"marked, and its estimate is compared with {CLEAR:g} times the floor, as an upper bound "
        "only."
    )
    yield Heading(2, "Summary")
    yield Items(tuple(summary(cells)))
    yield Heading(2, "Fixed steps: estimated over true position error")
    yield Paragraph(
        "At the largest step, a quarter and a sixteenth of it. A point marks an error below the "
        "floor, a dash a run without an estimate, an x a run that did not complete. For bodies "
        "that only rotate the ratio is that of orientation."
    )
    yield fixed_table(cells)
    yield Heading(2, "By tolerance: true error, and cost")
    yield Paragraph(
        "The largest true error of positions and orientations [m] of runs by --tolerance, with the "
        "verdict in parentheses if it is not PASS. Cost: time of all runs and companion runs of "
        "--tolerance over the time of the time loop of --local-tolerance of the same size."
    )
    yield tolerance_table(cells)
    yield Heading(2, "Ratios outside the limits")
    yield Paragraph(f"Ratios below {LEAST:g} or above {MOST:g}, farthest first, at most {SHOWN}.")
    yield outside_table(cells)


def summary(cells: Sequence[Run]) -> Iterator[tuple[str, str]]:
    """Yield the summary of the table."""
    all_of = [c for c in comparisons(cells) if c.cell.kind != LOCAL]
    for quantities in (("position", "orientation"), ("velocity",), ("signal",)):
        found = [c for c in all_of if c.quantity in quantities]
        yield (
            f"Estimated over true {' and '.join(quantities)} error within {LEAST:g} to {MOST:g}",
            _within(found),
        )
        passed = [c for c in found if c.clear and c.cell.verdict == "PASS"]
        least = min(passed, key=lambda c: c.ratio, default=None)
        if least:
            below = sum(c.ratio < NEVER for c in passed)
            yield (
                f"Smallest ratio of {' and '.join(quantities)} with PASS",
                f"{least.ratio:.2g}: {_place(least.cell)}; {below} of {len(passed)} are below "
                f"{NEVER:g}",
            )
    ended = [cell for cell in cells if cell.status != "completed"]
    yield "Runs that did not complete", f"{len(ended)} of {len(cells)}"
    yield from _delivered(cells)


def _within(found: Sequence[Comparison]) -> str:
    clear = [c for c in found if c.clear]
    inside = sum(LEAST <= c.ratio <= MOST for c in clear)
    marked = [c for c in found if not c.clear]
    low = sum(c.ratio <= MOST for c in marked)
    share = 100.0 * inside / max(1, len(clear))
    return (
        f"{inside} of {len(clear)} ({share:.1f} %); at the floor, {low} of {len(marked)} estimates "
        f"are below {MOST:g} times the bound"
    )


def _delivered(cells: Sequence[Run]) -> Iterator[tuple[str, str]]:
    for tolerance in TOLERANCES:
        runs = [c for c in cells if c.kind == GLOBAL and c.tolerance == tolerance]
        possible = [c for c in runs if _bounded(c) is not None and _floor(c) < tolerance]
        kept = [c for c in possible if (_bounded(c) or 0.0) <= tolerance]
        told = [c for c in possible if c not in kept and c.accuracy != "PASS"]
        costs = list(_costs(cells, tolerance).values())
        if not costs:
            continue
        yield (
            f"--tolerance {tolerance:g}",
            f"error of positions and orientations within the tolerance in {len(kept)} of "
            f"{len(possible)} models, beyond it with a warning in {len(told)}; cost over "
            "--local-tolerance: median "
            f"{np.median(costs):.1f}, largest {max(costs):.1f}",
        )


def _bounded(cell: Run) -> float | None:
    """Return the true error that a tolerance bounds [m]; None if the run did not complete."""
    if cell.position is None or cell.orientation is None:
        return None
    return max(cell.position, cell.orientation)


def _floor(cell: Run) -> float:
    return max(cell.position_floor, cell.orientation_floor)


def _costs(cells: Sequence[Run], tolerance: float) -> dict[str, float]:
    """Return seconds by --tolerance over seconds by --local-tolerance, by model."""
    seconds = {
        (c.model, c.kind): c.seconds
        for c in cells
        if c.tolerance == tolerance and c.status == "completed" and c.seconds
    }
    names = {name for name, _ in seconds}
    return {
        name: seconds[name, GLOBAL] / seconds[name, LOCAL]
        for name in names
        if (name, GLOBAL) in seconds and (name, LOCAL) in seconds
    }


def fixed_table(cells: Sequence[Run]) -> Table:
    """Return the table of fixed steps, a line per model and a column per scheme."""
    columns = (Column("model", "model"), *(Column(word, word) for word in SCHEMES))
    rows: list[tuple[Cell, ...]] = []
    for case in CASES:
        own = [c for c in cells if c.model == case.name and c.step is not None]
        by_scheme = [[c for c in own if c.scheme == word] for word in SCHEMES]
        rows.append((case.name, *(" ".join(map(_shown, runs)) for runs in by_scheme)))
    return Table(columns, tuple(rows))


def _shown(cell: Run) -> str:
    if cell.status != "completed":
        return "x"
    found = {c.quantity: c for c in comparisons([cell])}
    if not found:
        return "-"
    quantity = "orientation" if _rests(cell) else "position"
    comparison = found[quantity]
    return f"{comparison.ratio:.2g}" if comparison.clear else "."


def _rests(cell: Run) -> bool:
    """Return whether the bodies' reference points do not move, up to the floor."""
    position, orientation = cell.position or 0.0, cell.orientation or 0.0
    return position <= CLEAR * cell.position_floor and orientation > CLEAR * cell.orientation_floor


def tolerance_table(cells: Sequence[Run]) -> Table:
    """Return the table of true errors and costs by tolerance, a line per model."""
    columns = [Column("model", "model")]
    for tolerance in TOLERANCES:
        columns.append(Column(f"true{tolerance:g}", f"true error at {tolerance:g}"))
        columns.append(Column(f"cost{tolerance:g}", f"cost at {tolerance:g}", form=".1f"))
    costs = {tolerance: _costs(cells, tolerance) for tolerance in TOLERANCES}
    rows: list[tuple[Cell, ...]] = []
    for case in CASES:
        row: list[Cell] = [case.name]
        for tolerance in TOLERANCES:
            own = [c for c in cells if (c.model, c.kind) == (case.name, GLOBAL)]
            row += [_delivered_cell(c) for c in own if c.tolerance == tolerance] or [None]
            row.append(costs[tolerance].get(case.name))
        rows.append(tuple(row))
    return Table(tuple(columns), tuple(rows))


def _delivered_cell(cell: Run) -> str:
    true = _bounded(cell)
    if true is None:
        return "x"
    error = "." if true <= CLEAR * _floor(cell) else f"{true:.1e}"
    return error if cell.verdict == "PASS" else f"{error} ({cell.verdict})"


def outside_table(cells: Sequence[Run]) -> Table:
    """Return the table of ratios outside the limits."""
    found = [
        c
        for c in comparisons(cells)
        if c.cell.kind != LOCAL and (c.ratio > MOST or (c.clear and c.ratio < LEAST))
    ]
    found.sort(key=lambda c: -abs(np.log(max(c.ratio, 1e-300))))
    columns = (
        Column("run", "run"),
        Column("quantity", "quantity"),
        Column("estimate", "estimate", form=".1e"),
        Column("true", "true error", form=".1e"),
        Column("ratio", "ratio", form=".2g"),
        Column("known", "true error known"),
        Column("verdict", "verdict"),
    )
    rows = [
        (
            _place(c.cell),
            c.quantity,
            c.estimate,
            c.true,
            c.ratio,
            "yes" if c.clear else "no",
            c.cell.verdict,
        )
        for c in found[:SHOWN]
    ]
    return Table(columns, tuple(rows))


def _place(cell: Run) -> str:
    how = f"{cell.step:.3g} s" if cell.step is not None else f"--tolerance {cell.tolerance:g}"
    return f"{cell.model}, {cell.scheme}, {how}"
