"""The command ``msahl compile``: compile kernels in advance."""

from pathlib import Path
from typing import Any

import click

from msahl.cli.console import say, stop
from msahl.cli.decks import job_of
from msahl.cli.options import DECK, run_options
from msahl.printable import shown_path


@click.command(name="compile", short_help="Compile kernels in advance.")
@click.argument("decks", type=DECK, nargs=-1)
@click.option("--all", "everything", is_flag=True,
              help="Compile everything for every kind of model.")  # fmt: skip
@run_options
def compile_(decks: tuple[Path, ...], everything: bool, **given: Any) -> None:
    """Compile what runs of DECKS need, or everything, and store it on disk.

    The first run of a kind of model compiles what it needs, which takes seconds. After msahl
    compile --all no run, report or study compiles any more. The code is stored in the user's cache
    folder, or in NUMBA_CACHE_DIR.

    Example: msahl compile decks/mechanisms/four_bar.xml --scheme gauss3
    """
    if not decks and not everything:
        stop("msahl compile: give at least one DECK, or --all")
    from msahl.cli.kernels import calls_of_run, compile_everything
    from msahl.jit.announced import announced
    from msahl.jit.compiled import prepare, trouble
    from msahl.jit.progress import CompileError
    from msahl.run.options import options_beside_deck

    calls = []
    for deck in decks:
        calls += calls_of_run(job_of(deck, given).model, options_beside_deck(given))
    try:
        with announced(True):
            prepare(calls)
            for deck in decks:
                say(f"{shown_path(deck)}: compiled")
            if everything:
                compile_everything(say)
    except CompileError as error:
        stop(f"msahl compile: {error}")
    if trouble():
        stop(trouble())
