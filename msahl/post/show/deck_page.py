"""Build the page of a deck, also of one with faults: see ``show_deck``.

The data of the page beside that of the viewer, which ``show.js`` reads under the key "deck", is

    {
      "name": str,
      "files": [{"name": str, "text": str}],    # the deck, then its parts
      "elements": [{"group", "kind", "name": str, "file", "from", "to": int}],
      "faults": [{"file": int or null, "place", "where", "message": str, "line": int}],
      "facts": [str],                           # degrees of freedom, coordinates, reductions
      "version": int or null,                   # of a page that a server keeps up to date
    }
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from msahl.deck import DeckError, Fault, Source, check_simulation
from msahl.deck.source import Readable
from msahl.model import Model
from msahl.post.page.markup import element
from msahl.post.page.parts import Part, wrap, write_page
from msahl.post.scene import build_scene
from msahl.post.scene.shapes import given_shapes
from msahl.post.show.lines import element_lines, file_text, files_of
from msahl.post.show.readable import drawable
from msahl.post.view import Shown, viewer_block
from msahl.records import record

FAULTY = "#d03530"
"""Colour of a body with a fault."""
MOST_BODIES = 2000
"""Bodies of a model up to which its degrees of freedom are computed."""


@record
class DeckPage:
    """The page of a deck: HTML, the faults it shows, and the files that it depends on."""

    html: str
    faults: tuple[Fault, ...]
    files: tuple[Path, ...]


def show_deck(deck: Path, settings: Sequence[str] = (), version: int | None = None) -> DeckPage:
    """Return the page of a deck with other numbers (see ``deck.overrides``).

    A page with a ``version`` asks the server that it came from for the next one.
    """
    try:
        readable = Source.of_file(deck).readable(settings)
    except DeckError as error:
        readable = Readable(None, None, {}, error.faults)
    files = files_of(deck, readable)
    model, faults = readable.model, list(readable.faults)
    facts: list[str] = []
    meshes = [deck.parent / shape.file for shape in model.shapes if shape.file] if model else []
    if model is not None and not faults:
        faults, facts = _described(deck, model)
    scene = None if model is None else _scene(deck, model, faults)
    elements = element_lines(files, readable)
    data = {
        "name": deck.name,
        "files": [{"name": _short(deck, file), "text": file_text(file)} for file in files],
        "elements": elements,
        "faults": [_fault(fault, files) for fault in faults],
        "facts": facts,
        "version": version,
    }
    title = (scene["title"] if scene else "") or deck.stem
    page = write_page(title, _page(scene, data), asks_server=version is not None)
    html = page.replace("<body>", '<body class="viewer-page">', 1)
    return DeckPage(html, tuple(faults), (*files, *meshes))


def _page(scene: dict[str, Any] | None, data: dict[str, Any]) -> Part:
    """Return the deck's panel and the viewer side by side."""
    panel = Part(
        element("aside", class_="deck", data_deck="deck"),
        styles=("show.css",),
        modules=("show.js",),
        data={"deck": data},
    )
    if scene is None:
        nothing = element("p", "Nothing of this deck can be drawn yet.", class_="nothing")
        return wrap("div", panel, nothing, class_="show")
    return wrap("div", panel, viewer_block([Shown(scene)], is_page=True), class_="show")


def _described(deck: Path, model: Model) -> tuple[list[Fault], list[str]]:
    """Return faults that only the assembled system has, and what is to be said of it."""
    from msahl.run.explain import explain
    from msahl.start.velocities import StartError

    faults = [Fault(str(deck), 0, "", text) for text in check_simulation(model.simulation)]
    for error in given_shapes(model, [deck.parent])[1]:
        faults += error.faults
    if faults or len(model.bodies) > MOST_BODIES:
        return faults, []
    try:
        return [], explain(model)
    except StartError as error:
        return [Fault(str(deck), 0, "", str(error))], []


def _scene(deck: Path, model: Model, faults: Sequence[Fault]) -> dict[str, Any] | None:
    """Return the scene of what can be drawn; None if there is nothing."""
    part = drawable(model)
    if not part.bodies:
        return None
    try:
        scene = build_scene(part, deck.stem, [deck.parent])
    except (ArithmeticError, KeyError, ValueError, np.linalg.LinAlgError):
        if faults:  # numbers that no rule has looked at yet
            return None
        raise
    places = {fault.where.partition(",")[0] for fault in faults}
    for body in scene["bodies"]:
        if f"body '{body['name']}'" in places:
            body["colour"] = FAULTY
            body["shapes"] = [shape | {"colour": None} for shape in body["shapes"]]
    return scene


def _fault(fault: Fault, files: Sequence[Path]) -> dict[str, Any]:
    names = [str(file) for file in files]
    file = names.index(fault.file) if fault.file in names else None
    place = Path(fault.file).name + (f":{fault.line}" if fault.line else "")
    known = {"file": file, "place": place, "line": fault.line}
    return known | {"where": fault.where, "message": fault.message}


def _short(deck: Path, file: Path) -> str:
    """Return the name of a file from the folder of the deck."""
    if file.is_relative_to(deck.parent):
        return file.relative_to(deck.parent).as_posix()
    return file.name
