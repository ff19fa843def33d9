"""The command ``msahl`` as a module, for tests that start it: ``python -m tests.support.msahl``."""

from msahl.cli.main import main

if __name__ == "__main__":
    main(prog_name="msahl")
