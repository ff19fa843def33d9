"""Decks as the commands read them: faults become messages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msahl.cli.console import stop

if TYPE_CHECKING:
    from msahl.model import Model


def read(
    deck: Path, thorough: bool = False, settings: Sequence[str] = ()
) -> tuple["Model | None", list[str]]:
    """The model in ``deck`` with the changes ``settings`` of its numbers, None if it has faults;
    and the faults in words."""
    from msahl.deck import DeckError, read_deck

    try:
        return read_deck(deck, thorough, settings), []
    except DeckError as error:
        return None, [str(fault) for fault in error.faults]


def model_to_run(deck: Path, given: Mapping[str, Any], settings: Sequence[str] = ()) -> "Model":
    """The model in ``deck`` with the changes ``settings`` of its numbers and the options ``given``;
    its faults end the program."""
    from msahl.deck import check_simulation
    from msahl.run.options import with_options

    model, faults = read(deck, settings=settings)
    if model is None:
        stop("\n".join(faults))
    model = with_options(model, given)
    faults = check_simulation(model.simulation)
    if faults:
        stop("\n".join(f"msahl run: {fault}" for fault in faults))
    return model
