"""Finds the folders at the top of the repository that are installed with the package."""

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path


def folder(name: str) -> Traversable:
    """Return ``schemas`` or ``decks``, as ``msahl.NAME`` or beside a checkout's package."""
    try:
        return files(f"msahl.{name}")
    except ModuleNotFoundError:
        return Path(__file__).parents[1] / name


def example_decks() -> list[Path]:
    """Return the decks that are installed with the package."""
    return sorted(
        path
        for part in ("forces", "joints")
        for path in Path(str(folder("decks") / part)).glob("*.xml")
    )


def example_deck(name: str) -> Path:
    """Return the path of one of these decks, such as joints/revolute.xml."""
    return Path(str(folder("decks") / name))
