"""Text of unknown origin for a reader: nothing in it is obeyed by a terminal."""

import os

import click


def printable(given: str) -> str:
    """``given`` with escapes in place of what does not print, line ends included."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in given)


def shown(path: str | os.PathLike[str]) -> str:
    """A path for a message: one line, whatever the file is called."""
    return printable(os.fspath(path))


def echo(message: str, err: bool = False, nl: bool = True) -> None:
    """Print lines with escapes in place of what does not print."""
    click.echo("\n".join(map(printable, message.split("\n"))), err=err, nl=nl)
