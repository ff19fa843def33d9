"""Store the results of the experiment: outcomes.csv and conditions.csv."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tools.validation.csv_tables import read_records, write_records

HERE = Path(__file__).parent
OUTCOMES, CONDITIONS = HERE / "outcomes.csv", HERE / "conditions.csv"
DIGITS = 6


@dataclass(frozen=True)
class Outcome:
    """A run of a program at step size ``h`` [s]: the time ``reached`` [s] of ``t_final`` [s],
    ``why`` it ended earlier (None if it did not), its energy error over the weight's work along an
    arm, and the largest residual [SI] of its last step.
    """

    program: str
    t_final: float
    problem: str
    h: float
    reached: float
    why: str | None
    energy: float
    residual: float


@dataclass(frozen=True)
class Condition:
    """The condition number of the first step's Jacobian, with ``scaled`` unknowns or not."""

    problem: str
    h: float
    scaled: int
    condition: float


@dataclass(frozen=True)
class Results:
    """All results of the experiment."""

    outcomes: Sequence[Outcome]
    conditions: Sequence[Condition]


def write(results: Results) -> None:
    """Write both tables."""
    write_records(OUTCOMES, Outcome, results.outcomes, DIGITS)
    write_records(CONDITIONS, Condition, results.conditions, DIGITS)


def read() -> Results:
    """Return the stored results."""
    return Results(read_records(OUTCOMES, Outcome), read_records(CONDITIONS, Condition))
