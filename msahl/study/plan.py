"""What a study is to do, and the runs it has made."""

from dataclasses import dataclass

from msahl.model import Model
from msahl.model.scheme import choices
from msahl.study.errors import STATE_KEYS, Errors
from msahl.study.runs import Trial

ACCURACY = 1e-6
"""Asked of the reference [m] where the target is not a position."""
BUDGET = 10.0
"""Seconds that a study may take."""


@dataclass(frozen=True)
class Plan:
    """What to study; ``measure`` is what the ``target`` is of, in its unit, its largest value.

    Without ``steps`` they are chosen within the ``budget`` [s]. ``repeats`` of each run; None
    leaves them to the time there is.
    """

    model: Model
    steps: tuple[float, ...] = ()
    schemes: tuple[str, ...] = ()
    reference: str = "auto"
    repeats: int | None = None
    target: float = 1e-6
    measure: str = "position"
    budget: float = BUDGET

    @property
    def accuracy(self) -> float:
        """What the reference must be good for [m]."""
        return self.target if self.measure == "position" else ACCURACY

    @property
    def of_states(self) -> bool:
        """Whether the target is of states, whose errors take little time."""
        return self.measure in STATE_KEYS

    @property
    def studied(self) -> tuple[str, ...]:
        """The schemes to run."""
        return self.schemes or choices()


@dataclass(frozen=True)
class Point:
    """A trial and its errors; ``complete`` if these are all there are, and not of states alone;
    ``estimate`` is the error in position [m] that the run itself says it has.
    """

    trial: Trial
    errors: Errors
    complete: bool = True
    estimate: float | None = None

    def largest(self, key: str) -> float | None:
        """Largest error of a kind."""
        spread = self.errors.figures[key]
        return None if spread is None else spread.max

    def keeps(self, key: str, target: float) -> bool:
        """Whether it came to its end with an error within the ``target``."""
        error = self.largest(key)
        return self.trial.completed and error is not None and error <= target
