"""The entry of the command ``msahl``: a server carries the command out if one runs."""

import os
import sys

from msahl.serve.client import ask


def main() -> None:
    """Carry out the command line, and end the process."""
    status = ask(sys.argv)
    if status is not None:
        os._exit(status)  # nothing was opened or printed here
    from msahl.cli.main import main

    main()
