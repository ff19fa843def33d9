"""Compute an independent reference: the equations of ``dynamics``, integrated by scipy.

After each step the constraint violation is removed by projection. Two solutions, whose tolerances
differ by the factor ``COARSER``, are computed side by side: at the time from which they differ by
more than the accuracy asked for, the finer one, whose error is smaller by about that factor, is no
longer trusted, and both end. Steps end where a law of time begins another piece, and where an
expression of the time changes its formula, so that no pulse is missed; kinks and jumps of the
motion are met by steps as short as the tolerance needs. The finer solution is kept in a cache
(``reference_cache``) as the polynomials of its steps, which give the states at any time.
"""

import math
import warnings
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import numpy as np

from msahl.elements.signals.group import use_reactions
from msahl.events.expressions import NO_TIMES, known_to
from msahl.expressions.tape import FREE
from msahl.jit.compiled import working_clock
from msahl.model import Model
from msahl.records import record
from msahl.results.read import ResultError
from msahl.study import reference_cache
from msahl.study.breakpoints import breakpoints, longest_step
from msahl.study.dynamics import SIZE, Dynamics
from msahl.study.reference import position_differences
from msahl.study.reference_cache import CachedSolution

FINEST = 1e-13
"""Relative tolerance of a step; the least that scipy accepts is 100 eps, 2.2e-14."""
COARSER = 100.0
"""Ratio of the tolerances of the two solutions."""
IMPLICIT = 1e-10
"""Finest tolerance of the implicit method, whose order is lower."""
MOST_STEPS = 40_000
"""Number of steps (about half a minute) after which a method is given up: the explicit one in
favour of the implicit one, because the system is stiff."""
COMPARISONS = 50
"""Number of times at which the two solutions are compared."""
FIRST_PART, FIRST_SHARE = 0.04, 0.25
"""Part of the motion that must be solved in this share of the seconds: where it is not, as in
stiff systems, the seconds would not do, and are kept for other references."""
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(8) / 7)
"""Nodes of a step's polynomial, from 0 to 1: eight values define DOP853's, of degree 7."""
WEIGHTS = (-1.0) ** np.arange(8) * np.array([0.5, *[1.0] * 6, 0.5])
"""Barycentric weights of these nodes (Chebyshev nodes of the second kind)."""


_OF_STEPS = (
    "an expression of the model depends on reactions of the step before, so its motion depends on "
    "the step size, and there is no independent solution; use --reference auto"
)


class TooSlowError(Exception):
    """The seconds allowed were used up; ``solution`` is the part computed until then."""

    solution: "Solution"


@record(slots=False)
class Solution:
    """States as polynomials: ``ends`` (k + 1,) of the steps [s], ``values`` (k, 8, ...)."""

    ends: np.ndarray
    values: np.ndarray

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the states (m, ...) at ``times``; at the end of a step those after projection."""
        step = np.searchsorted(self.ends, times, side="right") - 1
        step = np.clip(step, 0, len(self.values) - 1)
        begin, end = self.ends[step], self.ends[step + 1]
        x = ((times - begin) / (end - begin))[:, None] - NODES
        at_node = x == 0.0
        weights = WEIGHTS / np.where(at_node, 1.0, x)
        exact = at_node.any(axis=1)
        weights[exact] = at_node[exact]
        weights /= weights.sum(axis=1, keepdims=True)
        return np.asarray(np.einsum("mi,min->mn", weights, self.values[step]))


@record(slots=False)
class IndependentReference:
    """A solution, the time [s] up to which it is trusted, and the ``error`` of positions [m]."""

    description: str
    horizon: float
    error: float
    dynamics: Dynamics
    solution: Solution

    def states(self, times: np.ndarray) -> np.ndarray:
        """Return the states (m, 12 n) at ``times``."""
        return self.dynamics.publish(self.solution(times))

    def forces(self, times: np.ndarray) -> np.ndarray:
        """Return the joint forces (m, 3 k) [N] at the increasing ``times``."""
        asked = times
        if self.dynamics.state.angle.size:
            # Angles are counted from state to state: every step of the solution is needed.
            ends = self.solution.ends
            asked = np.union1d(times, ends[ends < (times[-1] if len(times) else 0.0)])
        forces = self.dynamics.forces(asked, self.states(asked))
        return np.asarray(forces[np.searchsorted(asked, times)])


def independent(
    model: Model, times: np.ndarray, accuracy: float, seconds: float = math.inf
) -> IndependentReference:
    """Return the independent solution of ``model``, accurate to about ``accuracy`` [m, rad] up to
    the last of ``times`` at which two solutions agree.

    Raises ``TooSlowError`` after so many ``seconds``.
    """
    times = np.unique(times)
    dynamics = Dynamics(model)
    if use_reactions(dynamics.system.forces.signals):
        raise ResultError(_OF_STEPS)
    found = reference_cache.load(model, times, accuracy)
    if found is None:
        found = _compared(dynamics, times, accuracy, seconds)
        reference_cache.save(model, times, accuracy, found)
    description = (
        "The reference is an independent solution: accelerations from the index-1 problem of the "
        f"constraints, integrated by DOP853 at a relative tolerance of {FINEST:.0e}, with the "
        "constraint violation removed after every step. A second solution, at a tolerance of "
        f"{COARSER * FINEST:.0e}, differs from it by up to {found.difference:.1e} m in position"
    )
    description += (
        f"; after t = {found.horizon:.4g} s the two differ by more than {accuracy:.0e} m, because "
        "the motion is too sensitive. Errors after this time are not reported; energy, constraint "
        "violation and virtual work are."
        if found.horizon < times[-1]
        else "."
    )
    solution = Solution(found.ends, found.values)
    error = found.difference / COARSER
    return IndependentReference(description, found.horizon, error, dynamics, solution)


def solve(dynamics: Dynamics, times: np.ndarray, tolerance: float) -> np.ndarray:
    """Return the solution (m, 13 n) at the increasing ``times`` from t = 0, projected at each."""
    for method, reached in _methods(tolerance):
        with suppress(_NoEndError):
            integration = _Integration(method, dynamics, float(times[-1]), reached)
            integration.advance(float(times[-1]))
            dynamics.restart()
            ys = integration.solution(times)
            # Only systems that count angles need the states between these times.
            return np.array([dynamics.projected(t, y) for t, y in zip(times, ys, strict=True)])
    raise ResultError(_NO_SOLUTION)


_NO_SOLUTION = (
    f"no independent solution was found within {MOST_STEPS} steps; compare with a run at a small "
    "step (--reference DIR) or shorten the run (--t-final)"
)


def _methods(tolerance: float) -> Iterator[tuple[type, float]]:
    """Yield the integrators to try and the tolerance of each."""
    from scipy.integrate import DOP853, Radau

    yield DOP853, tolerance
    yield Radau, max(tolerance, IMPLICIT)  # for stiff systems


class _NoEndError(Exception):
    """A method does not reach the end time."""


class _Integration:
    """The integration of one solution by one ``method``, which can be continued."""

    def __init__(self, method: type, dynamics: Dynamics, end: float, tolerance: float) -> None:
        self.method, self.dynamics, self.tolerance = method, dynamics, tolerance
        self.ends, self.values = [0.0], list[np.ndarray]()
        self.steps = 0
        self.longest = longest_step(dynamics.model)
        self.known = known_to(dynamics.system.forces.signals, end, 0.0) or NO_TIMES
        laws = breakpoints(dynamics.model, end)
        self.borders = [*np.union1d(laws, self.known.time), end or 1.0]
        self.angle = dynamics.first_angle.copy()
        self._begin(dynamics.first)

    @property
    def solution(self) -> Solution:
        """Return the solution computed so far."""
        return Solution(np.array(self.ends), np.array(self.values))

    def advance(self, end: float, deadline: float = math.inf) -> None:
        """Take steps until ``end`` [s]. Raises ``TooSlowError`` after the ``deadline``."""
        # The dynamics count angles from one call to the next, and another integration may have
        # called them meanwhile.
        self.dynamics.state.angle[:] = self.angle
        self._hold(self.ends[-1])
        # Near a singular position numbers may overflow; the linear solver reports that, and refuses
        # numbers that are not finite: ``LinAlgError`` is a ``ValueError``.
        with np.errstate(all="ignore"):
            try:
                while not self.values or self.ends[-1] < end:
                    self._step()
                    if working_clock() > deadline:
                        raise TooSlowError
            except ValueError as error:
                raise _NoEndError from error
            finally:
                self._switches[:] = FREE
        self.angle[:] = self.dynamics.state.angle

    @property
    def _switches(self) -> np.ndarray:
        """Held values of the switches of expressions."""
        signals = self.dynamics.system.forces.signals
        return np.zeros(0) if signals is None else signals.tape.held

    def _hold(self, t: float) -> None:
        """Hold the switches that depend on the time alone at what they are from ``t`` [s] on."""
        row = np.searchsorted(self.known.time, t, side="right")
        self._switches[self.known.switch] = self.known.side[row]

    def _begin(self, y: np.ndarray) -> None:
        """Start at the end of the last step with the state ``y``, up to the next breakpoint."""
        begin, self.border = self.ends[-1], self.borders.pop(0)
        self._hold(begin)
        last = np.nextafter(self.border, begin)  # at a breakpoint laws have the value after it
        atol = self.tolerance * _sizes(self.dynamics.first, self.dynamics.state.auxiliary.size)
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            self.solver: Any = self.method(
                lambda t, y: self.dynamics.rates(min(t, last), y),
                begin,
                y,
                self.border,
                rtol=self.tolerance,
                atol=atol,
                max_step=self.longest,
            )

    def _step(self) -> None:
        solver = self.solver
        self.steps += 1
        solver.step()
        if solver.status == "failed" or self.steps > MOST_STEPS:
            raise _NoEndError
        inside = solver.t_old + NODES * (solver.t - solver.t_old)
        self.values.append(solver.dense_output()(inside).T)
        self.ends.append(float(solver.t))
        y = self.dynamics.projected(solver.t, solver.y)
        if solver.status == "finished" and self.borders:
            self._begin(y)
        elif solver.status != "finished":
            solver.y, solver.f = y, self.dynamics.rates(solver.t, y)


def _sizes(first: np.ndarray, auxiliary: int) -> np.ndarray:
    """Return the magnitudes of the components of a state, which scale the absolute tolerance; the
    last of them are ``auxiliary`` states.

    A component that stays zero has rounding errors of the others, so it gets a hundredth of theirs.
    """
    bodies = (first.size - auxiliary) // SIZE
    components = np.abs(first[: SIZE * bodies]).reshape(-1, SIZE).max(axis=0)
    sizes = np.ones(SIZE)
    for kind, least in ((slice(0, 3), 1e-2), (slice(7, 10), 1.0), (slice(10, 13), 1.0)):
        indices = components[kind]
        sizes[kind] = np.maximum(indices, 1e-2 * max(indices.max(), least))
    # A state that begins at zero has no size of its own.
    return np.concatenate([np.tile(sizes, bodies), np.maximum(np.abs(first[SIZE * bodies :]), 1.0)])


def _compared(
    dynamics: Dynamics, times: np.ndarray, accuracy: float, seconds: float
) -> CachedSolution:
    """Compute the finest solution, the time [s] up to which a coarser one agrees with it, and the
    largest difference of the two until then [m].
    """
    began = working_clock()
    for method, fine in _methods(FINEST):
        with suppress(_NoEndError):
            both = [
                _Integration(method, dynamics, float(times[-1]), tolerance)
                for tolerance in (fine, COARSER * fine)
            ]
            horizon, difference = 0.0, 0.0
            for part in np.array_split(times, min(COMPARISONS, len(times))):
                early = part[-1] <= FIRST_PART * times[-1]
                _advance_both(
                    both, float(part[-1]), began + (FIRST_SHARE if early else 1.0) * seconds
                )
                tables = (dynamics.publish(each.solution(part)) for each in both)
                distances = position_differences(*tables)
                largest = np.maximum.accumulate(np.append(difference, distances))[1:]
                good = largest <= accuracy
                if good.any():
                    horizon, difference = float(part[good][-1]), float(largest[good][-1])
                if not good.all():
                    break
            solution = both[0].solution
            return CachedSolution(solution.ends, solution.values, horizon, difference)
    raise ResultError(_NO_SOLUTION)


def _advance_both(both: list[_Integration], end: float, deadline: float) -> None:
    try:
        for integration in both:
            integration.advance(end, deadline)
    except TooSlowError as error:
        error.solution = both[0].solution
        raise
