"""What another program can set in a run and read from it: parameters, inputs, columns of tables."""

from collections import Counter

from msahl.deck.units import DEFAULTS
from msahl.model import Model
from msahl.model.settable import FIELDS, parameter_of, settable
from msahl.model.settings import EQUILIBRIUM
from msahl.records import record
from msahl.run.column_units import quantity, shown_unit
from msahl.run.hidden_bodies import shown_tables

PARAMETER, TUNABLE, INPUT, OUTPUT = "parameter", "tunable", "input", "output"
"""Parameters of the deck, which are constant in a run; numbers of loads, which can be set at any
communication point; inputs, likewise; columns of tables."""


@record
class Variable:
    """A number by its ``name``, of one of the kinds above, in this ``unit``; ``start`` is what the
    deck says, nan if that follows from the configuration at t = 0. Outputs have a ``table``, and
    numbers of loads their ``load`` and ``parameter``.
    """

    name: str
    kind: str
    unit: str
    start: float = 0.0
    table: str = ""
    load: str = ""
    parameter: str = ""


def variables_of(model: Model, parameters: dict[str, dict[str, object]]) -> dict[str, Variable]:
    """Return the variables of a ``model`` by name; its deck has these ``parameters``."""
    of_deck = [
        Variable(name, PARAMETER, _unit(str(given["units"])), float(str(given["value"])))
        for name, given in parameters.items()
    ]
    inputs = [
        Variable(state.name, INPUT, shown_unit(state.unit), state.initial)
        for state in model.states
        if state.is_input
    ]
    all_found = [*of_deck, *inputs, *_tunable(model), *_outputs(model)]
    found: dict[str, Variable] = {}
    for variable in all_found:
        found.setdefault(variable.name, variable)
    return found


def _tunable(model: Model) -> list[Variable]:
    """Return the numbers of loads; not the free lengths of a model that begins at an equilibrium,
    where they are others than in the deck.
    """
    found = []
    moved = FIELDS if model.simulation.start == EQUILIBRIUM else {}
    for load in model.loads:
        for parameter, physical in settable(load).items():
            if parameter in moved:
                continue
            unit = shown_unit(DEFAULTS["SI"][physical]) if physical else ""
            value = parameter_of(load, parameter)
            name = f"{load.name}.{parameter}"
            found.append(Variable(name, TUNABLE, unit, value, "", load.name, parameter))
    return found


def _outputs(model: Model) -> list[Variable]:
    """Return the columns, those that several tables have with the table's name before theirs."""
    tables = shown_tables(model)
    count = Counter(column for columns in tables.values() for column in columns)
    return [
        Variable(
            column if count[column] == 1 else f"{table}.{column}",
            OUTPUT,
            _column_unit(column, model),
            table=table,
        )
        for table, columns in tables.items()
        for column in columns[1:]
    ]


def _column_unit(column: str, model: Model) -> str:
    unit = quantity(column, model).unit
    return "" if unit in ("-", "SI") or " or " in unit else unit


def _unit(units: str) -> str:
    return "" if units == "1" else shown_unit(units)
