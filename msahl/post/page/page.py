"""Write a page as one HTML file that needs no network and runs no scripts but its own.

A page consists of parts. A part is markup together with the styles, scripts and data that it needs;
the page contains each of those once. The content policy of the page forbids every connection and
allows scripts by their hash, so text from a deck is never executed, even if it were not escaped.
"""

import json
from base64 import b64encode
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

from msahl.post.page.markup import Child, Markup, element, join

WEB = Path(__file__).parents[1] / "web"
"""Folder of the styles and scripts of all pages."""


@dataclass(frozen=True, slots=True)
class Script:
    """A script of the page. A ``module`` runs after the document and all other scripts."""

    text: str
    module: bool = False


@dataclass(frozen=True, slots=True)
class Part:
    """A part of a page: its ``markup``, and the styles, scripts and data that it needs.

    ``data`` is written as JSON into ``<script type="application/json">`` elements; its keys are the
    ids of these elements.
    """

    markup: Markup
    styles: tuple[str, ...] = ()
    scripts: tuple[Script, ...] = ()
    data: Mapping[str, Any] = field(default_factory=dict)


@cache
def asset(name: str) -> str:
    """Return the text of the file ``name`` of the folder ``web``."""
    return (WEB / name).read_text(encoding="utf-8")


def combine(*parts: Part) -> Part:
    """Return the parts one after the other as one part."""
    data: dict[str, Any] = {}
    for part in parts:
        data |= part.data
    return Part(
        join(*(part.markup for part in parts)),
        tuple(dict.fromkeys(style for part in parts for style in part.styles)),
        tuple(dict.fromkeys(script for part in parts for script in part.scripts)),
        data,
    )


def wrap(tag: str, *children: Child | Part, **attributes: str | int | bool | None) -> Part:
    """Return an element that contains texts, markup and parts, with all that these need."""
    parts = [c if isinstance(c, Part) else Part(join(c)) for c in children]
    inner = combine(*parts)
    markup = element(tag, inner.markup, **attributes)
    return Part(markup, inner.styles, inner.scripts, inner.data)


def write_page(title: str, parts: Iterable[Part], kind: str = "") -> str:
    """Return the page as HTML; ``kind`` is the class of its body."""
    all_parts = combine(
        Part(Markup(""), (asset("page.css"),), (Script(asset("page.js"), module=True),)), *parts
    )
    scripts = sorted(all_parts.scripts, key=lambda script: script.module)
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", http_equiv="Content-Security-Policy", content=_policy(scripts)),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", name="color-scheme", content="light dark"),
        element("title", title),
        (Markup(f"\n<style>\n{_checked(style)}\n</style>") for style in all_parts.styles),
    )
    body = element(
        "body",
        all_parts.markup,
        (_data(name, value) for name, value in all_parts.data.items()),
        map(_script, scripts),
        class_=kind or None,
    )
    return f"<!DOCTYPE html>\n{element('html', head, body, lang='en')}\n"


def _policy(scripts: Sequence[Script]) -> str:
    """Return the content policy: no network, only these scripts."""
    hashes = (b64encode(sha256(_between(s).encode()).digest()).decode() for s in scripts)
    allowed = " ".join(f"'sha256-{digest}'" for digest in hashes) or "'none'"
    return (
        f"default-src 'none'; script-src {allowed}; style-src 'unsafe-inline'; "
        "img-src data: blob:; media-src blob:; worker-src 'none'; base-uri 'none'; "
        "form-action 'none'"
    )


def _between(script: Script) -> str:
    """Return what stands between the tags of a script, which its hash covers."""
    return f"\n{_checked(script.text).strip()}\n"


def _script(script: Script) -> Markup:
    kind = ' type="module"' if script.module else ""
    return Markup(f"\n<script{kind}>{_between(script)}</script>")


def _checked(text: str) -> str:
    """Return a style or a script of the program, which must not end its own element."""
    if any(mark in text.lower() for mark in ("</script", "</style", "<!--")):
        raise ValueError("a style or a script contains the end of its element")
    return text


def _data(name: str, value: Any) -> Markup:
    """Return a value as JSON that no browser reads as markup."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=True, allow_nan=False)
    safe = text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")
    identity = element("i", id=name)[3:-5]  # the attribute, escaped
    return Markup(f'\n<script type="application/json" {identity}>{safe}</script>')
