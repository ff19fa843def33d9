"""Decks as the commands read them: faults become messages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from msahl.cli.console import stop

if TYPE_CHECKING:
    from msahl.model import Model
    from msahl.results.job import Job


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
    return job_of(deck, given, settings).model


def job_of(deck: Path, given: Mapping[str, Any], settings: Sequence[str] = ()) -> "Job":
    """The run of ``deck`` with the options ``given`` and the changes ``settings`` of its numbers;
    faults end the program."""
    from msahl.deck import DeckError, Source
    from msahl.results.job import make_job
    from msahl.run.options import OptionError

    try:
        source = Source.of_file(deck)
        return make_job(source, source.model(settings), given, settings)
    except DeckError as error:
        stop(str(error))
    except OptionError as error:
        stop("\n".join(f"msahl run: {fault}" for fault in error.faults))
