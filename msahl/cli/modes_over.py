"""Modes followed over a parameter: what ``msahl modes --over`` does."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from msahl.cli.compiling import computing
from msahl.cli.console import print_report, stop, writing
from msahl.cli.decks import model_to_run
from msahl.printable import printable, shown_path

if TYPE_CHECKING:
    from msahl.sweep.axes import Axis

MOST_VALUES = 100_000


def modes_over(
    deck: Path,
    output: Path | None,
    settings: tuple[str, ...],
    at: float | str,
    quiet: bool,
    wanted: Mapping[str, Any],
) -> None:
    """Follow the modes of ``deck`` over the values of ``wanted["over"]``."""
    axis, values = _axis(wanted["over"])
    model = model_to_run(deck, {}, (*settings, axis.column.setting(axis.cells[0])))
    from msahl.analysis.equilibria.at import point_at
    from msahl.analysis.linearised.point import Point
    from msahl.analysis.modes.campbell import campbell
    from msahl.analysis.modes.campbell_lines import report, warnings
    from msahl.analysis.modes.files import Over, orders_of, write_campbell
    from msahl.analysis.modes.following import Request
    from msahl.deck import ParsedDeck, Source

    parsed = ParsedDeck(Source.of_file(deck))
    name, unit = axis.column.name, _unit(deck, settings, axis)
    over = Over(name, unit, orders_of(unit, wanted["orders"]))
    if over.speed is None and over.orders:
        raise click.UsageError(
            f"--order needs a speed: give {name} a unit of angular velocity, such as "
            f'"{name}=0:6000:41 rpm"'
        )

    def point_of(value: float) -> Point:
        return point_at(parsed.model((*settings, axis.column.setting(repr(value)))), at)

    request = Request(wanted["number"], wanted["near"], wanted["method"])
    with computing(deck, quiet):
        found = campbell(point_of, values, request, over.orders, over.speed or 1.0)
    known, title = bool(found.followed.spectra), model.simulation.title
    print_report(lambda: report(found, over, title), warnings(found, over), quiet or not known)
    if not known:
        stop(f"{shown_path(deck)}: no modes at any value of {printable(name)}")
    if output is not None:
        with writing(output):
            write_campbell(output, found, over, title)


def _axis(text: str) -> tuple["Axis", list[float]]:
    """Return the axis that ``--over`` describes, and its values."""
    from msahl.sweep.axes import NUMBER, parse_set
    from msahl.sweep.faults import PlanError

    def fail(message: str) -> NoReturn:
        raise click.BadParameter(printable(message), param_hint="--over")

    try:
        axis = parse_set(text)
    except PlanError as error:
        fail(_for_modes(str(error)))
    if axis.distribution is not None or axis.column.is_condition:
        fail(f"{text}: give a range or a list of values, such as v=0:10:41")
    if not all(re.fullmatch(NUMBER, cell) for cell in axis.cells):
        fail(f"{text}: give numbers with one unit behind the last, such as L=60:100:5 cm")
    if len(axis.cells) > MOST_VALUES:
        fail(f"{text}: these are more than {MOST_VALUES} values")
    return axis, [float(cell) for cell in axis.cells]


def _for_modes(message: str) -> str:
    """Return a ``message`` on the axis of a sweep without what modes cannot be followed over."""
    for words in (" or L~uniform(4,6)", ", or an expression in braces"):
        message = message.replace(words, "")
    return message.replace("--set", "--over")


def _unit(deck: Path, settings: tuple[str, ...], axis: "Axis") -> str:
    """Return the unit of the values; "" if it is that of a number that is no parameter."""
    from msahl.deck import Source, listed_parameters

    if axis.column.unit:
        return axis.column.unit
    expanded = Source.of_file(deck).text({}, (*settings, axis.column.setting(axis.cells[0])))
    unit = str(listed_parameters(expanded).get(axis.column.name, {}).get("units", ""))
    return "" if unit == "1" else unit
