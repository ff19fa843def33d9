"""The entry of the command ``msahl``: a server carries the command out if one runs."""

import os
import sys

from msahl.serve.client import server_for


def main() -> None:
    """Carry out the command line, and end the process."""
    status = ask(sys.argv)
    if status is not None:
        os._exit(status)  # nothing was opened or printed here
    from msahl.cli.start import main

    main()


def ask(words: list[str]) -> int | None:
    """Have a server carry out a command line; return its exit status, or None if there is no server
    for it.
    """
    path = server_for(words)
    if not path:
        return None
    try:
        from msahl.serve.handover import hand_over

        return hand_over(path, words)
    except (OSError, ImportError):  # before anything was handed over
        return None
