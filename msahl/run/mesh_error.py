"""The error of a run by the mesh of its beams: a run of a finer mesh takes the same steps.

    |y - y_exact|  <=  SAFETY |y - y*|        y* of elements of the next degree

Elements of degree p have an error that falls with the power 2 p of their length, so y* has little
of it. Both runs take the same steps, and the errors of these are nearly the same in both, so they
do not count here. Positions are compared where both have nodes: at the ends of elements, and at
all other bodies.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from msahl.beams.places import Place, common_places
from msahl.model import Model, RunSettings
from msahl.run.companion import SAFETY, Steps, advance, first_rows, with_given_steps
from msahl.run.error_history import ErrorHistory
from msahl.run.subsystem import Shared, SubsystemIntegrator
from msahl.schemes.output_schedule import OutputSchedule
from msahl.system.subsystems import split


class FinerMesh(NamedTuple):
    """A ``model`` with a finer mesh of its beams, or why there is ``none``."""

    model: Model | None
    none: str = ""


class MeshError:
    """The estimate while the run goes on: the ``largest`` error [m], and whether the run of the
    finer mesh has ``stopped``; its ``history`` says until when it is known.
    """

    def __init__(
        self,
        model: Model,
        finer: FinerMesh,
        integrators: Sequence[SubsystemIntegrator],
        settings: RunSettings,
        chunk: int,
    ) -> None:
        self.why, self.largest, self.stopped = finer.none, 0.0, False
        self.history = ErrorHistory()
        self.integrators: list[SubsystemIntegrator] = []
        self.elements = sum(len(beam.lengths) for beam in model.beams)
        self.degree = min(beam.degree for beam in model.beams)
        if finer.model is None:
            return
        together = settings.full or settings.adaptive
        first = integrators[0]
        self.integrators = [
            SubsystemIntegrator(
                with_given_steps(subsystem, settings, first.stepper.method.degree),
                first.solver,
                settings.full,
                chunk,
                shared=Shared(first.storages),
            )
            for subsystem in ([finer.model] if together else split(finer.model))
        ]
        mine, other = (_places(group) for group in (integrators, self.integrators))
        self.pairs = [(mine[place], other[place]) for place in mine if place in other]
        for integrator in self.integrators:
            integrator.stepper.vary_sizes(settings.adaptive)
            integrator.show_start()

    def begin(self, integrators: Sequence[SubsystemIntegrator]) -> np.ndarray:
        """Compare the rows at t = 0; return as ``follow``."""
        return self._compare(integrators, np.zeros(1))

    def follow(
        self,
        integrators: Sequence[SubsystemIntegrator],
        steps: Steps,
        schedule: OutputSchedule,
        times: np.ndarray,
    ) -> np.ndarray:
        """Let the finer mesh follow the ``steps`` of the run; return the estimated errors (m,) [m]
        of positions in the rows of the ``schedule``, at ``times``; 0 where they are not known.
        """
        for k, integrator in enumerate(self.integrators if not self.stopped else []):
            other = integrators[min(k, len(integrators) - 1)]
            integrator.stepper.follow(other.stepper, len(steps.sizes), 1)
            self.stopped = self.stopped or not advance(integrator, steps.sizes, schedule)
        return self._compare(integrators, times)

    def _compare(self, integrators: Sequence[SubsystemIntegrator], times: np.ndarray) -> np.ndarray:
        errors = np.zeros(len(times))
        if self.stopped or not len(times) or not self.integrators:
            return errors
        mine, other = (
            [first_rows(one, len(times)).states for one in group]
            for group in (integrators, self.integrators)
        )
        for (i, a), (j, b) in self.pairs:
            apart = mine[i][:, 12 * a : 12 * a + 3] - other[j][:, 12 * b : 12 * b + 3]
            errors = np.maximum(errors, SAFETY * np.linalg.norm(apart, axis=1))
        # A neighbour of the run is nearer to it than the model is large.
        positions = np.concatenate([_positions(rows) for rows in mine])
        if not errors.max() <= np.linalg.norm(np.ptp(positions, axis=0)):
            self.stopped = True
            return np.zeros(len(times))
        self.history.note(errors, times)
        self.largest = max(self.largest, float(errors.max()))
        return errors

    @property
    def known(self) -> bool:
        """Whether the error is known to the end of the run."""
        return bool(self.integrators) and not self.stopped

    def as_json(self) -> dict[str, Any]:
        """The figures by their names in ``run.json``."""
        until = self.history.until
        unknown = self.why or f"the run of a finer mesh did not follow it after t = {until:g} s"
        found: dict[str, Any] = {"elements": self.elements, "degree": self.degree}
        found |= {"error": self.largest} if self.integrators else {}
        return found if self.known else {**found, "unknown": unknown}

    def numbers(self) -> dict[str, Any]:
        """All figures so far, for a snapshot."""
        return {"largest": self.largest, "stopped": self.stopped, **self.history.numbers()}

    def restore(self, numbers: dict[str, Any]) -> None:
        """Restore what ``numbers`` returned."""
        self.largest, self.stopped = numbers["largest"], numbers["stopped"]
        self.history.restore(numbers)


def _positions(states: np.ndarray) -> np.ndarray:
    """(n, 3) positions of all bodies in rows of states (m, 12 b)."""
    return states.reshape(-1, 12)[:, :3]


def _places(integrators: Sequence[SubsystemIntegrator]) -> dict[Place, tuple[int, int]]:
    """Subsystem and number of the body at each place."""
    return {
        place: (k, index)
        for k, integrator in enumerate(integrators)
        for place, index in common_places(integrator.model).items()
    }
