"""Define the task of a study and the record of one of its runs."""

from msahl.model import Model
from msahl.model.scheme import EXPLICIT, choices
from msahl.records import record
from msahl.study.errors import STATE_KEYS, Errors
from msahl.study.runs import Trial

REFERENCE_ACCURACY = 1e-6
"""Accuracy of the reference [m] if the target is not a position error."""
BUDGET = 10.0
"""Default time that a study may take [s]."""


@record(slots=False)
class Plan:
    """What to study. ``target`` is the largest accepted value of the error ``metric``, in its unit.

    Without ``steps``, step sizes are chosen within the ``budget`` [s]. Each run is repeated
    ``repeats`` times; None means as often as the time allows.
    """

    model: Model
    steps: tuple[float, ...] = ()
    schemes: tuple[str, ...] = ()
    reference: str = "auto"
    repeats: int | None = None
    target: float = 1e-6
    metric: str = "position"
    budget: float = BUDGET

    @property
    def accuracy(self) -> float:
        """Return the accuracy that the reference must have [m]."""
        return self.target if self.metric == "position" else REFERENCE_ACCURACY

    @property
    def needs_only_states(self) -> bool:
        """Return whether the metric needs only the states, whose errors are computed fast."""
        return self.metric in STATE_KEYS

    @property
    def studied(self) -> tuple[str, ...]:
        """Return the schemes to run."""
        return self.schemes or tuple(word for word in choices() if word not in EXPLICIT)


@record(slots=False)
class StudyRun:
    """A run of a study with its errors.

    ``complete`` says that all errors were computed, not only those of the states. ``estimate`` is
    the position error [m] that the run estimated itself.
    """

    trial: Trial
    errors: Errors
    complete: bool = True
    estimate: float | None = None

    def largest(self, key: str) -> float | None:
        """Return the largest value of the error metric ``key``; None if it is not known."""
        statistics = self.errors.statistics[key]
        return None if statistics is None else statistics.max

    def meets(self, key: str, target: float) -> bool:
        """Return whether the run was completed with an error of at most ``target``."""
        error = self.largest(key)
        return self.trial.completed and error is not None and error <= target
