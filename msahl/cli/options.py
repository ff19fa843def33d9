"""Types of option values, and the options of a run made from the table ``msahl.run.options``."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from msahl.model.settings import EQUILIBRIUM
from msahl.run.options import OPTIONS, Choice, Flag, Integer, Number, Option

Command = TypeVar("Command", bound=Callable[..., Any])

DECK = click.Path(path_type=Path)
"""Path of a deck."""


class FolderType(click.Path):
    """Path of a folder. An empty one is a fault: it is a variable that was not set."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or report the fault with the option's name."""
        if not str(value):
            self.fail("it is empty; name a folder", param, ctx)
        return super().convert(value, param, ctx)


class NumberType(click.FloatRange):
    """A finite number, within a range if one is given."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number, or report the fault with the option's name."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"{value} is not a finite number.", param, ctx)
        return number

    def _describe_range(self) -> str:
        """The range as the help shows it: nothing if there is none."""
        return "" if self.min is None and self.max is None else super()._describe_range()


class TimeType(NumberType):
    """A time [s] of at least zero, or the word for an equilibrium."""

    name = "time"

    def __init__(self) -> None:
        super().__init__(0.0)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number or the word."""
        return value if value == EQUILIBRIUM else super().convert(value, param, ctx)


def at_option(command: Command) -> Command:
    """Add the option of the configuration at which a model is linearised."""
    return click.option(
        "--at",
        type=TimeType(),
        metavar="T|equilibrium",
        default=0.0,
        help="Linearise at the time T in seconds, after a run to it, or at the 'equilibrium' that "
        "msahl equilibrium finds first (default: 0).",
    )(command)


def output_option(default: str) -> Callable[[Command], Command]:
    """The option of the folder to write, with its ``default`` in words."""
    return click.option(
        "-o",
        "--output",
        type=FolderType(path_type=Path),
        metavar="DIR",
        help=f"Write into this folder (default: {default}).",
    )


def quiet_option(command: Command) -> Command:
    """Add the option that prints only faults and warnings."""
    return click.option("-q", "--quiet", is_flag=True, help="Print only faults and warnings.")(
        command
    )


def set_option(command: Command) -> Command:
    """Add the option that changes numbers of the deck."""
    return click.option(
        "--set",
        "settings",
        multiple=True,
        metavar="NAME=VALUE",
        help='Set a parameter of the deck or any of its numbers, such as L=0.8, "L=80 cm" or '
        "Bob.mass=3; repeat for more.",
    )(command)


def run_options(command: Command) -> Command:
    """Add all options of the table to a ``command``."""
    for option in reversed(OPTIONS):
        command = click_option(option)(command)
    return command


def click_option(option: Option) -> Callable[[Command], Command]:
    """One option of the table, for a command."""
    settings: dict[str, Any] = {"help": option.help, "default": option.default}
    match option.kind:
        case Number(unit, least, most, positive):
            settings |= {"type": NumberType(least, most, min_open=positive), "metavar": unit}
        case Integer(least, most):
            settings |= {"type": click.IntRange(least, most), "metavar": "N"}
        case Choice(words):
            settings |= {"type": click.Choice(words)}
        case Flag():
            settings |= {"is_flag": True}
    return click.option(option.flag, option.name, **settings)
