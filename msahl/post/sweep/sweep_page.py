"""Write the page of a sweep, its pictures and its tables as CSV files."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from msahl.post.document import Block, Items, Paragraph
from msahl.post.draw import encode, style
from msahl.post.page.blocks import fold, header, section
from msahl.post.page.drawing import as_picture
from msahl.post.page.parts import Part, combine, wrap, write_page
from msahl.post.sweep.pictures import MOST_MEASURES, pictures
from msahl.post.sweep.read import SweepRuns
from msahl.post.sweep.statistics import LEVEL, SALTELLI, Indices
from msahl.post.sweep.sweep_tables import (
    MOST_FAILURES,
    failures_table,
    indices_table,
    is_sample,
    outcome,
    statistics_table,
)
from msahl.post.table import Cell, Column, Table, as_csv
from msahl.results.write import replace_file

PAGE = "sweep.html"
MOST_ROWS = 500
"""Points that the page lists; all of them are in ``runs.csv``."""


def write_sweep_page(
    sweep: SweepRuns, found: Sequence[Indices], folder: Path, forms: Sequence[str]
) -> list[Path]:
    """Write ``sweep.html``, the tables as CSV, and the pictures in each of ``forms`` ("png", "svg",
    "pdf") to ``folder``; return the paths. ``found`` are the Sobol indices, if there are any."""
    folder.mkdir(parents=True, exist_ok=True)
    files: dict[str, bytes] = {"statistics.csv": as_csv(statistics_table(sweep)).encode()}
    if found:
        files["sobol.csv"] = as_csv(indices_table(found)).encode()
    with style():
        shown = []
        for picture in pictures(sweep, sweep.asked, found):
            drawn = (picture.name, picture.caption, picture.figure, picture.vector)
            shown.append(as_picture(*drawn))
            for form in forms:
                same = shown[-1].png if form == "png" else b""
                files[f"{picture.name}.{form}"] = same or encode(picture.figure, form)
    content = combine(
        header(sweep.title, *_lines(sweep)),
        _outcome(sweep),
        section(_title_of_statistics(sweep), Paragraph(_note(sweep)), statistics_table(sweep)),
        *([_indices_section(indices_table(found))] if found else []),
        section("Pictures", *shown),
        _folded(sweep),
    )
    files[PAGE] = write_page(sweep.title, wrap("main", content)).encode()
    for name, data in files.items():
        replace_file(folder / name, data)
    return [folder / name for name in (PAGE, *(name for name in files if name != PAGE))]


def _lines(sweep: SweepRuns) -> Iterator[str]:
    """Yield the lines below the title: outcome and how points were drawn."""
    yield outcome(sweep)
    sample = sweep.sample
    if sample:
        yield f"Sample: {sample.get('kind')}, n = {sample.get('n')}, seed {sample.get('seed')}"


def _outcome(sweep: SweepRuns) -> Part:
    """Return the section on the plan, and the failed points."""
    plan = sweep.info["plan"]
    axes = Items(tuple(("", str(axis)) for axis in plan.get("axes", [])))
    parts: list[Block | Part] = [axes]
    failures = failures_table(sweep)
    if failures.rows:
        count = sum(sweep.failures.values())
        first = f", the first {MOST_FAILURES}" if count > MOST_FAILURES else ""
        parts.append(
            Paragraph(f"{count} points failed. They are part of no statistic and no curve.")
        )
        parts.append(fold(f"Failed points{first}", failures))
    return section("Plan", *parts)


def _title_of_statistics(sweep: SweepRuns) -> str:
    return "Statistics" if is_sample(sweep) else "Extremes"


def _note(sweep: SweepRuns) -> str:
    """Say what the table of statistics counts."""
    counted = "Points without value (failed, or the measure is not defined) are counted, not used. "
    if not is_sample(sweep):
        return counted + "Those with the verdict FAIL are used: look at their number."
    kind = (sweep.sample or {}).get("kind")
    rows = "Of a Saltelli design the two independent points of each row are used. "
    rules = (
        f"The {LEVEL:.0%} interval of the mean takes points as independent (Student's t); means "
        "of Latin hypercubes and Sobol sequences are usually more exact. The interval of the "
        "standard deviation is that of a normal distribution."
    )
    return counted + (rows if kind == SALTELLI else "") + rules


def _indices_section(table: Table) -> Part:
    words = (
        "First order: the part of the variance that a parameter explains alone. Total: the part "
        "that is left when all others are known. Estimates of Saltelli (2010) and Jansen, as in "
        f"scipy.stats.sobol_indices; {LEVEL:.0%} intervals by the bootstrap over rows. Rows with a "
        "missing value are omitted: if points fail in a part of the space only, indices are biased."
    )
    return section("Sobol indices", Paragraph(words), table)


def _folded(sweep: SweepRuns) -> Part:
    """Return the folded list of points."""
    count = min(sweep.count, MOST_ROWS)
    columns = (
        Column("point", "point", form="d"),
        *(Column(p.name, p.name) for p in sweep.varied),
        Column("status", "status"),
        Column("verdict", "verdict"),
        *(Column(m.name, m.label, form=".6g", missing="") for m in sweep.measures),
    )
    rows = tuple(_row(sweep, k) for k in range(count))
    first = f" (first {count} of {sweep.count}; all are in runs.csv)" if count < sweep.count else ""
    more = len(sweep.asked) - MOST_MEASURES
    notes = [Paragraph(f"Pictures show the first {MOST_MEASURES} measures.")] if more > 0 else []
    return fold(f"Points{first}", *notes, Table(columns, rows))


def _row(sweep: SweepRuns, k: int) -> tuple[Cell, ...]:
    """Return number, parameters, outcome and measures of a point."""
    values = [float(m.values[k]) for m in sweep.measures]
    return (
        int(sweep.numbers[k]),
        *(p.short[p.cells[k]] for p in sweep.varied),
        sweep.status[k],
        sweep.verdict[k],
        *(value if value == value else None for value in values),
    )
