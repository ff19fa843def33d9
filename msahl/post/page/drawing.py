"""Convert figures of matplotlib to SVG elements that take the colours of their page."""

import re

from matplotlib.figure import Figure

from msahl.post.document import Picture
from msahl.post.draw import COLOURS, encode
from msahl.post.page.markup import Markup

VARIABLES = {
    **{colour.lower(): f"series-{i}" for i, colour in enumerate(COLOURS, start=1)},
    "#000000": "ink",
    "#ffffff": "paper",
    "#dddddd": "grid",
    "#cccccc": "grid",
    **dict.fromkeys(("#444444", "#555555", "#666666", "#888888"), "muted"),
}
"""Colours of our figures, and the variables of ``page.css`` that replace them."""


def as_picture(name: str, caption: str, figure: Figure, vector: bool = True) -> Picture:
    """Return a figure as the picture of a document: PNG, and for pages also with vectors in their
    colours unless it has too many marks."""
    svg = drawn(figure, name) if vector else ""
    return Picture(f"{name}.png", caption, encode(figure, "png"), svg)


def drawn(figure: Figure, name: str) -> Markup:
    """Return the figure as an SVG element; ``name`` keeps its ids apart from those of others.

    The content policy of a page allows no styles within elements, so these become attributes.
    """
    text = encode(figure, "svg").decode()
    text = text[text.index("<svg") :]
    text = re.sub(r"<!--.*?-->|<metadata>.*?</metadata>|<style.*?</style>", "", text, flags=re.S)
    text = re.sub(r' (?:xmlns(?::\w+)?|version)="[^"]*"', "", text)
    text = re.sub(r'^<svg [^>]*?viewBox="([^"]*)"[^>]*>', r'<svg viewBox="\1">', text)
    text = re.sub(r' style="([^"]*)"', _attributes, text)
    text = re.sub(r' id="', f' id="{name}-', text)
    text = re.sub(r'(href="#|url\(#)', rf"\g<1>{name}-", text)
    return Markup(re.sub(r"\n\s*", "\n", text).strip())


def _attributes(found: re.Match[str]) -> str:
    """Return the declarations of a style as attributes, in the colours of the page."""
    declared = (part.partition(":") for part in found[1].split(";") if ":" in part)
    return "".join(f' {name.strip()}="{_value(value.strip())}"' for name, _, value in declared)


def _value(value: str) -> str:
    variable = VARIABLES.get(value.lower())
    return f"var(--{variable})" if variable else value
