"""Measures of a run: one number from its tables or its report, by a text such as ``Tip.z max``.

    Tip.z max              largest value at the output times; also min, absmax, range
    Tip.z mean, Tip.z rms  mean and root mean square over the time, by the trapezoidal rule
    Crank.angle final      value at the last output time; initial: at t = 0
    Tip.z at 0.5           value at t = 0.5 s, interpolated between output times
    Hinge.F absmax         of a vector, the column without its last letter, the norm is taken
    displacement of Tip.z max   of the change of a column since t = 0; of a point, such as
                           displacement of Tip max, of the distance from where it was
    time of Crank.angle = 1.57   first time [s] at which the column passes the value
    energyErrorMax         a figure of run.json: those of extremes, steps, iterations, ...
    verdict, error         are in every row anyway
    seconds                time of the loop [s], which differs from run to run

Columns are those of all tables of ``msahl run``.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from msahl.model import Model
from msahl.printable import printable
from msahl.records import record
from msahl.run.column_units import quantity
from msahl.run.report import Report, camel_case
from msahl.run.tables import ERROR, error_columns, tables_of_model


def _mean(times: np.ndarray, values: np.ndarray) -> float:
    """Return the mean over the time, by the trapezoidal rule: output times may be uneven, as at the
    end of a run that a condition stops."""
    duration = times[-1] - times[0]
    if duration <= 0.0:
        return float(values[-1])
    return float(0.5 * np.diff(times) @ (values[1:] + values[:-1]) / duration)


STATISTICS: Mapping[str, Callable[[np.ndarray, np.ndarray], float]] = {
    "max": lambda times, values: np.max(values),
    "min": lambda times, values: np.min(values),
    "absmax": lambda times, values: np.max(np.abs(values)),
    "mean": _mean,
    "rms": lambda times, values: math.sqrt(_mean(times, np.square(values))),
    "range": lambda times, values: np.ptp(values),
    "final": lambda times, values: values[-1],
    "initial": lambda times, values: values[0],
}
"""Statistics of a column, of output times and values (m,)."""
VERDICT, POSITION_ERROR, SECONDS = "verdict", "error", "seconds"
COUNTS = ("steps", "output_times", "time", "unknowns", "iterations", "factorisations",
          "scipy_steps", "path_steps", "subdivisions")  # fmt: skip
"""Numbers of a report."""
EXTREMES = ("energyAtStart", "largestKineticEnergy", "energyErrorMax", "energyErrorMaxRelative",
            "energyErrorBetweenSteps", "potentialEnergyChangeBetweenSteps", "energyErrorRms",
            "constraintViolationMax", "constraintViolationRateMax", "constraintWorkMax",
            "speedMax", "rotationPerStepMax", "distanceMax", "displacementMax", "localErrorMax",
            "localErrorSum")  # fmt: skip
"""Figures of ``extremes`` in a report."""
FIGURES = (VERDICT, POSITION_ERROR, SECONDS, *map(camel_case, COUNTS), *EXTREMES)
"""Measures that need no table."""
_NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
TIME_OF = re.compile(rf"time of (?P<column>.+?)\s*=\s*(?P<number>{_NUMBER})")
AT = re.compile(rf"(?P<column>.+?) at (?P<number>{_NUMBER})( s)?")
STATISTIC = re.compile(rf"(?P<column>.+?) (?P<kind>{'|'.join(STATISTICS)})")
DISPLACEMENT = "displacement of "
"""Begins a column of which the change since t = 0 is measured."""
ENERGIES = ("energyAtStart", "largestKineticEnergy", "energyErrorMax", "energyErrorBetweenSteps",
            "potentialEnergyChangeBetweenSteps")  # fmt: skip
LENGTHS = (POSITION_ERROR, "constraintViolationMax", "displacementMax", "distanceMax")
UNITS = {
    **dict.fromkeys(LENGTHS, "m"),
    **dict.fromkeys(ENERGIES, "J"),
    **dict.fromkeys((SECONDS, "time"), "s"),
    "speedMax": "m/s",
    "constraintWorkMax": "J",
    "rotationPerStepMax": "rad",
}
"""Units of measures that need no table."""
SAME_TIME = 1e-9
"""Largest difference of an output time from a time asked for, relative to the run's end."""

UNCERTAIN = 0.02
"""Least uncertainty of a crossing that is reported, as a fraction of the output interval."""


class MeasureError(ValueError):
    """A text that is no measure, or a measure of a column that does not exist; the message has one
    line for each fault, with its remedy."""

    def __init__(self, *faults: str) -> None:
        super().__init__("\n".join(faults))
        self.faults = faults


@record
class Measure:
    """A measure: its ``text``, its ``kind`` (a statistic, "at", "time of", or a figure), its column
    and the number that belongs to "at" [s] and "time of"."""

    text: str
    kind: str
    column: str = ""
    number: float = 0.0


def parse_measure(text: str) -> Measure:
    """Return the measure that a text describes; raises ``MeasureError``."""
    words = " ".join(text.split())
    if words in FIGURES:
        return Measure(words, words)
    for kind, form in (("time of", TIME_OF), ("at", AT), ("", STATISTIC)):
        match = form.fullmatch(words)
        if match:
            found = match.groupdict()
            number = float(found.get("number") or 0.0)
            return Measure(words, kind or found["kind"], found["column"], number)
    raise MeasureError(
        f"'{printable(words)}': write a column and one of {', '.join(STATISTICS)} or "
        "'at TIME', such as 'Tip.z max', or 'displacement of' these; or "
        "'time of COLUMN = VALUE'; or one of "
        f"{', '.join(FIGURES)}"
    )


def parse_measures(texts: Sequence[str]) -> tuple[Measure, ...]:
    """Return the measures of some texts, each once; raises ``MeasureError`` with all faults."""
    faults: list[str] = []
    found: dict[str, Measure] = {}
    for text in texts:
        try:
            measure = parse_measure(text)
            found[measure.text] = measure
        except MeasureError as error:
            faults += error.faults
    if faults:
        raise MeasureError(*faults)
    return tuple(found.values())


def require_columns(measures: Sequence[Measure], model: Model) -> None:
    """Raise ``MeasureError`` unless a run of the ``model`` has the columns of all measures."""
    tables = tables_with_columns(model)
    faults = [
        f"'{measure.text}': {_no_column(measure.column, tables)}"
        for measure in measures
        if measure.column and not components(measure.column, tables)
    ]
    if faults:
        raise MeasureError(*faults)


def tables_needed(measures: Sequence[Measure], model: Model) -> list[str]:
    """Return the names of the tables with the columns of the measures."""
    tables = tables_with_columns(model)
    places = (components(measure.column, tables) for measure in measures if measure.column)
    return list(dict.fromkeys(table for found in places for table, _ in found))


def evaluate(
    measures: Sequence[Measure],
    model: Model,
    report: Report,
    table: Callable[[str], np.ndarray],
) -> tuple[dict[str, Any], str]:
    """Return the values of the measures of a completed run by their texts, None where there is
    none, and why there is none in words; ``table`` returns the rows of a table by its name.
    """
    values, reason = evaluate_columns([m for m in measures if m.column], model, table)
    figures = {m.text: _finite(_figure(m.kind, report)) for m in measures if not m.column}
    return {m.text: {**values, **figures}[m.text] for m in measures}, reason


def evaluate_columns(
    measures: Sequence[Measure], model: Model, table: Callable[[str], np.ndarray]
) -> tuple[dict[str, Any], str]:
    """Return what ``evaluate`` returns, of measures of columns."""
    tables, values, reasons = tables_with_columns(model), {}, []
    for measure in measures:
        value: Any = None
        places = components(measure.column, tables)
        if not places:
            reasons.append(f"{measure.text}: {_no_column(measure.column, tables)}")
        else:
            moved = measure.column.startswith(DISPLACEMENT)
            value, reason = _of_series(measure, *series_of(places, table, moved))
            reasons += [f"{measure.text}: {reason}"] if reason else []
        values[measure.text] = _finite(value)
    return values, "; ".join(reasons)


def tables_with_columns(model: Model) -> dict[str, list[str]]:
    """Return the columns of all tables of a run, by name."""
    return {**tables_of_model(model), ERROR: error_columns(model)}


def components(column: str, tables: Mapping[str, list[str]]) -> list[tuple[str, int]]:
    """Return table and index of a column, or of the three components of a vector; of a point whose
    displacement is measured those of its position."""
    moved = column.removeprefix(DISPLACEMENT)
    for name, columns in tables.items():
        if moved in columns:
            return [(name, columns.index(moved))]
        if "." in moved and not moved.endswith("."):
            parts = [moved + axis for axis in "xyz"]
        elif moved != column:
            parts = [f"{moved}.{axis}" for axis in "xyz"]
        else:
            continue
        if all(part in columns for part in parts):
            return [(name, columns.index(part)) for part in parts]
    return []


def unit_of(measure: Measure, model: Model | None = None) -> str:
    """Return the SI unit of a measure, "" if it has none or it is not known; with the ``model``
    also that of signals and of loads."""
    if not measure.column or measure.kind == "time of":
        return "s" if measure.column else UNITS.get(measure.kind, "")
    column = measure.column.removeprefix(DISPLACEMENT)
    if "." not in column and column != measure.column and model is not None:
        tables = tables_with_columns(model)
        if not any(column in columns for columns in tables.values()):
            return "m"
    elif "." in column and quantity(column).unit == "":
        column += "x"  # the norm of a vector, such as Hinge.F
    unit = quantity(column, model).unit
    return "" if unit == "SI" else unit


def _no_column(column: str, tables: Mapping[str, list[str]]) -> str:
    """Say that there is no such column, and which ones are near."""
    from msahl.expressions.syntax import nearest

    columns = [name for listed in tables.values() for name in listed if name != "time"]
    column = column.removeprefix(DISPLACEMENT)
    head = column.partition(".")[0]
    same = [name for name in columns if name.startswith(f"{head}.")]
    return f"no table has a column '{printable(column)}'{nearest(column, same or columns)}"


def series_of(
    places: list[tuple[str, int]], table: Callable[[str], np.ndarray], moved: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return times and values of a column, or the norms of a vector, each (m,); of its change since
    the first row if ``moved``."""
    rows = table(places[0][0])
    if not len(rows):
        return np.zeros(0), np.zeros(0)
    values = rows[:, [index for _, index in places]]
    if moved:
        values = values - values[0]
    return rows[:, 0], values[:, 0] if len(places) == 1 else np.linalg.norm(values, axis=1)


def _of_series(measure: Measure, times: np.ndarray, series: np.ndarray) -> tuple[Any, str]:
    """Return the value of a measure of a column, or None and why there is none."""
    if not len(series):
        return None, "the table has no rows"
    if measure.kind == "at":
        return _at(measure.number, times, series)
    if measure.kind == "time of":
        return _time_of(measure, times, series)
    return STATISTICS[measure.kind](times, series), ""


def _at(t: float, times: np.ndarray, series: np.ndarray) -> tuple[Any, str]:
    """Return the value at ``t``: that of an output time, or of a spline of degree 5 at most."""
    nearest = int(np.argmin(np.abs(times - t)))
    if abs(times[nearest] - t) <= SAME_TIME * abs(times[-1]):
        return series[nearest], ""
    if not times[0] <= t <= times[-1]:
        return None, f"the run is from {times[0]:g} to {times[-1]:g} s"
    from scipy.interpolate import make_interp_spline

    begin = max(0, min(nearest - 5, len(times) - 10))
    part = slice(begin, begin + 10)
    degree = min(5, len(times[part]) - 1)
    return make_interp_spline(times[part], series[part], k=degree)(t), ""


def _time_of(measure: Measure, times: np.ndarray, series: np.ndarray) -> tuple[Any, str]:
    """Return the first time at which a column passes a value, as ``msahl-post events`` finds it."""
    from msahl.post.events import DEGREES, first_crossing

    if len(times) <= DEGREES[0]:
        few = f"{len(times)} output times are too few to interpolate between them"
        return None, f"{few}; at least {DEGREES[0] + 1} are needed"
    found = first_crossing(times, series, measure.number)
    if found is None:
        return None, "the column does not pass the value"
    spread, interval = found.uncertainty, float(np.diff(times).max())
    if spread is not None and spread <= UNCERTAIN * interval:
        return found.time, ""
    known = f"{interval if spread is None else spread:.1g}"
    return found.time, f"uncertain by {known} s; give more output times"


def _figure(kind: str, report: Report) -> Any:
    """Return a figure of the report."""
    if kind == VERDICT:
        return report.verdict.get("word")
    if kind == POSITION_ERROR:
        return position_error(report)
    if kind == SECONDS:
        return report.seconds.get("loop")
    if kind in EXTREMES:
        return report.extremes.get(kind)
    return next(getattr(report, name) for name in COUNTS if camel_case(name) == kind)


def position_error(report: Report) -> float | None:
    """Return the estimated global error of the positions [m]; None if it is not known."""
    return _finite((report.error or {}).get("position"))


def _finite(value: Any) -> Any:
    """Return a number as Python's own; None instead of NaN and infinity."""
    if value is None or isinstance(value, str | int):
        return value
    number = float(value)
    return number if math.isfinite(number) else None
