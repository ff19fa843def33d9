"""The command ``msahl explain``: describe what running a deck involves."""

from pathlib import Path
from typing import Any

import click

from msahl.cli.compiling import computing
from msahl.cli.decks import model_to_run
from msahl.cli.options import DECK, click_option, set_option
from msahl.run.options import OPTIONS
from msahl.terminal import echo

SCHEME = click_option(next(option for option in OPTIONS if option.name == "scheme"))


@click.command(short_help="Describe what running a deck involves.")
@click.argument("deck", type=DECK)
@SCHEME
@set_option
def explain(deck: Path, settings: tuple[str, ...], **given: Any) -> None:
    """Describe what running DECK involves: degrees of freedom, unknowns and model reductions, with
    its own scheme or another one.

    Example: msahl explain decks/thesis/double_pendulum_89.xml --scheme rk8
    """
    model = model_to_run(deck, given, settings)
    from msahl.run.explain import explain as lines

    with computing(deck):
        echo("\n".join(lines(model)))
