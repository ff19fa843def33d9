"""Decks in memory: their bytes, and trees that are parsed once to make models with other numbers.

Source       -> its model, and its text as it ran, once
ParsedDeck   -> models with other numbers, as often as wanted, without parsing again
"""

import hashlib
import re
from base64 import b64decode, b64encode
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import field
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from lxml import etree

from msahl.algebra.many import Unlike, member_of
from msahl.deck.faults import DeckError, Element, Fault, Faults
from msahl.deck.parse import is_plain, parse, parse_valid, read_bytes
from msahl.deck.read import read_tree, read_what_is_sound
from msahl.deck.schema import check_schema, schema_bytes, validator
from msahl.deck.write import effective_text, without_shapes
from msahl.model import Model
from msahl.records import record

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element as PlainElement

    from msahl.deck.includes import Parts
    from msahl.deck.overrides import Setting


TEXT = Path("<deck>")
"""What messages call a deck that is in no file; parts are looked for in the current folder."""


RECORDS = Path("<records>")
"""Likewise a deck that was written from records."""


class Readable(NamedTuple):
    """What can be read of a deck that may have faults.

    ``model`` has the elements that are sound, of which some may refer to missing ones; ``root`` is
    the expanded tree, and ``origins`` the files of elements from parts; both None if there is
    nothing to be read. ``faults`` are those of the deck.
    """

    model: Model | None
    root: Element | None
    origins: Mapping[Element, str]
    faults: tuple[Fault, ...]


@record(slots=False)
class Source:
    """The bytes of a deck, and the path that names it in messages and leads to its parts.

    ``parts`` are the files of parts that were read; no file is read a second time.
    """

    path: Path
    data: bytes
    parts: "Parts" = field(default_factory=dict)

    @classmethod
    def of_file(cls, path: str | PathLike[str]) -> "Source":
        """Read a file; raises ``DeckError`` if that is not possible."""
        path = Path(path)
        return cls(path, read_bytes(path, Faults(str(path))))

    @classmethod
    def of(cls, deck: "str | PathLike[str] | bytes | Element | PlainElement") -> "Source":
        """Return the deck of a path, of a text that begins with ``<``, or of its root element.

        Raises ``DeckError`` if a file cannot be read.
        """
        if isinstance(deck, bytes):
            return cls(TEXT, deck)
        if isinstance(deck, str) and deck.lstrip().startswith("<"):
            # A declared encoding would be wrong: the text has been decoded.
            return cls(TEXT, re.sub(r"^\s*<\?xml.*?\?>", "", deck, count=1, flags=re.S).encode())
        if isinstance(deck, str | PathLike):
            return cls.of_file(deck)
        if isinstance(deck, Element):
            return cls(TEXT, etree.tostring(deck, with_tail=False))
        from xml.etree import ElementTree

        if not ElementTree.iselement(deck):
            kind = type(deck).__name__
            raise TypeError(f"a deck is a path, a text, bytes or its root element, not {kind}")
        return cls(TEXT, ElementTree.tostring(deck))

    @classmethod
    def of_model(cls, model: Model) -> "Source":
        """Return the deck that a model of records is written as."""
        from msahl.deck.write_model import write_deck  # which few runs need

        return cls(RECORDS, write_deck(model))

    def as_json(self) -> dict[str, Any]:
        """Return the files as JSON."""
        parts = {str(path): b64encode(data).decode() for path, data in self.parts.items()}
        return {"path": str(self.path), "data": b64encode(self.data).decode(), "parts": parts}

    @classmethod
    def from_json(cls, given: Mapping[str, Any]) -> "Source":
        """Return the files that ``as_json`` wrote."""
        parts = {Path(path): b64decode(data) for path, data in given["parts"].items()}
        return cls(Path(given["path"]), b64decode(given["data"]), parts)

    def tree(self, faults: Faults, thorough: bool = False, blanks: bool = True) -> Element:
        """Return the tree without comments; departures from the schema are added to ``faults``.

        Without ``blanks`` that of a valid deck has no white space between its elements.
        """
        root = None if thorough else parse_valid(self.data, validator(schema_bytes()), blanks)
        if root is None:
            root = parse(self.data, faults)
            check_schema(root, faults, thorough)
        return root

    def model(self, settings: Sequence[str] = (), thorough: bool = False) -> Model:
        """Return the model with other numbers (see ``deck.overrides``); raises ``DeckError`` with
        every fault found. With ``thorough`` both libraries validate the deck (``deck.schema``)."""
        faults = Faults(str(self.path))
        root = self.tree(faults, thorough, blanks=False)
        plain = is_plain(root, self.data, settings)
        return read_tree(root, self.path, None if plain else settings, faults, self.parts)

    def readable(self, settings: Sequence[str] = ()) -> "Readable":
        """Return what can be read of the deck with other numbers, and all its faults."""
        faults = Faults(str(self.path))
        root = model = None
        try:
            root = self.tree(faults)
            plain = is_plain(root, self.data, settings)
            given = None if plain else settings
            model = read_what_is_sound(root, self.path, given, faults, self.parts)
            faults.raise_if_any()
        except DeckError as error:
            return Readable(model, root, faults.origins, error.faults)
        return Readable(model, root, faults.origins, ())

    def text(self, changes: Mapping[str, Any], settings: Sequence[str] = ()) -> bytes:
        """Return the deck as it runs (see ``deck.write.effective_text``)."""
        return effective_text(self.path, self.data, changes, settings, self.parts)


def read_deck(
    path: str | PathLike[str], thorough: bool = False, settings: Sequence[str] = ()
) -> Model:
    """Return the model of the deck at ``path``; raise ``DeckError`` with every fault found.

    With ``thorough`` a valid deck is validated by both libraries (see ``deck.schema``).
    ``settings`` change its numbers, such as ``L=80 cm`` (see ``deck.overrides``).
    """
    return Source.of_file(path).model(settings, thorough)


class ParsedDeck:
    """A deck that was parsed, validated and completed by its parts once.

    ``model`` makes any number of models of it, each with other numbers.
    """

    def __init__(self, source: Source) -> None:
        """Raises ``DeckError`` with every fault found if the deck does not fit the schema, or if
        a part cannot be read."""
        self.source = source
        faults = Faults(str(source.path))
        self._root = source.tree(faults)
        if not faults.sound(self._root):
            source.model()  # finds all other faults as well, and raises
            faults.raise_if_any()
        self._plain = is_plain(self._root, source.data, ())
        if not self._plain:
            from msahl.deck.includes import merge_parts  # which plain decks do without

            merge_parts(self._root, source.path, faults, source.parts)
        self._origins = [(i, faults.origins[e]) for i, e in self._numbered() if e in faults.origins]

    def model(self, settings: Sequence[str] = (), word: str = "") -> Model:
        """Return the model with other numbers; raises ``DeckError`` with every fault found.

        Faults of a setting are reported as those of ``word`` and the setting.
        """
        faults = Faults(str(self.source.path), word)
        if self._plain and not settings:
            return read_tree(self._root, self.source.path, None, faults, {})
        return self._read(settings, faults)

    def models(self, settings: Sequence[Sequence[str]]) -> list[Model] | None:
        """Return the models with numbers of their own by ``settings`` of each, read at once; None
        if they have to be read one by one: for faults, or where readers decide by such a number.
        """
        from msahl.deck.overrides import varied

        faults = Faults(str(self.source.path))
        try:
            together = list(map(varied, zip(*settings, strict=True)))
            model = self._read(together, faults)
            member = member_of(model)
        except (Unlike, TypeError, ValueError, DeckError):
            return None
        return [member(k) if member else model for k in range(len(settings))]

    def _read(self, settings: "Sequence[Setting]", faults: Faults) -> Model:
        root = deepcopy(self._root)
        if self._origins:
            elements = list(root.iter("*"))
            faults.origins.update((elements[i], file) for i, file in self._origins)
        return read_tree(root, self.source.path, settings, faults, {})

    def digest(self) -> str:
        """Return the SHA-256 of the deck with its parts, without comments, in hexadecimal."""
        canonical = etree.tostring(self._root, method="c14n", with_comments=False)
        return hashlib.sha256(without_shapes(canonical)).hexdigest()

    def _numbered(self) -> enumerate[Element]:
        return enumerate(self._root.iter("*"))
