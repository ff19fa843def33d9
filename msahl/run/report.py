"""The report on a run: what happened, as ``run.json`` has it."""

from dataclasses import dataclass, field, fields
from functools import cache
from typing import Any

from msahl.run.verdict import not_started

COMPLETED, INTERRUPTED = "completed", "interrupted"
NOT_CONVERGED, NOT_WRITTEN, NOT_STARTED = "not converged", "not written", "not started"
"""How a run ended."""


@dataclass(slots=True)
class Report:
    """What happened; becomes ``run.json``."""

    status: str = "running"
    message: str = ""
    output_times: int = 0
    steps: int = 0
    time: float = 0.0
    joints: int = 0
    subsystems: int = 0
    planar_subsystems: int = 0
    tree_subsystems: int = 0  # those stepped in joint coordinates
    unknowns: int = 0
    degrees_of_freedom: dict[str, int] = field(default_factory=dict)
    non_unique_reactions: dict[str, list[str]] = field(default_factory=dict)
    iterations: int = 0
    factorisations: int = 0
    scipy_steps: int = 0
    path_steps: int = 0
    subdivisions: int = 0
    warnings: list[str] = field(default_factory=list)
    resumed: list[float] = field(default_factory=list)
    contacts: dict[str, Any] | None = None  # impacts, energy they took [J], which are closed
    events: dict[str, Any] | None = None  # how often each happened, messages, what is engaged
    stop: dict[str, Any] | None = None  # time [s] and condition of a run that ended before t_final
    seconds: dict[str, float] = field(default_factory=dict)
    extremes: dict[str, float | None] = field(default_factory=dict)
    step_control: dict[str, Any] | None = None
    error: dict[str, Any] | None = None
    verdict: dict[str, Any] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """The fields by their names in ``run.json``, which are camelCase."""
        return {name: _copied(getattr(self, field)) for field, name in _names()}

    def add_seconds(self, phase: str, seconds: float) -> None:
        """Add time to that of a ``phase`` of the run."""
        self.seconds[phase] = self.seconds.get(phase, 0.0) + seconds

    def end(self, status: str, message: str) -> None:
        """Note how the run ended."""
        self.status, self.message = status, message


@cache
def _names() -> tuple[tuple[str, str], ...]:
    """Return the fields of a report, and their names in ``run.json``."""
    return tuple((field.name, camel_case(field.name)) for field in fields(Report))


def _copied(value: Any) -> Any:
    """Return a copy of nested lists and dictionaries, in a tenth of the time of ``deepcopy``."""
    if isinstance(value, dict):
        return {key: _copied(part) for key, part in value.items()}
    return [_copied(part) for part in value] if isinstance(value, list) else value


def camel_case(name: str) -> str:
    """A name with underscores in camelCase."""
    first, *rest = name.split("_")
    return first + "".join(word.capitalize() for word in rest)


def report_without_steps(status: str, message: str) -> Report:
    """The report on a run that took no step."""
    return Report(status=status, message=message, verdict=not_started(status).as_json())
