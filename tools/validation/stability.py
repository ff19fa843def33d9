"""Where the method holds: docs/validation/stability.md, its pictures and stability.csv.

python tools/validation/stability.py                run all cells, keep them, write the page
python tools/validation/stability.py spin radau3    run cells of this family by this scheme alone
python tools/validation/stability.py --page         write the page from the kept cells

Without a family all are run, without a scheme likewise. Cells are kept value by value as they come;
those that are not run stay as they are: after a change that moves their figures, all are to be run.
"""

import csv
import sys
from collections.abc import Iterable
from dataclasses import asdict, fields
from pathlib import Path
from typing import get_type_hints

from cells import ALL, COMPARED, Cell, in_order, place, run_all
from measured import OUT

CSV = OUT / "stability.csv"


def main(arguments: list[str]) -> None:
    """Run what is to be run and write the page."""
    unknown = sorted(set(arguments) - {"--page", *ALL, *COMPARED})
    if unknown:
        there = ", ".join((*ALL, *COMPARED))
        sys.exit(f"no family or scheme {', '.join(unknown)}; there are {there}")
    if "--page" not in arguments:
        names = [name for name in ALL if name in arguments] or list(ALL)
        schemes = [scheme for scheme in COMPARED if scheme in arguments] or list(COMPARED)
        kept = {place(cell): cell for cell in read_cells(CSV)} if arguments else {}
        for words, made in run_all(names, schemes):
            print(words, flush=True)
            kept |= {place(cell): cell for cell in made}
            write_cells(CSV, in_order(kept.values()))
    from stability_page import write_page

    write_page(read_cells(CSV))


def write_cells(path: Path, cells: Iterable[Cell]) -> None:
    """A line a cell; what is not known is empty."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(field.name for field in fields(Cell))
        for cell in cells:
            writer.writerow("" if v is None else v for v in asdict(cell).values())


def read_cells(path: Path) -> list[Cell]:
    """The cells of a file of ``write_cells``."""
    hints = get_type_hints(Cell)
    with path.open(newline="") as stream:
        rows = list(csv.DictReader(stream))
    return [Cell(**{key: _read(hints[key], text) for key, text in row.items()}) for row in rows]


def _read(kind: object, text: str) -> str | float | int | None:
    """A figure of a field that is declared as ``kind``."""
    kinds = getattr(kind, "__args__", (kind,))
    if text == "" and type(None) in kinds:
        return None
    if int in kinds:
        return int(text)
    if float in kinds:
        try:
            return float(text)
        except ValueError:
            return text  # the name of a restarted scene
    return text


if __name__ == "__main__":
    main(sys.argv[1:])
