"""Represent a document as a list of blocks, and write it as Markdown.

The same blocks make a page (``page.blocks``); ``page.files`` writes both.
"""

import re
from collections.abc import Sequence
from typing import Any

from msahl.post.graph_data import Group
from msahl.post.table import Table
from msahl.printable import printable
from msahl.records import record


@record
class Heading:
    """``level`` 1 is the document's title, which may have a ``line`` below it."""

    level: int
    text: str
    line: str = ""


@record
class Paragraph:
    """Plain text."""

    text: str


@record
class Code:
    """A line to copy, such as a command."""

    text: str


@record
class Items:
    """A list; each item has a term (may be empty) and a text."""

    items: tuple[tuple[str, str], ...]


@record
class Picture:
    """A PNG picture with the ``name`` of its file and its caption; ``svg`` is the same picture for
    a page, in whose colours it is drawn (``post.page.drawing``), if there is one."""

    name: str
    text: str
    png: bytes
    svg: str = ""


@record
class Folded:
    """Blocks that are shown after a click on the ``title``; in Markdown a section."""

    title: str
    blocks: tuple["Block", ...]


@record
class Banner:
    """What a reader must see first, in the colour of a verdict ``word`` ("" for none): a sentence
    behind the word (may be empty), and blocks."""

    word: str
    sentence: str
    blocks: tuple["Block", ...]


@record
class Graphs:
    """Groups of graphs: interactive in a page; in Markdown pictures, below the ``heading``."""

    heading: str
    groups: tuple[Group, ...]


@record
class OnPage:
    """``part`` of a page (``page.parts.Part``), in whose place Markdown has ``blocks``."""

    part: Any
    blocks: tuple["Block", ...] = ()


Block = Heading | Paragraph | Code | Items | Picture | Table | Folded | Banner | Graphs | OnPage


def as_markdown(blocks: Sequence[Block]) -> str:
    """Return the document in Markdown; its pictures are files in the same folder."""
    return _joined(blocks) + "\n"


def _joined(blocks: Sequence[Block]) -> str:
    return "\n\n".join(filter(None, map(_markdown, blocks)))


def _markdown(block: Block) -> str:
    match block:
        case Heading(level, text, line):
            below = f"\n\n{_plain(line)}" if line else ""
            return f"{'#' * level} {_plain(text)}{below}"
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
            return _joined((Heading(2, title), *blocks))
        case Banner(word, sentence, blocks):
            first = (Items(((word, sentence),)),) if sentence else ()
            return _joined((*first, *blocks))
        case Graphs(_, groups):
            return "\n\n".join(map(_group, groups))
        case OnPage(_, blocks):
            return _joined(blocks)
        case Picture(name, text):
            return f"![{_plain(text)}]({name})"
        case Table():
            rule = ["---:" if right else "---" for right in block.numeric()]
            cells = [[_plain(cell) for cell in row] for row in (block.headers(), *block.shown())]
            return "\n".join(f"| {' | '.join(row)} |" for row in (cells[0], rule, *cells[1:]))


def _group(group: Group) -> str:
    note = (Paragraph(group.note),) if group.note else ()
    shown = Picture(f"{group.name}.png", group.title, b"")
    return _joined((Heading(3, group.title), *note, shown))


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
