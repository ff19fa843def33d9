"""Build HTML elements whose texts and attributes are escaped by construction."""

import re
from collections.abc import Iterable
from html import escape

from msahl.printable import printable

VOID = frozenset({"br", "hr", "img", "input", "link", "meta"})
"""Elements without content and without an end tag."""


_HYPHENATED = re.compile(r"((?<!\S)(?=\S*-)\S{2,30}(?!\S))")
"""Words with a hyphen, after which a browser would begin a new line; long ones may be broken."""


class Markup(str):
    """Text that is HTML: the result of ``element`` or ``join``, or a constant of the program."""

    __slots__ = ()


Child = str | Iterable["Child"]
"""A text, which is escaped; ``Markup``, which is not; or several of them."""


def element(tag: str, *children: Child, **attributes: str | int | bool | None) -> Markup:
    """Return ``<tag attributes>children</tag>``.

    An attribute that is ``None`` or ``False`` is omitted, ``True`` stands without a value. A final
    underscore of its name is dropped (``class_``), others become hyphens (``aria_label``).
    """
    names = ((name.rstrip("_").replace("_", "-"), value) for name, value in attributes.items())
    listed = "".join(
        f" {name}" if value is True else f' {name}="{escape(printable(str(value)))}"'
        for name, value in names
        if value is not None and value is not False
    )
    begin = f"<{tag}{listed}>"
    return Markup(begin) if tag in VOID else Markup(f"{begin}{join(*children)}</{tag}>")


def join(*children: Child) -> Markup:
    """Return the children one after the other, texts escaped and each on one line."""
    return Markup("".join(map(_one, children)))


def running(text: str) -> Markup:
    """Return a text whose options and numbers, such as ``--dt`` and ``1e-06``, are not broken."""
    parts = _HYPHENATED.split(text)
    return join(
        element("span", part, class_="unbroken") if k % 2 else part for k, part in enumerate(parts)
    )


def _one(child: Child) -> str:
    if isinstance(child, Markup):
        return child
    return escape(printable(child)) if isinstance(child, str) else join(*child)
