"""The command ``msahl explain``: describe what running a deck involves."""

from pathlib import Path

import click

from msahl.cli.compiling import computing
from msahl.cli.decks import model_to_run
from msahl.cli.options import DECK, set_option
from msahl.terminal import echo


@click.command(short_help="Describe what running a deck involves.")
@click.argument("deck", type=DECK)
@set_option
def explain(deck: Path, settings: tuple[str, ...]) -> None:
    """Describe what running DECK involves: degrees of freedom, unknowns and model reductions.

    Example: msahl explain decks/thesis/double_pendulum_89.xml
    """
    model = model_to_run(deck, {}, settings)
    from msahl.run.explain import explain as lines

    with computing(deck):
        echo("\n".join(lines(model)))
