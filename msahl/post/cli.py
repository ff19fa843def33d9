"""Define the command ``msahl-post``: its group of subcommands and its exit status.

Exit status: 0 success, 1 a comparison found a difference or a verdict is FAIL, 2 the input is not a
run, cannot be compared, or the usage is wrong, 4 files or tables cannot be written.
Each subcommand imports what it needs when it is called: tables do not load matplotlib.
"""

from typing import Any

import click

from msahl.post.commands.compare import compare
from msahl.post.commands.export import export
from msahl.post.commands.modes import modes
from msahl.post.commands.pictures import plot, report
from msahl.post.commands.shared import BAD_INPUT
from msahl.post.commands.sweep import sweep
from msahl.post.commands.tables import constraints, energy, events, reactions, work
from msahl.post.commands.verdict import verdict
from msahl.post.commands.view import view
from msahl.printable import printable
from msahl.terminal import Program, echo
from msahl.version import VERSION


class Commands(Program):
    """A group of commands that report a fault of their input in one line."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; exit with ``BAD_INPUT`` on a fault of its input."""
        try:
            return super().invoke(ctx)
        except Exception as error:
            if isinstance(error, click.ClickException | click.exceptions.Exit | click.Abort):
                raise
            message = _input_fault(error)
            if not message:
                raise
            echo(f"msahl-post: {printable(message)}", err=True)
            ctx.exit(BAD_INPUT)


def _input_fault(error: Exception) -> str:
    """Return one line on a fault of the input; empty for a fault of the program."""
    from msahl.deck import DeckError
    from msahl.results.read import ResultError

    if isinstance(error, DeckError):
        more = f" (and {len(error.faults) - 1} more)" if len(error.faults) > 1 else ""
        return f"{error.faults[0]}{more}"
    return str(error) if isinstance(error, ResultError) else ""


@click.group("msahl-post", cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(VERSION, prog_name="msahl-post")
def main() -> None:
    """Read the results of msahl: accuracy, verdicts, figures, reports and comparisons of runs.

    RUN is a folder that msahl run has written. A good first command:

    \b
        msahl-post report RUN
    """


COMMANDS = (
    *(energy, work, events, constraints, verdict, reactions),
    *(plot, report, view, export, compare, sweep, modes),
)
for command in COMMANDS:
    main.add_command(command)


if __name__ == "__main__":
    main()
