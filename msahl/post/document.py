"""Represent a document as a list of blocks, and write it as Markdown or as one HTML file."""

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

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
    """A PNG picture with the ``name`` of its file and its caption."""

    name: str
    text: str
    png: bytes


@dataclass(frozen=True, slots=True)
class Folded:
    """Blocks that are shown after a click on the ``title``; in Markdown a section."""

    title: str
    blocks: tuple["Block", ...]


Block = Heading | Paragraph | Code | Items | Picture | Table | Folded

CSS = """
:root { color-scheme: light dark; --line: #8886; --soft: #8881; }
body { font: 16px/1.5 system-ui, sans-serif; max-width: 52rem; margin: 2rem auto; padding: 0 1rem; }
h1, h2 { line-height: 1.2; }
h2 { margin-top: 2.2em; border-bottom: 1px solid var(--line); padding-bottom: .2em; }
div { overflow-x: auto; margin: 1em 0; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .9em; }
th, td { text-align: left; padding: .25em .6em; border-bottom: 1px solid var(--line); }
th { background: var(--soft); vertical-align: bottom; }
.number { text-align: right; }
td.number { white-space: nowrap; }
td:first-child { min-width: 6em; }
td { overflow-wrap: break-word; }
pre { overflow-x: auto; background: var(--soft); padding: .6em .8em; border-radius: 6px; }
summary { cursor: pointer; margin-top: 1.2em; font-size: 1.3em; font-weight: 600; }
img { width: 100%; background: white; border-radius: 6px; margin: .5em 0; }
""".strip()


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
        case Picture(name, text, _):
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


def _escaped(text: str) -> str:
    """Return ``text`` on one line, with the characters that HTML reads as markup escaped."""
    return escape(printable(text))


def as_html(title: str, blocks: Sequence[Block]) -> str:
    """Return the document as one self-contained HTML file, in light or dark colours."""
    body = "\n".join(map(_html, blocks))
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_escaped(title)}</title>\n<style>\n{CSS}\n</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def _html(block: Block) -> str:
    match block:
        case Heading(level, text):
            return f"<h{level}>{_escaped(text)}</h{level}>"
        case Paragraph(text):
            return f"<p>{_escaped(text)}</p>"
        case Code(text):
            return f"<pre><code>{_escaped(text)}</code></pre>"
        case Items(items):
            lines = [
                f"<li><b>{_escaped(term)}</b>: {_escaped(text)}</li>"
                if term
                else f"<li>{_escaped(text)}</li>"
                for term, text in items
            ]
            return "\n".join(["<ul>", *lines, "</ul>"])
        case Folded(title, blocks):
            body = "\n".join(map(_html, blocks))
            return f"<details>\n<summary>{_escaped(title)}</summary>\n{body}\n</details>"
        case Picture(_, text, png):
            data = base64.b64encode(png).decode()
            return f'<img alt="{_escaped(text)}" src="data:image/png;base64,{data}">'
        case Table():
            rows = [_html_row(block, "th", block.headers())]
            rows += [_html_row(block, "td", row) for row in block.shown()]
            return "\n".join(["<div><table>", *rows, "</table></div>"])


def _html_row(table: Table, tag: str, cells: Sequence[str]) -> str:
    kinds = [' class="number"' if right else "" for right in table.numeric()]
    texts = (f"<{tag}{k}>{_escaped(c)}</{tag}>" for k, c in zip(kinds, cells, strict=True))
    return f"<tr>{''.join(texts)}</tr>"
