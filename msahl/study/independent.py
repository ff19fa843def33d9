"""An independent reference: the equation of ``dynamics`` by scipy, the joints closed at each step.

Two solutions a factor ``APART`` apart in tolerance are compared: where they part by more than the
accuracy asked for, the finer one, which is better by about that factor, is no longer trusted. The
solutions are kept in the user's cache, by scene, tolerance and times.
"""

import hashlib
import os
import warnings
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import platformdirs

from msahl.model import Model, Simulation
from msahl.results.read import ResultError
from msahl.study.dynamics import SIZE, Dynamics

FINEST = 1e-13
"""Relative tolerance of a step: scipy goes no lower than 100 eps, 2.2e-14."""
APART = 100.0
MOST_STEPS = 40_000
"""Steps (about half a minute) after which a method gives up: the explicit one to the implicit one,
because the scene is stiff."""
FORM = "2"
"""Of the file in the cache; counted up when its meaning changes."""


@dataclass(frozen=True)
class IndependentReference:
    """Solutions at ``times``, and the time to which they hold."""

    words: str
    horizon: float
    times: np.ndarray
    table: np.ndarray
    reactions: np.ndarray

    def states(self, times: np.ndarray) -> np.ndarray:
        """(m, 12 n) states at ``times``, which are among its own."""
        return np.asarray(self.table[self._places(times)])

    def forces(self, times: np.ndarray) -> np.ndarray:
        """(m, 3 k) joint forces [N] at ``times``."""
        return np.asarray(self.reactions[self._places(times)])

    def _places(self, times: np.ndarray) -> np.ndarray:
        places = np.searchsorted(self.times, times)
        if not np.array_equal(self.times[np.minimum(places, len(self.times) - 1)], times):
            raise ValueError("times the independent solution was not asked for")
        return places


def independent(model: Model, times: np.ndarray, accuracy: float) -> IndependentReference:
    """The independent solution of ``model`` at ``times``, good to about ``accuracy`` [m, rad]."""
    times = np.unique(times)
    fine = max(FINEST, min(1e-2 * accuracy, 1e-12))
    dynamics = Dynamics(model)
    tables = [
        dynamics.publish(_kept(model, dynamics, times, tolerance))
        for tolerance in (fine, APART * fine)
    ]
    parting = _parting(*tables)
    beyond = np.flatnonzero(parting > accuracy)
    horizon = float(times[max(beyond[0] - 1, 0)] if beyond.size else times[-1])
    difference = float(parting[times <= horizon].max())
    words = (
        "The reference is an independent solution: accelerations from the joints' index-1 problem, "
        f"integrated by DOP853 at a relative tolerance of {fine:.0e} with the joints closed at "
        f"every step. A second one at {APART * fine:.0e} parts from it by up to {difference:.1e} "
        "(positions in m)"
    )
    words += (
        f"; they part by more than {accuracy:.0e} after t = {horizon:.4g} s: later errors are not "
        "reported, invariants are."
        if beyond.size
        else "."
    )
    return IndependentReference(words, horizon, times, tables[0], dynamics.forces(times, tables[0]))


def _parting(fine: np.ndarray, coarse: np.ndarray) -> np.ndarray:
    """(m,) largest difference of the positions so far [m]."""
    shape = (len(fine), -1, 12)
    difference = fine.reshape(shape)[:, :, :3] - coarse.reshape(shape)[:, :, :3]
    return np.asarray(np.maximum.accumulate(np.sqrt((difference**2).sum(axis=2)).max(axis=1)))


def solve(dynamics: Dynamics, times: np.ndarray, tolerance: float) -> np.ndarray:
    """(m, 13 n) the solution at the increasing ``times``, from t = 0."""
    from scipy.integrate import DOP853, Radau

    # The second is implicit, for stiff scenes, and of a lower order: what it reaches is less.
    for method, reached in ((DOP853, tolerance), (Radau, max(tolerance, 1e-10))):
        # Where a scene passes a singular position nothing finite may be left to solve for.
        with suppress(np.linalg.LinAlgError), np.errstate(all="ignore"):
            ys = _march(method, dynamics, times, reached)
            if ys is not None:
                return ys
    raise ResultError(
        f"no independent solution within {MOST_STEPS} steps; compare with a run at a small step: "
        "--reference DIR, or shorten the scene: --t-final"
    )


def _march(
    method: type, dynamics: Dynamics, times: np.ndarray, tolerance: float
) -> np.ndarray | None:
    """The solution by one ``method``, or None if it does not come to the end."""
    dynamics.restart()
    ys = np.empty((len(times), dynamics.first.size))
    span = float(times[-1]) or 1.0
    atol = tolerance * _sizes(dynamics.first)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        solver = method(dynamics.rates, 0.0, dynamics.first, span, rtol=tolerance, atol=atol)
    done = int(np.searchsorted(times, 0.0, side="right"))
    ys[:done] = dynamics.first
    for _ in range(MOST_STEPS):
        if solver.status != "running":
            break
        solver.step()
        reached = int(np.searchsorted(times, solver.t, side="right"))
        if reached > done:
            inside = solver.dense_output()(times[done:reached]).T
            ys[done:reached] = [
                dynamics.projected(t, y) for t, y in zip(times[done:reached], inside, strict=True)
            ]
            done = reached
        solver.y = dynamics.projected(solver.t, solver.y)
        solver.f = dynamics.rates(solver.t, solver.y)
    return ys if solver.status == "finished" else None


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


def _kept(model: Model, dynamics: Dynamics, times: np.ndarray, tolerance: float) -> np.ndarray:
    """The solution from the cache, or made and put there."""
    path = cache_path(model, times, tolerance)
    if path.is_file():
        try:
            return np.asarray(np.load(path))
        except (OSError, ValueError):  # cut short, or not ours: made anew
            path.unlink(missing_ok=True)
    ys = solve(dynamics, times, tolerance)
    # A cache that cannot be written, or that another study writes at the time, is no harm.
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_suffix(f".{os.getpid()}.part.npy")
        np.save(part, ys)
        part.replace(path)
    return ys


def cache_path(model: Model, times: np.ndarray, tolerance: float) -> Path:
    """Where the solution at ``times`` is kept: by all that the deck says but how it is run."""
    scene = replace(model, simulation=Simulation("", 0.0, 0.0))
    key = hashlib.sha256(f"{FORM} {tolerance!r} {scene!r}".encode())
    key.update(times.tobytes())
    root = Path(platformdirs.user_cache_dir("msahl", appauthor=False))
    return root / "references" / f"{key.hexdigest()[:32]}.npy"
