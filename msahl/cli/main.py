"""The command ``msahl``: the group of its commands.

Exit status: 0 good, 1 the verdict is FAIL (with --strict also WARN), 2 bad deck or usage, 3 a step
did not converge, 4 rows could not be written, 128 + n stopped by signal n (130 interrupted, 143
terminated). A command's module is imported when the command is called, and what it needs when it
needs it, so that ``msahl check`` starts without a compiler.
"""

from importlib import import_module
from typing import Any

import click

from msahl.cli.console import INTERRUPTED, say
from msahl.subprocesses import use_one_thread
from msahl.terminal import Program
from msahl.version import VERSION

COMMANDS = (
    "check", "compile", "equilibrium", "explain", "export", "import", "inverse", "kinematics",
    "linearize", "modes", "new", "reduce", "run", "schema", "serve", "show", "study", "sweep",
)  # fmt: skip
"""All commands, each in the module of ``msahl.cli`` of its name."""
PYTHONS = ("import",)
"""Commands that are called as a word of Python's: their modules have an underscore behind it."""
DENSE = ("linearize", "modes", "reduce")
"""Commands that solve dense eigenvalue problems, in as many threads as there are cores."""


class Commands(Program):
    """The group; it loads the module of a command when the command is asked for."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; if it is interrupted, say so and exit with the status of that."""
        try:
            return super().invoke(ctx)
        except KeyboardInterrupt:
            say("msahl: interrupted")
            ctx.exit(INTERRUPTED)

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Names of all commands."""
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """The command of this name, None if there is none."""
        if cmd_name not in COMMANDS:
            return None
        if cmd_name not in DENSE:
            use_one_thread()
        module = import_module(f"msahl.cli.{cmd_name}{'_' * (cmd_name in PYTHONS)}")
        # A command named as a function of Python's has an underscore behind its name.
        command: click.Command = getattr(module, f"{cmd_name}_", None) or getattr(module, cmd_name)
        return command


@click.group("msahl", cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(VERSION, prog_name="msahl")
def main() -> None:
    """Simulate spatial multibody systems and estimate the error of the results.

    msahl reads a model from a deck (XML) and writes tables (CSV). Start with: msahl run DECK.
    To check, compare and plot results, use msahl-post.
    """
