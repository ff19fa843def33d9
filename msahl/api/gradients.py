"""Derivatives of measures of a run by numbers of its deck, with their errors.

The steps of the run are taken once more with their tangents (``analysis.gradients.run``); a second
time with pairs of them joined, and the difference is the error of the scheme.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from msahl.analysis.gradients.neighbouring_runs import RunModel
from msahl.analysis.gradients.parameter_neighbours import DeckNumbers
from msahl.analysis.gradients.start import NotDifferentiable
from msahl.analysis.gradients.step_sequence import StepRecord, halved, merged, of_rows, undivided
from msahl.analysis.gradients.tables import TableGradients, TangentModel
from msahl.api.derivatives import GradientError, Gradients
from msahl.api.result import Result
from msahl.api.running import at_start, run_job
from msahl.deck.overrides import FoundNumber
from msahl.model import Model
from msahl.model.scheme import COLLOCATION
from msahl.model.settings import OFF
from msahl.post.measure_gradients import Series, derivative, is_tied, rows_needed
from msahl.post.measures import (
    DISPLACEMENT,
    Measure,
    MeasureError,
    components,
    evaluate_columns,
    parse_measures,
    require_columns,
    tables_needed,
    tables_with_columns,
)
from msahl.printable import printable
from msahl.records import record
from msahl.results.job import Job
from msahl.run.column_units import quantity
from msahl.run.companion import SAFETY
from msahl.run.loop import Hooks
from msahl.run.report import COMPLETED
from msahl.run.tables import ERROR, tables_of_model

GROWN = 6.0
"""Growth of the derivatives of positions from each quarter of a run to the next, in the second to
the last, from which on it is reported, and its fourth power from the first to the last: as the
third power of the time they grow by 3.4 and 2.4, and by 64."""
FAR = 0.1
"""Change of positions, over the longest length of a frame, up to which derivatives describe it."""
SLACK = 1e-3
"""Correction left in a step, relative to it, from which on it is reported."""


@record(slots=False)
class Request:
    """The ``measures`` to be differentiated, and the ``columns`` at all output times, by the
    ``numbers`` of the deck by name."""

    measures: tuple[Measure, ...]
    columns: tuple[str, ...]
    numbers: Mapping[str, FoundNumber]
    deck: DeckNumbers

    @property
    def tables(self) -> list[str]:
        """The tables with the columns of the measures."""
        of_columns = (Measure(column, "", column) for column in self.columns)
        return tables_needed([*self.measures, *of_columns], self.deck.job.model)


def make_request(
    job: Job, measures: Sequence[str], wrt: Sequence[str], columns: Sequence[str] = ()
) -> Request:
    """Return what is to be differentiated; raises ``GradientError`` with all faults."""
    faults: list[str] = []
    wanted: tuple[Measure, ...] = ()
    try:
        wanted = parse_measures(measures)
        require_columns(wanted, job.model)
    except MeasureError as error:
        faults += [f"gradient {fault}" for fault in error.faults]
    for measure in wanted:
        of_errors = measure.column and tables_needed([measure], job.model) == [ERROR]
        if not measure.column or of_errors:
            faults.append(
                f"gradient '{measure.text}': it has no derivative here; name a column of the "
                "tables of the motion, such as 'Tip.z final'"
            )
        elif measure.column.startswith(DISPLACEMENT):
            faults.append(
                f"gradient '{measure.text}': displacements have no derivative here; name the "
                "column, such as 'Tip.z final'"
            )
    deck, numbers = DeckNumbers(job), {}
    for name in dict.fromkeys(wrt):
        try:
            numbers[name] = deck.find(name)
        except LookupError as error:
            faults.append(f"wrt '{printable(name)}': {error.args[0]}")
    if not wanted and not columns and not faults:
        faults.append("gradient: name a measure, such as 'Tip.z final'")
    if not numbers and not faults:
        faults.append("wrt: name a parameter of the deck, or a number such as Bob.mass")
    if faults:
        raise GradientError("\n".join(faults))
    return Request(wanted, tuple(columns), numbers, deck)


def differentiate(
    request: Request,
    record: StepRecord,
    report: Mapping[str, Any],
    table: Callable[[str], np.ndarray],
) -> Gradients:
    """Return the derivatives of the measures of a completed run with this ``report``, whose steps
    are in ``record``; ``table`` returns its rows by the table's name. Raises ``GradientError``.
    """
    if report["status"] != COMPLETED or not record.complete:
        why = report.get("message") or "it was resumed"
        raise GradientError(f"gradient: the run was not made from t = 0 to its end: {why}")
    job = request.deck.job
    found, reasons = evaluate_columns(request.measures, job.model, table)
    values = np.array([math.nan if (v := found[m.text]) is None else v for m in request.measures])
    if len(values) and np.isnan(values).all():
        raise GradientError(f"gradient: {reasons or 'no measure has a value'}")
    try:
        work, remarks = (
            _Work(request, record, values, bool(report.get("stop"))),
            [reasons] * bool(reasons),
        )
        try:
            return work.gradients(remarks)
        except NotDifferentiable:
            # Equal constants of expressions are one constant, but not in models near this one.
            moved = replace(request, deck=request.deck.moved(request.numbers))
            return _Work(moved, record, values, work.free).gradients(remarks)
    except NotDifferentiable as error:
        raise GradientError(f"gradient: {error}") from None


def run_with_gradients(job: Job, measures: str | Sequence[str], wrt: str | Sequence[str]) -> Result:
    """Run a ``job`` and return its results with their gradient; raises ``GradientError``."""
    job = at_start(job)
    texts, tables = texts_of(measures), tables_of_model(job.model)
    columns = [text for text in texts if components(text, tables)]
    texts = [text for text in texts if text not in columns]
    request = make_request(job, texts, texts_of(wrt), columns)
    record = StepRecord()
    result = run_job(job, hooks=Hooks(accepted=record.add))
    result.gradient = differentiate(request, record, result.report, result.array)
    result.report["gradients"] = result.gradient.as_json()
    return result


def texts_of(given: str | Sequence[str]) -> list[str]:
    """Return names or measures, which may stand in one text between commas."""
    texts = [given] if isinstance(given, str) else given
    return [part.strip() for text in texts for part in text.split(",") if part.strip()]


_JUMPS = (
    "by t = {:g} s the expression of {} jumps at a time that the derivatives do not follow: in a "
    "step that is not divided there, as where the motion slides, or by reactions of joints; "
    "derivatives of what comes later are wrong. Give the jump a width, as with tanh(x/w)"
)

_AT_EVENTS = (
    "at t = {} s an impact or event is at the output time, before it or after it by the "
    "parameters: there are no derivatives"
)


def _differentiable(request: Request) -> TangentModel | RunModel:
    """Return the model with what is near it: where constraints change, or steps are explicit, by
    complete runs.
    """
    job, deck = request.deck.job, request.deck
    model, settings, numbers = job.model, job.settings, request.numbers.items()
    if model.contacts or model.events or model.switched or settings.explicit:
        return RunModel(model, settings, [deck.nearby(*of) for of in numbers])
    return TangentModel(model, settings, [deck.neighbours(*of) for of in numbers])


class _Work:
    """Derivatives along the steps of a run, and along pairs of them."""

    def __init__(
        self, request: Request, record: StepRecord, values: np.ndarray, free: bool
    ) -> None:
        self.request, self.record, self.values, self.free = request, record, values, free
        job, self.times = request.deck.job, np.array(record.times)
        self.model = _differentiable(request)
        self.needed = [
            rows_needed(measure, self.times, value) if math.isfinite(value) else range(0)
            for measure, value in zip(request.measures, values, strict=True)
        ]
        if request.columns:
            self.needed.append(range(len(self.times)))
        self.columns = tables_with_columns(job.model)
        self.remarks: list[str] = []

    def gradients(self, remarks: list[str]) -> Gradients:
        """Return the derivatives with their errors."""
        self.remarks = remarks
        steps = of_rows(self.record.steps, self._all_rows(self.needed))
        if self.by_runs:
            steps = undivided(steps)
        fine = self._along(steps)
        self._judge(fine)
        jacobian = self._jacobian(fine, self.needed, True)
        return Gradients(
            tuple(measure.text for measure in self.request.measures),
            tuple(self.request.numbers),
            self.values,
            jacobian,
            self._errors(fine, steps, jacobian),
            self._units(),
            {name: self._of_column(name, fine) for name in self.request.columns},
            tuple(self.remarks),
        )

    @property
    def by_runs(self) -> bool:
        """Whether derivatives are those of complete runs."""
        return isinstance(self.model, RunModel)

    def _all_rows(self, needed: Sequence[range]) -> set[int]:
        return {row for rows in needed for row in rows}

    def _along(
        self, steps: Sequence[Any], halved: bool = False
    ) -> tuple[TableGradients, dict[int, int]]:
        """Return the gradients along ``steps``, which may be ``halved`` ones, and the place of each
        row in them.
        """
        rows = sorted({row for step in steps for row in step.rows} | self._start())
        times = {row: float(self.times[row]) for row in rows}
        given = steps, times, self.request.tables, self.free
        if isinstance(self.model, RunModel):
            gradients = self.model.along(*given, halved)
        else:
            gradients = self.model.along(*given)
        return gradients, {row: i for i, row in enumerate(rows)}

    def _start(self) -> set[int]:
        return self._all_rows(self.needed) & {0}

    def _jacobian(
        self,
        along: tuple[TableGradients, dict[int, int]],
        needed: Sequence[Sequence[int]],
        remarked: bool,
    ) -> np.ndarray:
        """Return the derivatives (m, n) of the measures from the ``needed`` rows of each."""
        found, place = along
        jacobian = np.full((len(self.values), len(found.end)), math.nan)
        for i, measure in enumerate(self.request.measures):
            if not len(needed[i]):
                continue
            if self._is_undetermined(measure, found, remarked):
                continue
            at = [place[row] for row in needed[i]]
            series = self._series(measure, found, at)
            jacobian[i] = derivative(measure, series, self.values[i])
            if remarked and not np.isfinite(jacobian[i]).all():
                self.remarks.append(f"{measure.text}: it has no derivative where its value is zero")
            if remarked and is_tied(measure, series):
                self.remarks.append(
                    f"{measure.text}: several output times have this value; the derivative is that "
                    "at the first of them"
                )
        return jacobian

    def _of_column(self, column: str, along: tuple[TableGradients, dict[int, int]]) -> np.ndarray:
        """Return the derivatives (rows, n) of a column at all output times."""
        at = [along[1][row] for row in range(len(self.times))]
        return self._series(Measure(column, "", column), along[0], at).slopes.T

    def _is_undetermined(self, measure: Measure, found: TableGradients, remarked: bool) -> bool:
        """Whether a measure is one of reactions that are not unique; say so if it is to be
        ``remarked``."""
        places = components(measure.column, self.columns)
        names = {self.columns[table][index] for table, index in places}
        if remarked and names & found.not_unique:
            self.remarks.append(
                f"{measure.text}: it has no derivative here, as redundant joints leave "
                f"{', '.join(sorted(names & found.not_unique))} undetermined"
            )
        return bool(names & found.not_unique)

    def _series(self, measure: Measure, found: TableGradients, at: list[int]) -> Series:
        """Return the column of a measure, or the norm of a vector, in the rows ``at``."""
        places = components(measure.column, self.columns)
        table = places[0][0]
        times = found.rows[table][at, 0]
        values = np.stack([found.rows[table][at, index] for _, index in places])
        slopes = np.stack([found.slopes[table][:, at, index] for _, index in places])
        if len(places) == 1:
            return Series(times, values[0], slopes[0], found.end)
        norm = np.linalg.norm(values, axis=0)
        with np.errstate(all="ignore"):
            of_norm = np.einsum("cm,cnm->nm", values, slopes) / norm
        return Series(times, norm, of_norm, found.end)

    def _errors(
        self,
        fine: tuple[TableGradients, dict[int, int]],
        steps: Sequence[Any],
        jacobian: np.ndarray,
    ) -> np.ndarray:
        """Return the estimated errors (m, n): by Richardson's extrapolation from steps of twice the
        size, or of half of it where complete runs are compared, with the measures of those rows
        that both have; nan if no errors are wanted.
        """
        if not len(self.values) or self.model.settings.error == OFF:
            return np.full_like(jacobian, math.nan)
        size = "half" if self.by_runs else "twice"
        try:
            other = self._along(halved(steps), True) if self.by_runs else self._along(merged(steps))
        except NotDifferentiable:
            self.remarks.append(
                f"the errors are not known: steps of {size} the size cannot be solved"
            )
            return np.full_like(jacobian, math.nan)
        shared = [[row for row in rows if row in other[1]] for rows in self.needed]
        difference = self._jacobian(fine, shared, False) - self._jacobian(other, shared, False)
        settings, degree = self.model.settings, min(step.degree for step in steps)
        known = settings.family in COLLOCATION and degree
        order = COLLOCATION[settings.family].order(degree) if known else settings.order
        # Of halves nearly all of the difference is the error, whatever the order comes to at kinks.
        share = 1.0 - 0.5**order if self.by_runs else 2.0**order - 1.0
        errors: np.ndarray = SAFETY * np.abs(difference) / share
        return errors

    def _judge(self, fine: tuple[TableGradients, dict[int, int]]) -> None:
        """Add what the growth of the derivatives and the corrections left say."""
        found, t = fine[0], float(self.times[-1])
        if found.at_events.size:
            shown = ", ".join(f"{t:g}" for t in found.at_events[:3])
            self.remarks.append(_AT_EVENTS.format(shown))
        if found.jumped < math.inf:
            self.remarks.append(_JUMPS.format(found.jumped, found.jumping or "a signal"))
        for j, name in enumerate(self.request.numbers):
            if found.left[j] > SLACK:
                self.remarks.append(
                    f"{name}: the tangents of a step are not solved better than "
                    f"{found.left[j]:.1g} of themselves"
                )
            first, second, third, last = (
                float(part[:, j].max(initial=0.0)) for part in np.array_split(found.sizes, 4)
            )
            steadily = third > GROWN * second and last > GROWN * third
            if second > 0.0 and (steadily or 1e9 * first > last > GROWN**4 * first):
                folding, units = 0.5 * t / math.log(last / second), self.request.numbers[name].shown
                self.remarks.append(
                    f"{name}: the derivatives grow {last / second:.0f}-fold in the second half of "
                    f"the run, by e in {folding:.2g} s, so the motion is unstable or chaotic; they "
                    f"describe changes of {name} up to about {FAR / last:.1g} {units}".rstrip()
                )

    def _units(self) -> tuple[tuple[str, ...], ...]:
        return tuple(
            tuple(
                _unit(measure, number, self.model.model) for number in self.request.numbers.values()
            )
            for measure in self.request.measures
        )


def _unit(measure: Measure, number: FoundNumber, model: Model) -> str:
    """Return the unit of a derivative: of the measure, by that of the number in the deck."""
    unit, shown = "s", number.shown
    if measure.kind != "time of":
        alone, of_vector = (quantity(measure.column + end, model).unit for end in ("", "x"))
        unit = alone or of_vector
    if not shown:
        return unit
    compound = any(mark in shown for mark in "/- ")
    return f"{unit or '1'}/({shown})" if compound else f"{unit or '1'}/{shown}"
