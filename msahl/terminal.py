"""Prints the messages of all commands, with escapes for characters that a terminal obeys."""

import click

from msahl.printable import printable


def echo(message: str, err: bool = False, nl: bool = True) -> None:
    """Print lines, with escapes in place of characters that are not printable."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=err, nl=nl)
