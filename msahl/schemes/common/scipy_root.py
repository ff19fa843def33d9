"""Solves steps by ``scipy.optimize.root``: as the reference, and where Newton's method fails.

Powell's hybrid method with the analytic Jacobian. It stops on the relative change of the iterate
and reports a failure at rounding errors, so the relative residual of the scheme's own equations
decides whether the step is solved.

A scheme that can be solved so is a subclass of ``StepEquations``, in n unknowns. It must

1. predict the unknowns from the state at the start in ``predict``;
2. in ``evaluate``, set the n rows at given unknowns and return the relative residual, the index of
   its worst row and the length of the step [m], as its compiled Newton's method judges them;
3. return the (n, n) derivative of these rows in ``derivative``;
4. remove from a root what redundant constraints leave undetermined in ``remove_null_parts``, and
   evaluate the rows at the result;
5. advance the state by the step that was evaluated last in ``accept``.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.formulations.absolute.frames import first_multiplier
from msahl.schemes.common import hybrid_method
from msahl.schemes.common.criteria import is_implausible
from msahl.schemes.common.workspace import Workspace
from msahl.schemes.outcome import EVALUATION, Outcome

STEP_TOLERANCE = 1e-11
"""Relative change at which ``hybr`` stops; it converges superlinearly, so the residual is far
smaller by then."""
REPAIRS = 3
"""Newton steps after ``hybr``. Each gains at least three digits: the relaxation relative to the
compliances of the joints."""
MOST_REPAIRS = 20
"""Most Newton steps where these left a residual below ``NEARLY``. Where redundant contacts slide,
and all but stick, each gains one digit only."""
NEARLY = 1e-6

CountWork = Callable[[int], None]


class StepEquations(ABC):
    """One step of size ``h`` in its free unknowns, and how well it is solved; see the module.

    ``count_work`` receives the work done.
    """

    def __init__(self, workspace: Workspace, h: float, count_work: CountWork) -> None:
        self.workspace, self.h, self.count_work = workspace, h, count_work
        self.outcome, self.length = Outcome(0.0, -1), 0.0

    @abstractmethod
    def predict(self) -> np.ndarray:
        """Return the predicted unknowns (n,)."""

    @abstractmethod
    def evaluate(self, z: np.ndarray, f: np.ndarray) -> Any:
        """Set the rows ``f`` at ``z``; return relative residual, worst row and length [m]."""

    @abstractmethod
    def derivative(self, z: np.ndarray) -> np.ndarray:
        """Return the derivative (n, n) of these equations at ``z``."""

    @abstractmethod
    def remove_null_parts(self, z: np.ndarray) -> None:
        """Make the root ``z`` unique where constraints are redundant."""

    @abstractmethod
    def accept(self, z: np.ndarray) -> None:
        """Advance the state by the solved step ``z``."""

    def residual(self, z: np.ndarray) -> np.ndarray:
        """Return the rows (n,) at ``z`` and judge them."""
        self.count_work(EVALUATION + z.size**3)
        f = np.empty(z.size)
        *judged, self.length = self.evaluate(z, f)
        self.outcome = Outcome(*judged)
        self.workspace.counts[0] += 1
        return f

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Return the derivative (n, n), and count it."""
        self.workspace.counts[1] += 1
        return self.derivative(z)

    def is_multiplier(self) -> np.ndarray:
        """(f,) which of the free unknowns are multipliers."""
        first: int = 3 * first_multiplier(self.workspace.system.frames)
        return self.workspace.unknowns.free >= first


def take_step(step: StepEquations) -> Outcome:
    """Take a step if it converges; return how well it is solved."""
    z = step.predict()
    f = step.residual(z)
    predicted = step.length
    # An infinite residual is that of a system at rest: any force is large relative to no motion.
    if not step.outcome.converged and not np.isnan(step.outcome.residual):
        z = find_root(step, z, f)
        if step.workspace.system.relaxation > 0.0 and step.outcome.converged:
            step.remove_null_parts(z)
    if is_implausible(step.workspace.system, predicted, step.length):
        return Outcome(np.inf, step.outcome.worst)
    if step.outcome.converged:
        step.accept(z)
    return step.outcome


def find_root(step: StepEquations, z: np.ndarray, f: np.ndarray) -> np.ndarray:
    """Return the root found by ``hybr`` from the prediction ``z``, where the rows are ``f``, and
    improved by Newton's method.
    """
    # hybr's trust region starts at a multiple of its unknowns. As these are taken the changes of
    # the prediction, relative to the step's own lengths: they start at zero and are of order one.
    unit = max(np.abs(z).max(), np.abs(f).max())
    # Distant trial points may overflow; their residual is infinite and they are rejected.
    with np.errstate(all="ignore"):
        found = hybrid_method.find_root(
            lambda y: step.residual(z + unit * y) / unit,
            lambda y: step.jacobian(z + unit * y),
            np.zeros(z.size),
            STEP_TOLERANCE,
        )
        result = z + unit * found
        polish(step, result)
    return result


def polish(step: StepEquations, z: np.ndarray, always: bool = False) -> None:
    """Improve the root ``z`` by a few steps of Newton's method, ``always`` or until it is solved;
    the rows are evaluated last at the result.

    ``hybr`` scales all unknowns by the largest row: beside that of a stiff spring all motion is
    small, and its digits are missing.
    """
    f = step.residual(z)
    for k in range(MOST_REPAIRS):
        done = step.outcome.converged and (k >= REPAIRS or not always)
        if done or not (np.isfinite(f).all() and (k < REPAIRS or step.outcome.residual < NEARLY)):
            break
        A = step.jacobian(z)
        if not np.isfinite(A).all():
            break
        z -= np.linalg.lstsq(A, f, rcond=None)[0]
        f = step.residual(z)
