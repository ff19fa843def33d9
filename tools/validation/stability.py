"""Write docs/validation/stability.md, its figures and stability.csv: at which steps schemes work.

python -m tools.validation.stability                run all cells, store them, write the page
python -m tools.validation.stability spin radau3    run cells of this family by this scheme only
python -m tools.validation.stability --page         write the page from the stored cells

Without a family all families are run, without a scheme all schemes. Cells are stored value by
value; the others stay as they were: run all of them after a change that changes their results.
"""

import sys
from collections.abc import Iterable
from pathlib import Path

from tools.validation.csv_tables import read_records, write_records
from tools.validation.stability_cells import ALL, COMPARED, Cell, in_order, place, run_all
from tools.validation.thesis_runs import OUT

CSV = OUT / "stability.csv"
DIGITS = 6


def main(arguments: list[str]) -> None:
    """Run the chosen cells and write the page."""
    unknown = sorted(set(arguments) - {"--page", *ALL, *COMPARED})
    if unknown:
        known = ", ".join((*ALL, *COMPARED))
        sys.exit(f"no family or scheme {', '.join(unknown)}; there are {known}")
    if "--page" not in arguments:
        names = [name for name in ALL if name in arguments] or list(ALL)
        schemes = [scheme for scheme in COMPARED if scheme in arguments] or list(COMPARED)
        stored = {place(cell): cell for cell in read_cells(CSV)} if arguments else {}
        for words, made in run_all(names, schemes):
            print(words, flush=True)
            stored |= {place(cell): cell for cell in made}
            write_cells(CSV, in_order(stored.values()))
    from tools.validation.stability_page import write_page

    write_page(read_cells(CSV))


def write_cells(path: Path, cells: Iterable[Cell]) -> None:
    """Write a table with one line per cell."""
    write_records(path, Cell, cells, DIGITS)


def read_cells(path: Path) -> list[Cell]:
    """Return the cells of a table."""
    return read_records(path, Cell)


if __name__ == "__main__":
    main(sys.argv[1:])
