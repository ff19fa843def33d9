"""Solves collocation steps by scipy; see ``schemes.common.scipy_root``.

The unknowns z (f s,) hold the s stages of each free unknown next to each other.
"""

from typing import Any

import numpy as np

from msahl.elements.constraints.scalar import clear_rate_violations
from msahl.formulations.absolute.frames import first_multiplier
from msahl.jit.compiled import Call, compiled
from msahl.schemes.collocation import newton, predictor
from msahl.schemes.collocation.newton import CollocationWorkspace
from msahl.schemes.common import scipy_root
from msahl.schemes.common.scipy_root import CountWork, StepEquations, polish
from msahl.schemes.outcome import Outcome

_evaluate = compiled(newton.evaluate_free)
_predict = compiled(predictor.predict)
_accept_step = compiled(newton.accept_step)


class _Equations(StepEquations):
    """The equations of a collocation step."""

    def __init__(self, subsystem: CollocationWorkspace, h: float, count_work: CountWork) -> None:
        super().__init__(subsystem.workspace, h, count_work)
        self.subsystem, self.shape = subsystem, subsystem.y.shape  # (f, s)

    def predict(self) -> np.ndarray:
        """See ``StepEquations``."""
        _predict(*_parts(self.subsystem), self.h)
        stages, free = self.subsystem.stages.Z, self.workspace.unknowns.free
        return stages.reshape(self.shape[1], -1)[:, free].T.reshape(-1)

    def evaluate(self, z: np.ndarray, f: np.ndarray) -> Any:
        """See ``StepEquations``."""
        stages, rows = z.reshape(self.shape), f.reshape(self.shape)
        return _evaluate(self.subsystem, self.h, stages, rows, False)

    def derivative(self, z: np.ndarray) -> np.ndarray:
        """See ``StepEquations``."""
        _evaluate(self.subsystem, self.h, z.reshape(self.shape), np.empty(self.shape), True)
        return jacobian(self.subsystem)

    def remove_null_parts(self, z: np.ndarray) -> None:
        """See ``StepEquations`` and ``newton.remove_null_multipliers``."""
        held = self.is_multiplier()[:, np.newaxis]
        rows = np.where(held, self._relaxation_rows(z.reshape(self.shape)), 0.0)
        part = np.linalg.lstsq(self.jacobian(z), rows.reshape(-1), rcond=None)[0]
        z -= np.where(held, part.reshape(self.shape), 0.0).reshape(-1)
        polish(self, z, always=True)

    def accept(self, z: np.ndarray) -> None:
        """See ``StepEquations``."""
        A = self.jacobian(z) if self.workspace.system.relaxation > 0.0 else None
        _accept_step(self.subsystem, self.h)
        if A is not None:
            self._remove_null_violation(A)

    def _relaxation_rows(self, z: np.ndarray) -> np.ndarray:
        """(f, s) minus the relaxation part of the Jacobian times unknowns ``z`` (f, s)."""
        relaxation, chi = self.workspace.system.relaxation, self.subsystem.stages.tableau.chi
        rows: np.ndarray = 2.0 * relaxation * (z @ chi.T)
        return rows

    def _remove_null_violation(self, A: np.ndarray) -> None:
        """As ``newton.remove_null_violation``, by the Jacobian ``A``."""
        workspace, rows = self.workspace, np.zeros(self.shape)
        held, violation = self.is_multiplier(), workspace.state.violation.reshape(-1)
        place = workspace.unknowns.free[held] - 3 * first_multiplier(workspace.system.frames)
        rows[held, -1] = violation[place]
        answer = np.linalg.lstsq(A, rows.reshape(-1), rcond=None)[0].reshape(self.shape)
        violation[place] -= self._relaxation_rows(answer)[held, -1]
        clear_rate_violations(workspace.system.scalar, workspace.state.violation)


def _parts(subsystem: CollocationWorkspace) -> tuple[Any, ...]:
    workspace = subsystem.workspace
    return workspace.system, workspace.state, workspace.start, subsystem.stages


def calls(subsystem: CollocationWorkspace) -> list[Call]:
    """Return the compiled functions that a step needs, with arguments; see ``Stepper.calls``."""
    z = np.empty((1, 1))
    return [
        (_evaluate, (subsystem, 0.0, z, z, True)),
        (_predict, (*_parts(subsystem), 0.0)),
        (_accept_step, (subsystem, 0.0)),
    ]


def take_step(
    subsystem: CollocationWorkspace, h: float, count_work: CountWork = lambda work: None
) -> Outcome:
    """Take a step of size ``h`` if it converges; ``count_work`` receives the work done."""
    return scipy_root.take_step(_Equations(subsystem, h, count_work))


def jacobian(subsystem: CollocationWorkspace) -> np.ndarray:
    """(f s, f s) the Jacobian evaluated last; the stages of each unknown are next to each other."""
    unknowns, stages, (f, s) = subsystem.workspace.unknowns, subsystem.stages, subsystem.y.shape
    A = np.zeros((f * f, s, s))
    A[unknowns.dense_to] = stages.values[stages.slot[unknowns.dense_from]]
    return A.reshape(f, f, s, s).transpose(0, 3, 1, 2).reshape(f * s, f * s)
