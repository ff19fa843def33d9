"""A run to be made: the deck as it runs, its model and options, and the head of ``run.json``."""

import os
import platform
from collections.abc import Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

from msahl.deck import Source, deck_digest, listed_parameters
from msahl.jit.files import version_of
from msahl.model import Model, Options, RunSettings, resolve
from msahl.records import record
from msahl.results.folder import relative
from msahl.run.options import (
    deck_changes,
    options_beside_deck,
    recorded_options,
    require_compatible,
    with_options,
)
from msahl.version import VERSION

PACKAGES = ("numba", "numpy", "scipy")
"""Packages whose versions ``run.json`` records; numba may be missing."""


@record(slots=False)
class Job:
    """A run to be made of the deck ``source``: its ``model`` with the options ``given`` by name and
    the ``changed`` numbers of the deck, such as ``L=80 cm``.

    If the model begins elsewhere than its deck has it, ``start`` is what ``run.json`` says of that,
    and ``moved`` the deck as it runs if that was written by an earlier run.
    """

    source: Source
    model: Model
    options: Options
    given: Mapping[str, Any]
    changed: tuple[str, ...] = ()
    moved: bytes | None = None
    start: Mapping[str, Any] | None = None

    @cached_property
    def settings(self) -> RunSettings:
        """How the run is made."""
        return resolve(self.model.simulation, self.options)

    @cached_property
    def text(self) -> bytes:
        """The deck as it runs; raises ``DeckError`` if a part of it cannot be read any more."""
        if self.start is None:
            return self.given_text
        return Source.of_model(self.model).data if self.moved is None else self.moved

    @cached_property
    def given_text(self) -> bytes:
        """The deck with the options and changed numbers, wherever the model begins."""
        return self.source.text(deck_changes(self.given), self.changed)

    def about(self, folder: Path) -> dict[str, Any]:
        """Return the head of ``run.json`` in ``folder``: all that the rows of the run depend on."""
        parameters, deck = listed_parameters(self.given_text), self.source.path
        return {
            **versions(),
            "deck": {
                "path": _encodable(deck),
                "relative": _encodable(relative(deck, folder)),
                "digest": deck_digest(self.text),
            },
            **({"parameters": parameters} if parameters else {}),
            **({"set": list(self.changed)} if self.changed else {}),
            **({"start": dict(self.start)} if self.start else {}),
            "options": recorded_options(self.settings),
        }


def make_job(
    source: Source, model: Model, given: Mapping[str, Any], changed: Sequence[str] = ()
) -> Job:
    """Return the run of a ``model``, which was read from ``source`` with ``changed`` numbers, with
    the options ``given``; raises ``OptionError`` with everything that is wrong with them."""
    model, options = with_options(model, given), options_beside_deck(given)
    require_compatible(model.simulation, options)
    return Job(source, model, options, given, tuple(changed))


def versions() -> dict[str, str]:
    """Return the versions of msahl, Python and the packages that numbers depend on."""
    found = {package: version_of(package) for package in PACKAGES}
    installed = {package: version for package, version in found.items() if version}
    return {"msahl": VERSION, "python": platform.python_version(), **installed}


def _encodable(path: str | os.PathLike[str]) -> str:
    """Return a path as text that can be encoded, with marks in place of bytes that are no UTF-8."""
    return os.fspath(path).encode("utf-8", "surrogateescape").decode("utf-8", "replace")
