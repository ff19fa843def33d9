"""Write the blocks of a document as parts of a page."""

from base64 import b64encode
from collections.abc import Iterable, Sequence

from msahl.post.document import (
    Banner,
    Block,
    Code,
    Folded,
    Graphs,
    Heading,
    Items,
    OnPage,
    Paragraph,
    Picture,
)
from msahl.post.page.graphs import graphs
from msahl.post.page.markup import Markup, element, running
from msahl.post.page.parts import NOTHING, Part, combine, wrap, write_page
from msahl.post.table import Table
from msahl.run.verdict import WORDS

LONG = 40
"""Characters of a cell above which its text may be broken into lines."""


def as_html(title: str, blocks: Sequence[Block | Part]) -> str:
    """Return the document as one self-contained HTML file, in light or dark colours.

    The heading of a first block of level 1 stands at the head of the page, otherwise the title.
    """
    match blocks:
        case [Heading(1, text, line), *others]:
            return write_page(title, wrap("main", header(text, line), *map(part_of, others)))
        case _:
            return write_page(title, wrap("main", header(title), *map(part_of, blocks)))


def header(title: str, *lines: str) -> Part:
    """Return the head of a page: title, lines below it, and the switch of light and dark."""
    switch = element(
        "button", "Light / dark", type="button", class_="theme", aria_label="Switch light and dark"
    )
    below = (element("p", line, class_="line") for line in lines if line)
    return wrap("header", element("div", element("h1", title), below), switch)


def section(title: str, *content: Block | Part) -> Part:
    """Return a section with its heading; nothing if it has no content."""
    return wrap("section", element("h2", title), *map(part_of, content)) if content else NOTHING


def part_of(block: Block | Part) -> Part:
    """Return a block as a part of a page."""
    match block:
        case Part():
            return block
        case Folded(title, blocks):
            return fold(title, *blocks)
        case Banner():
            return _banner(block)
        case Graphs(_, groups):
            return graphs(groups, "-".join(group.name for group in groups))
        case OnPage(part):
            return combine(part)
        case _:
            return Part(_markup(block))


def _banner(banner: Banner) -> Part:
    name = banner.word.lower()
    first = element("p", word(banner.word), f" {banner.sentence}", class_="head")
    lines = [first if banner.sentence else "", *map(part_of, banner.blocks)]
    return wrap("div", *lines, class_=f"banner {name}".strip(), role="status")


def fold(title: str, *content: Block | Part) -> Part:
    """Return content that is shown after a click on the ``title``."""
    body = wrap("div", *map(part_of, content), class_="folded")
    return wrap("details", element("summary", title), body)


def _markup(block: Block) -> Markup:
    match block:
        case Heading(level, text):
            return element(f"h{level}", text)
        case Paragraph(text):
            return element("p", running(text))
        case Code(text):
            return element("pre", element("code", text))
        case Items(items):
            return element("ul", (element("li", *_item(term, text)) for term, text in items))
        case Picture(_, text, png, svg):
            return _picture(text, png, svg)
        case Table():
            return table(block)
    raise TypeError(block)


def _item(term: str, text: str) -> tuple[str, ...]:
    return (element("b", term), ": ", running(text)) if term else (running(text),)


def _picture(text: str, png: bytes, svg: str) -> Markup:
    """Return a figure: drawn in the colours of the page, or as it is if there is no SVG."""
    if svg:
        return element("figure", Markup(svg), class_="drawn", role="img", aria_label=text)
    source = f"data:image/png;base64,{b64encode(png).decode()}"
    return element("figure", element("img", alt=text, src=source))


def table(given: Table) -> Markup:
    """Return a table that scrolls if it is wider than the page; verdicts are coloured."""
    numeric = given.numeric()
    rows = [
        element("tr", (_cell(c, right) for c, right in zip(row, numeric, strict=True)))
        for row in given.shown()
    ]
    inner = element("table", element("thead", _head(given)), element("tbody", rows))
    # The keyboard scrolls what has the focus.
    return element("div", inner, class_="scroll", tabindex=0)


def _cell(text: str, right: bool) -> Markup:
    kind = "number" if right else "long" if len(text) > LONG else None
    return element("td", word(text) if text in WORDS else running(text), class_=kind)


def word(verdict: str) -> Markup:
    """Return PASS, DONE, WARN or FAIL in its colour."""
    return element("span", verdict, class_=f"word {verdict.lower()}")


def _head(given: Table) -> Iterable[Markup]:
    """Yield the rows of headers; columns of one group have a common header above."""
    if any(column.group for column in given.columns):
        spans: list[list[str | int]] = []
        for column in given.columns:
            if spans and column.group and spans[-1][0] == column.group:
                spans[-1][1] = int(spans[-1][1]) + 1
            else:
                spans.append([column.group, 1])
        yield element(
            "tr",
            (
                element("th", str(name), colspan=width, class_="group" if name else None)
                for name, width in spans
            ),
        )
    yield element(
        "tr",
        (
            element("th", column.label, class_="number" if right else None)
            for column, right in zip(given.columns, given.numeric(), strict=True)
        ),
    )
