"""An independent reference: the equation of ``dynamics`` by scipy, the joints closed at each step.

Two solutions a factor ``APART`` apart in tolerance go side by side: where they differ by more than
the accuracy asked for, the finer one, which is better by about that factor, is no longer trusted,
and both end. Steps end where a law of time begins another piece, so that no pulse is passed over.
The finer solution is kept in the user's cache, as the polynomials of its steps: it can be asked for
any time.
"""

import hashlib
import math
import os
import warnings
import zipfile
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import platformdirs

from msahl.jit.compiled import working_clock
from msahl.model import Model, Simulation
from msahl.results.read import ResultError
from msahl.study.breaks import breaks, longest_step
from msahl.study.dynamics import SIZE, Dynamics

FINEST = 1e-13
"""Relative tolerance of a step: scipy goes no lower than 100 eps, 2.2e-14."""
APART = 100.0
IMPLICIT = 1e-10
"""Finest tolerance of the implicit method: its order is lower."""
MOST_STEPS = 40_000
"""Steps (about half a minute) after which a method gives up: the explicit one to the implicit one,
because the system is stiff."""
STRETCHES = 50
"""Parts of the span after each of which the two solutions are compared."""
FORM = "3"
"""Of the file in the cache; counted up when its meaning changes."""
NODES = 0.5 - 0.5 * np.cos(np.pi * np.arange(8) / 7)
"""Where in a step its polynomial is kept: eight values tell DOP853's degree of seven."""
WEIGHTS = (-1.0) ** np.arange(8) * np.array([0.5, *[1.0] * 6, 0.5])
"""Barycentric weights of these nodes (Chebyshev's of the second kind)."""


class TooSlowError(Exception):
    """The seconds allowed were used up; ``solution`` is what there is by then."""

    solution: "Solution"


@dataclass(frozen=True)
class Solution:
    """States as polynomials: ``ends`` (k + 1,) of the steps [s], ``values`` (k, 8, 13 n)."""

    ends: np.ndarray
    values: np.ndarray

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """(m, 13 n) the states at ``times``; at the end of a step those after it."""
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


@dataclass(frozen=True)
class IndependentReference:
    """A solution, and the time to which it holds; ``error`` [m] is that of its positions."""

    words: str
    horizon: float
    error: float
    dynamics: Dynamics
    solution: Solution

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``."""
        return self.dynamics.publish(self.solution(times))

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] at the increasing ``times``."""
        asked = times
        if self.dynamics.state.angle.size:
            # Angles are counted from state to state: no step of the solution must be left out.
            ends = self.solution.ends
            asked = np.union1d(times, ends[ends < (times[-1] if len(times) else 0.0)])
        forces = self.dynamics.forces(asked, self.states(asked))
        return np.asarray(forces[np.searchsorted(asked, times)])


def independent(
    model: Model, times: np.ndarray, accuracy: float, seconds: float = math.inf
) -> IndependentReference:
    """The independent solution of ``model``, good to about ``accuracy`` [m, rad] as far as two
    solutions agree at the ``times``.

    Raises ``TooSlowError`` after so many ``seconds``.
    """
    times = np.unique(times)
    dynamics = Dynamics(model)
    solution, horizon, difference = _kept(model, dynamics, times, accuracy, seconds)
    words = (
        "The reference is an independent solution: accelerations from the joints' index-1 problem, "
        f"integrated by DOP853 at a relative tolerance of {FINEST:.0e} with the joints closed at "
        f"every step. A second solution at {APART * FINEST:.0e} differs from it by up to "
        f"{difference:.1e} m in position"
    )
    words += (
        f"; after t = {horizon:.4g} s the two differ by more than {accuracy:.0e} m: the motion is "
        "too sensitive for true values. Later errors are not reported; energy, joint gaps and "
        "virtual work are."
        if horizon < times[-1]
        else "."
    )
    return IndependentReference(words, horizon, difference / APART, dynamics, solution)


def solve(dynamics: Dynamics, times: np.ndarray, tolerance: float) -> np.ndarray:
    """(m, 13 n) the solution at the increasing ``times``, from t = 0, the joints closed."""
    for method, reached in _methods(tolerance):
        with suppress(_NoEndError):
            marcher = _March(method, dynamics, float(times[-1]), reached)
            marcher.go(float(times[-1]))
            dynamics.restart()
            ys = marcher.solution(times)
            # Only systems that count angles need the states between these times.
            return np.array([dynamics.projected(t, y) for t, y in zip(times, ys, strict=True)])
    raise ResultError(_NO_SOLUTION)


_NO_SOLUTION = (
    f"no independent solution within {MOST_STEPS} steps; compare with a run at a small step: "
    "--reference DIR, or shorten the run: --t-final"
)


def _methods(tolerance: float) -> Iterator[tuple[type, float]]:
    """The integrators and the tolerance of each."""
    from scipy.integrate import DOP853, Radau

    yield DOP853, tolerance
    yield Radau, max(tolerance, IMPLICIT)  # for stiff systems


class _NoEndError(Exception):
    """A method does not come to the end."""


class _March:
    """A solution under way by one ``method``."""

    def __init__(self, method: type, dynamics: Dynamics, end: float, tolerance: float) -> None:
        self.method, self.dynamics, self.tolerance = method, dynamics, tolerance
        self.ends, self.values = [0.0], list[np.ndarray]()
        self.steps = 0
        self.longest = longest_step(dynamics.model)
        self.borders = [*breaks(dynamics.model, end), end or 1.0]
        self.angle = dynamics.first_angle.copy()
        self._begin(dynamics.first)

    @property
    def solution(self) -> Solution:
        """What there is so far."""
        return Solution(np.array(self.ends), np.array(self.values))

    def go(self, end: float, deadline: float = math.inf) -> None:
        """Take steps until ``end`` [s]."""
        # The equation counts angles from one call to the next, and another solution may have
        # called it meanwhile.
        self.dynamics.state.angle[:] = self.angle
        # Where a system passes a singular position nothing finite may be left to solve for.
        with np.errstate(all="ignore"):
            try:
                while not self.values or self.ends[-1] < end:
                    self._step()
                    if working_clock() > deadline:
                        raise TooSlowError
            except np.linalg.LinAlgError as error:
                raise _NoEndError from error
        self.angle[:] = self.dynamics.state.angle

    def _begin(self, y: np.ndarray) -> None:
        """Start at the last end with the state ``y``, up to the next border."""
        begin, self.border = self.ends[-1], self.borders.pop(0)
        last = np.nextafter(self.border, begin)  # laws at a break are those after it
        atol = self.tolerance * _sizes(self.dynamics.first)
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


def _sizes(first: np.ndarray) -> np.ndarray:
    """What is small against which, for the absolute tolerance.

    A component that stays zero has round-off of the others, so it has a hundredth of their size.
    """
    components = np.abs(first).reshape(-1, SIZE).max(axis=0)
    sizes = np.ones(SIZE)
    for kind, least in ((slice(0, 3), 1e-2), (slice(7, 10), 1.0), (slice(10, 13), 1.0)):
        own = components[kind]
        sizes[kind] = np.maximum(own, 1e-2 * max(own.max(), least))
    return np.tile(sizes, first.size // SIZE)


def _compared(
    dynamics: Dynamics, times: np.ndarray, accuracy: float, seconds: float
) -> tuple[Solution, float, float]:
    """The finest solution, the time [s] up to which a coarser one agrees, and how far the two are
    apart until then [m].
    """
    deadline = working_clock() + seconds
    for method, fine in _methods(FINEST):
        with suppress(_NoEndError):
            both = [
                _March(method, dynamics, float(times[-1]), tolerance)
                for tolerance in (fine, APART * fine)
            ]
            horizon, difference = 0.0, 0.0
            for part in np.array_split(times, min(STRETCHES, len(times))):
                try:
                    for march in both:
                        march.go(float(part[-1]), deadline)
                except TooSlowError as error:
                    error.solution = both[0].solution
                    raise
                apart = np.maximum.accumulate(
                    np.append(difference, _apart(dynamics, part, *(m.solution for m in both)))
                )[1:]
                good = apart <= accuracy
                if good.any():
                    horizon, difference = float(part[good][-1]), float(apart[good][-1])
                if not good.all():
                    break
            return both[0].solution, horizon, difference
    raise ResultError(_NO_SOLUTION)


def _apart(dynamics: Dynamics, times: np.ndarray, fine: Solution, coarse: Solution) -> np.ndarray:
    """(m,) largest difference of the positions at ``times`` [m]."""
    tables = [dynamics.publish(s(times)).reshape(len(times), -1, 12) for s in (fine, coarse)]
    difference = tables[0][:, :, :3] - tables[1][:, :, :3]
    return np.asarray(np.sqrt((difference**2).sum(axis=2)).max(axis=1))


def _kept(
    model: Model, dynamics: Dynamics, times: np.ndarray, accuracy: float, seconds: float
) -> tuple[Solution, float, float]:
    """What ``_compared`` returns, from the cache, or made and put there."""
    path = cache_path(model, times, accuracy)
    if path.is_file():
        try:
            with np.load(path) as kept:
                horizon, difference = map(float, kept["figures"])
                return Solution(kept["ends"], kept["values"]), horizon, difference
        except (OSError, ValueError, KeyError, zipfile.BadZipFile):  # damaged: made anew
            path.unlink(missing_ok=True)
    solution, horizon, difference = _compared(dynamics, times, accuracy, seconds)
    # A cache that cannot be written, or that another study writes at the time, is no harm.
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}.part.npz")
        figures = np.array([horizon, difference])
        np.savez(part, ends=solution.ends, values=solution.values, figures=figures)
        part.replace(path)
    return solution, horizon, difference


def cache_path(model: Model, times: np.ndarray, accuracy: float) -> Path:
    """Where the solution up to the last of ``times`` is kept: by all that the deck says but how it
    is run.
    """
    system = replace(model, simulation=Simulation("", 0.0, 0.0))
    key = hashlib.sha256(f"{FORM} {accuracy!r} {system!r}".encode())
    key.update(times.tobytes())
    root = Path(platformdirs.user_cache_dir("msahl", appauthor=False))
    return root / "references" / f"{key.hexdigest()[:32]}.npz"
