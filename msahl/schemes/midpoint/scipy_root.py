"""Solves steps of order 2 by scipy; see ``schemes.common.scipy_root``."""

from typing import Any

import numpy as np

from msahl.jit.compiled import Call, compiled
from msahl.schemes.common import scipy_root
from msahl.schemes.common.scipy_root import REPAIRS, CountWork, StepEquations
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.midpoint import free_equations, load_moments, newton
from msahl.schemes.outcome import Outcome

_set_loads = compiled(load_moments.set_loads)
_predict = compiled(free_equations.predict)
_residual = compiled(free_equations.residual)
_jacobian = compiled(free_equations.jacobian)
_accept_step = compiled(newton.accept_step)


class Equations(StepEquations):
    """The equations of a step that is a ``share`` of the requested one."""

    def __init__(self, workspace: Workspace, h: float, share: float, count_work: CountWork) -> None:
        super().__init__(workspace, h, count_work)
        self.share = share

    def predict(self) -> np.ndarray:
        """See ``StepEquations``."""
        z = np.empty(self.workspace.unknowns.free.size)
        _predict(self.workspace, self.h, z)
        return z

    def evaluate(self, z: np.ndarray, f: np.ndarray) -> Any:
        """See ``StepEquations``."""
        return _residual(self.workspace, self.h, z, f)

    def derivative(self, z: np.ndarray) -> np.ndarray:
        """See ``StepEquations``."""
        A = np.empty(z.size * z.size)
        _jacobian(self.workspace, self.h, z, A)
        return A.reshape(z.size, z.size)

    def remove_null_parts(self, z: np.ndarray) -> None:
        """See ``StepEquations``, ``newton.remove_null_multipliers`` and ``remove_null_violation``.

        Powell's updates drift where the residual does not see them; steps of Newton's method repair
        what the smallest multipliers cost the others.
        """
        relaxation, is_multiplier = self.workspace.system.relaxation, self.is_multiplier()
        A = self.jacobian(z)
        part = np.linalg.solve(A, np.where(is_multiplier, -relaxation * z, 0.0))
        z -= np.where(is_multiplier, part, 0.0)
        f = self.residual(z)
        for _ in range(REPAIRS):
            z -= np.linalg.solve(A, f)
            f = self.residual(z)
        multipliers = self.workspace.unknowns.free[is_multiplier]
        violation = np.linalg.solve(A, f)[z.size - multipliers.size :]
        self.workspace.F.reshape(-1)[multipliers] += relaxation * violation

    def accept(self, z: np.ndarray) -> None:
        """See ``StepEquations``; the solution is in the workspace."""
        _accept_step(self.workspace, self.h, self.share)


def calls(workspace: Workspace) -> list[Call]:
    """Return the compiled functions that a step needs, with arguments; see ``Stepper.calls``."""
    z = np.empty(0)
    return [
        (_set_loads, (workspace, 0.0)),
        (_predict, (workspace, 0.0, z)),
        (_residual, (workspace, 0.0, z, z)),
        (_jacobian, (workspace, 0.0, z, z)),
        (_accept_step, (workspace, 0.0, 0.0)),
    ]


def take_step(
    workspace: Workspace, h: float, share: float, count_work: CountWork = lambda work: None
) -> Outcome:
    """Take a step of size ``h``, a ``share`` of the requested one, if it converges."""
    _set_loads(workspace, h)
    return scipy_root.take_step(Equations(workspace, h, share, count_work))
