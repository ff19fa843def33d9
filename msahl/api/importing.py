"""Import of machines in other programs' formats, as models."""

from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypedDict, Unpack

from msahl.api.arguments import Weights, require
from msahl.api.model import Model
from msahl.deck import ParsedDeck
from msahl.run.options import Choice

if TYPE_CHECKING:
    from msahl.importers import Note


class ImportedModel(NamedTuple):
    """A ``model``, and ``notes`` on what it has not or has in another form, by element."""

    model: Model
    notes: "tuple[Note, ...]"


class ImportKeywords(TypedDict, total=False):
    """Keywords of ``import_file``: the options of ``msahl import``."""

    base: str
    keep_fixed: bool
    repair: bool
    pose: Mapping[str, float]  # coordinates of joints at t = 0 [rad, m] by name
    rates: Mapping[str, float]  # their rates [rad/s, m/s]
    key: str
    packages: "str | PathLike[str] | Sequence[str | PathLike[str]]"


def import_file(path: "str | PathLike[str]", **options: Unpack[ImportKeywords]) -> ImportedModel:
    """Return the model of a URDF, SDF or MJCF file, and what is not carried over.

    The ``options`` are those of ``msahl import``: ``base``, ``keep_fixed``, ``repair``, ``pose``
    and ``rates`` (of joints at t = 0, by name), ``key``, ``packages``. Meshes are those below the
    folder of the file. Raises ``DeckError`` with every fault found.
    """
    from msahl.importers import BASES, ImportOptions
    from msahl.importers import import_file as read

    require(
        base=(options.get("base", BASES[0]), Choice(BASES)),
        pose=(options.get("pose", {}), Weights()),
        rates=(options.get("rates", {}), Weights()),
    )
    given: dict[str, Any] = dict(options)
    packages = options.get("packages", ())
    one = isinstance(packages, str | PathLike)
    given["packages"] = tuple(map(Path, (packages,) if one else packages))  # type: ignore[arg-type]
    found = read(path, ImportOptions(**given))
    return ImportedModel(Model(ParsedDeck(found.source)), found.notes)
