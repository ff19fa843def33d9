"""Finds the folders at the top of the repository that are installed with the package."""

from importlib.util import find_spec
from pathlib import Path


def folder(name: str) -> Path:
    """Return ``schemas`` or ``decks``, as ``msahl.NAME`` or beside a checkout's package."""
    spec = find_spec(f"msahl.{name}")
    places = spec.submodule_search_locations if spec else None
    return Path(places[0]) if places else Path(__file__).parents[1] / name


def example_decks() -> list[Path]:
    """Return the decks that are installed with the package."""
    parts = ("contact", "elastic", "forces", "joints")
    return sorted(path for part in parts for path in (folder("decks") / part).glob("*.xml"))


def example_deck(name: str) -> Path:
    """Return the path of one of these decks, such as joints/revolute.xml."""
    return folder("decks") / name
