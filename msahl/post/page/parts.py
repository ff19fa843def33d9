"""Write a page as one HTML file that needs no network and runs no scripts but its own.

A page consists of parts. A part is markup together with the styles, scripts and data that it needs;
the page contains each of those once. The content policy of the page forbids every connection and
allows scripts and styles by their hash, so text from a deck would not be executed even if it were
not escaped.
"""

from collections.abc import Mapping
from dataclasses import field
from typing import Any

from msahl.post.page.markup import Child, Markup, element, join
from msahl.post.web import (
    bundle,
    content_policy,
    inline_script,
    inline_style,
    joined,
    json_data,
    source,
)
from msahl.records import record


@record
class Part:
    """A part of a page: its ``markup``, and the styles, modules, bundles and data that it needs.

    ``styles`` (``*.css``) and ``modules`` (``*.js``) are names of files in ``msahl/post/web``,
    ``bundles`` those of vendored libraries (``uplot``), which a module loads by ``loadBundle``.
    A value of ``data`` is read by its key: ``readJson(key)``.
    """

    markup: Markup
    styles: tuple[str, ...] = ()
    modules: tuple[str, ...] = ()
    bundles: tuple[str, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)


NOTHING = Part(Markup(""))


def combine(*parts: Part) -> Part:
    """Return the parts one after the other as one part."""
    data: dict[str, Any] = {}
    for part in parts:
        data |= part.data
    return Part(
        join(*(part.markup for part in parts)),
        tuple(dict.fromkeys(name for part in parts for name in part.styles)),
        tuple(dict.fromkeys(name for part in parts for name in part.modules)),
        tuple(dict.fromkeys(name for part in parts for name in part.bundles)),
        data,
    )


def wrap(tag: str, *children: Child | Part, **attributes: str | int | bool | None) -> Part:
    """Return an element that contains texts, markup and parts, with all that these need."""
    inner = combine(*(c if isinstance(c, Part) else Part(join(c)) for c in children))
    markup = element(tag, inner.markup, **attributes)
    return Part(markup, inner.styles, inner.modules, inner.bundles, inner.data)


def write_page(title: str, *parts: Part, asks_server: bool = False) -> str:
    """Return the page as HTML; only one that ``asks_server`` may connect to where it came from."""
    page = combine(Part(Markup(""), styles=("page.css",), modules=("page.js",)), *parts)
    script = joined(*page.modules)
    styles = [source(name) for name in page.styles]
    allowed = [script, *(source(f"{name}.min.js") for name in page.bundles)]
    head = element(
        "head",
        element("meta", charset="utf-8"),
        _trusted(content_policy(allowed, styles, asks_server)),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        _trusted(*map(inline_style, styles)),
    )
    body = element(
        "body",
        page.markup,
        _trusted(
            *(json_data(name, value) for name, value in page.data.items()),
            *map(bundle, page.bundles),
            inline_script(script),
        ),
    )
    return f"<!DOCTYPE html>\n{element('html', head, body, lang='en')}\n"


def _trusted(*texts: str) -> Markup:
    """Return elements that ``post.web`` made, each on a line of its own."""
    return Markup("".join(f"\n{text}" for text in texts))
