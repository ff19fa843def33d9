"""Measures of the runs of a sweep: those of ``post.measures``; faults are faults of the plan."""

from collections.abc import Callable, Sequence
from typing import TypeVar

from msahl.model import Model
from msahl.post import measures
from msahl.post.measures import Measure, MeasureError
from msahl.sweep.faults import PlanError

Result = TypeVar("Result")


def parse_measures(texts: Sequence[str]) -> tuple[Measure, ...]:
    """Return the measures of some texts, each once; raises ``PlanError`` with all faults."""
    return _planned(lambda: measures.parse_measures(texts))


def require_columns(wanted: Sequence[Measure], model: Model) -> None:
    """Raise ``PlanError`` unless a run of the ``model`` has the columns of all measures."""
    _planned(lambda: measures.require_columns(wanted, model))


def _planned(call: Callable[[], Result]) -> Result:
    try:
        return call()
    except MeasureError as error:
        raise PlanError(*(f"--measure {fault}" for fault in error.faults)) from None
