"""Printing: all that the commands say goes through here."""

import click

from msahl.printable import printable


def echo(message: str, err: bool = False, nl: bool = True) -> None:
    """Print lines with escapes in place of what does not print."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=err, nl=nl)
