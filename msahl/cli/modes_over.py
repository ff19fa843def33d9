"""Modes followed over a parameter: what ``msahl modes --over`` does."""

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import click

from msahl.cli.compiling import announced
from msahl.cli.console import NOT_WRITTEN, say, stop
from msahl.cli.decks import model_to_run
from msahl.printable import printable, shown_path
from msahl.terminal import echo

if TYPE_CHECKING:
    from msahl.analysis.campbell import Campbell
    from msahl.analysis.campbell_report import Parameter
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
    from msahl.analysis.at import point_at
    from msahl.analysis.campbell import campbell
    from msahl.analysis.campbell_report import Parameter, report, warnings
    from msahl.analysis.following import Request
    from msahl.analysis.point import Point
    from msahl.deck import DeckError, ParsedDeck, Source
    from msahl.jit.progress import CompileError

    parsed = ParsedDeck(Source.of_file(deck))
    unit, speed = _unit(deck, settings, axis)
    if speed is None and wanted["orders"]:
        raise click.UsageError(
            f"--order needs a speed: give {axis.column.name} a unit of angular velocity, such as "
            f'"{axis.column.name}=0:6000:41 rpm"'
        )
    orders = wanted["orders"] or ((1.0,) if speed is not None else ())

    def point_of(value: float) -> Point:
        return point_at(parsed.model((*settings, axis.column.setting(repr(value)))), at)

    request = Request(wanted["number"], wanted["near"], wanted["method"])
    try:
        with announced(not quiet):
            found = campbell(point_of, values, request, orders, speed or 1.0)
    except (CompileError, DeckError) as error:
        stop(f"{shown_path(deck)}: {printable(str(error))}")
    parameter = Parameter(axis.column.name, unit)
    for warning in warnings(found, parameter):
        say(f"WARN: {printable(warning)}")
    if not found.followed.spectra:
        stop(f"{shown_path(deck)}: no modes at any value of {printable(parameter.name)}")
    if not quiet:
        lines = report(found, parameter, model.simulation.title)
        echo("\n".join(map(printable, lines)))
    if output is not None:
        about = {"title": model.simulation.title, "deck": deck.name, "orders": list(orders)}
        _write(output, found, parameter, {**about, "speed": speed})


def _axis(text: str) -> tuple["Axis", list[float]]:
    """Return the axis that ``--over`` describes, and its values."""
    from msahl.sweep.axes import NUMBER, parse_set
    from msahl.sweep.faults import PlanError

    def fail(message: str) -> NoReturn:
        raise click.BadParameter(printable(message), param_hint="--over")

    try:
        axis = parse_set(text)
    except PlanError as error:
        fail(str(error).replace("--set", "--over"))
    if axis.distribution is not None or axis.column.is_condition:
        fail(f"{text}: give a range or a list of values, such as v=0:10:41")
    if not all(re.fullmatch(NUMBER, cell) for cell in axis.cells):
        fail(f"{text}: give numbers with one unit behind the last, such as L=60:100:5 cm")
    if len(axis.cells) > MOST_VALUES:
        fail(f"{text}: these are more than {MOST_VALUES} values")
    return axis, [float(cell) for cell in axis.cells]


def _unit(deck: Path, settings: tuple[str, ...], axis: "Axis") -> tuple[str, float | None]:
    """Return the unit of the values, "" if it is that of a number that is no parameter, and what
    they are times in rad/s, None if they are no angular velocities.
    """
    from msahl.deck import Source, listed_parameters
    from msahl.deck.units import parse_unit

    unit = axis.column.unit
    if not unit:
        expanded = Source.of_file(deck).text({}, (*settings, axis.column.setting(axis.cells[0])))
        unit = listed_parameters(expanded).get(axis.column.name, {}).get("units", "")
    known, rate = parse_unit(unit) if unit else None, parse_unit("rad/s")
    assert rate is not None
    is_speed = known is not None and known.dimension == rate.dimension
    return ("" if unit == "1" else unit), float(known.factor) if known and is_speed else None


def _write(
    folder: Path, found: "Campbell", parameter: "Parameter", about: Mapping[str, Any]
) -> None:
    """Write campbell.csv, critical.csv and campbell.json into the ``folder``."""
    from msahl.analysis.campbell import COLUMNS, CRITICAL_COLUMNS, campbell_rows, critical_rows
    from msahl.results.write import write_json, write_table

    info = {**about, "name": parameter.name, "unit": parameter.unit}
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_table(folder / "campbell.csv", list(COLUMNS), campbell_rows(found))
        write_table(folder / "critical.csv", list(CRITICAL_COLUMNS), critical_rows(found))
        write_json(folder / "campbell.json", info)
    except OSError as error:
        say(f"{shown_path(error.filename or folder)}: {error.strerror or error}")
        sys.exit(NOT_WRITTEN)
