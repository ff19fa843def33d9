"""Represent a document as a list of blocks, and write it as Markdown (HTML: ``post.page``)."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

from msahl.post.table import Table
from msahl.printable import printable


@dataclass(frozen=True, slots=True)
class Heading:
    """``level`` 1 is the document's title."""

    level: int
    text: str


@dataclass(frozen=True, slots=True)
class Paragraph:
    """Plain text."""

    text: str


@dataclass(frozen=True, slots=True)
class Code:
    """A line to copy, such as a command."""

    text: str


@dataclass(frozen=True, slots=True)
class Items:
    """A list; each item has a term (may be empty) and a text."""

    items: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Picture:
    """A PNG picture with the ``name`` of its file and its caption; ``svg`` is the same picture for
    a page, in whose colours it is drawn (``post.page.drawing``), if there is one."""

    name: str
    text: str
    png: bytes
    svg: str = ""


@dataclass(frozen=True, slots=True)
class Folded:
    """Blocks that are shown after a click on the ``title``; in Markdown a section."""

    title: str
    blocks: tuple["Block", ...]


Block = Heading | Paragraph | Code | Items | Picture | Table | Folded


def as_markdown(blocks: Sequence[Block]) -> str:
    """Return the document in Markdown; its pictures are files in the same folder."""
    return "\n\n".join(map(_markdown, blocks)) + "\n"


def _markdown(block: Block) -> str:
    match block:
        case Heading(level, text):
            return f"{'#' * level} {_plain(text)}"
        case Paragraph(text):
            return _plain(text)
        case Code(text):
            return f"    {printable(text)}"
        case Items(items):
            return "\n".join(
                f"- **{_plain(term)}**: {_plain(text)}" if term else f"- {_plain(text)}"
                for term, text in items
            )
        case Folded(title, blocks):
            return "\n\n".join(map(_markdown, (Heading(2, title), *blocks)))
        case Picture(name, text):
            return f"![{_plain(text)}]({name})"
        case Table():
            rule = ["---:" if right else "---" for right in block.numeric()]
            cells = [[_plain(cell) for cell in row] for row in (block.headers(), *block.shown())]
            return "\n".join(f"| {' | '.join(row)} |" for row in (cells[0], rule, *cells[1:]))


_MARKS = re.compile(r"[\\`*|<>\[\]{}&~#]|(?<![^\W_])_|_(?![^\W_])")
"""Characters that Markdown reads as markup; underscores only if they are not within a word."""
_BEGINNING = re.compile(r"^(\s*(?:[-+=](?=\s|[-=]*\s*$)|\d+(?=[.)](?:\s|$))))")
"""Characters that make a paragraph a list, a heading or a rule; numbers and options do not."""


def _plain(text: str) -> str:
    """Return ``text`` on one line, with the characters that Markdown reads as markup escaped."""
    text = _MARKS.sub(r"\\\g<0>", printable(text))
    if begins := _BEGINNING.match(text):
        mark = begins.end() if begins[1][-1].isdigit() else begins.end() - 1
        text = f"{text[:mark]}\\{text[mark:]}"
    return text
