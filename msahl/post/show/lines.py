"""Find where the elements of a deck stand: file, first and last line, by their names."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.parsers import expat

from msahl.deck.faults import Element, attribute, line_of, text
from msahl.deck.source import Readable
from msahl.input_files import open_input

DEEP = 4
"""Depth of the elements of ``<system>`` and ``<simulation>`` whose lines are looked for."""
LARGEST = 2 * 2**20
"""Bytes of a file that a page contains; of a larger one the beginning."""


def files_of(deck: Path, readable: Readable) -> list[Path]:
    """Return the deck and the files of its parts."""
    parts = (Path(file) for file in readable.origins.values())
    with_faults = (Path(f.file) for f in readable.faults if f.file.endswith(".xml"))
    return list(dict.fromkeys((deck, *parts, *with_faults)))


def file_text(path: Path) -> str:
    """Return the text of a file, as far as it can be read and shown."""
    try:
        with open_input(path) as file:  # which may be a device without end
            data = file.read(LARGEST + 1)
    except OSError as error:
        return f"(cannot be read: {error.strerror or error})"
    more = "\n(the rest is not shown)" if len(data) > LARGEST else ""
    return data[:LARGEST].decode("utf-8", errors="replace").replace("\r\n", "\n") + more


def element_lines(files: list[Path], readable: Readable) -> list[dict[str, Any]]:
    """Return group, kind, name, file (its place in ``files``) and the first and last line of each
    element of the system and the simulation, in the order of the deck."""
    if readable.root is None:
        return []
    places = {str(file): index for index, file in enumerate(files)}
    spans = [_spans(file) for file in files]
    found = []
    for element in readable.root.iterfind("system/*/*"):
        file = places.get(_file(element, readable.origins), 0)
        holder = element.getparent()
        span = _span(spans[file], line_of(element))
        if span is None or holder is None:
            continue
        found.append(
            {
                "group": str(holder.tag),
                "kind": str(element.tag),
                "name": text(element.find("name")) or attribute(element, "name"),
                "file": file,
                "from": span[0],
                "to": span[1],
            }
        )
    return found


def _file(element: Element, origins: Mapping[Element, str]) -> str:
    steps = (element, *element.iterancestors())
    return next((origins[step] for step in steps if step in origins), "")


def _spans(file: Path) -> list[tuple[int, int]]:
    """Return first and last line of every element of the system of a file."""
    found: list[tuple[int, int]] = []
    opened: list[int] = []
    parser = expat.ParserCreate()

    def on_start(_: str, __: object) -> None:
        opened.append(parser.CurrentLineNumber)

    def on_end(_: str) -> None:
        if len(opened) == DEEP:
            found.append((opened[-1], parser.CurrentLineNumber))
        opened.pop()

    parser.StartElementHandler, parser.EndElementHandler = on_start, on_end
    try:
        parser.Parse(file.read_bytes(), True)
    except (OSError, expat.ExpatError, ValueError, LookupError):
        return []
    return sorted(found)


def _span(spans: list[tuple[int, int]], line: int) -> tuple[int, int] | None:
    """Return the lines of the element whose start tag ends on a line."""
    return next((span for span in spans if span[0] <= line <= span[1]), None)
