"""Decks as the commands read them: faults become messages."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from msahl.cli.console import say, stop
from msahl.printable import shown_path

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
    """The model in ``deck`` with the changes ``settings`` of its numbers and the options ``given``,
    in equilibrium if the deck asks for it; its faults end the program."""
    return job_to_run(deck, given, settings).model


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
        context = click.get_current_context(silent=True)
        command = f"msahl {context.info_name}" if context else "msahl run"
        stop("\n".join(f"{command}: {fault}" for fault in error.faults))


def job_to_run(
    deck: Path,
    given: Mapping[str, Any],
    settings: Sequence[str],
    quiet: bool = False,
    resumed: Path | None = None,
) -> "Job":
    """The run of ``deck`` as ``job_of`` returns it, from an equilibrium if the deck asks for it:
    that of the run in the folder ``resumed``, if there is one. Faults end the program."""
    from msahl.model.settings import EQUILIBRIUM

    job = job_of(deck, given, settings)
    if job.model.simulation.start != EQUILIBRIUM:
        return job
    from msahl.analysis.equilibria.begin import beginning, beginning_of_run, in_words
    from msahl.cli.compiling import computing

    with computing(deck, quiet):
        earlier = beginning_of_run(job, resumed) if resumed else None
        job = earlier or beginning(job)
    if not quiet and job.start:
        say(f"{shown_path(deck)}: {in_words(job.start)}")
    return job
