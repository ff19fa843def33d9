"""A motion as every code reports it, and how wrong it is.

Energy, constraint violations and position errors are computed here, from positions and
velocities, for all codes alike; no code judges itself. Bodies have their mass centre in B (as all
our problems do).
"""

import time
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np

from msahl.model import Model

Seen = TypeVar("Seen")


class Motion(NamedTuple):
    """Rows of one run of n bodies, the first one at t = 0."""

    t: np.ndarray  # (rows,) [s]
    x: np.ndarray  # (rows, n, 3) mass centres, inertial axes [m]
    R: np.ndarray  # (rows, n, 3, 3) body to inertial axes
    v: np.ndarray  # (rows, n, 3) inertial axes [m/s]
    w: np.ndarray  # (rows, n, 3) body axes [rad/s]
    seconds: float = float("nan")  # in the time loop alone
    steps: int = 0
    iterations: int = 0  # Newton's, of all steps


def observe_outputs(
    advance: Callable[[int], Any], look: Callable[[], Seen], outputs: int
) -> tuple[list[Seen], float]:
    """Call ``advance`` with the number of each output after the start; return what ``look`` saw
    before and after all of them, and the seconds of the former alone.
    """
    rows, seconds = [look()], 0.0
    for k in range(1, outputs + 1):
        began = time.perf_counter()
        advance(k)
        seconds += time.perf_counter() - began
        rows.append(look())
    return rows, seconds


class Errors(NamedTuple):
    energy: float  # RMS of E - E(0) over the largest kinetic energy
    violation: float  # largest distance of two points that a joint connects [m]
    position: float  # largest distance of a mass centre from the converged solution [m]


def errors_of(model: Model, motion: Motion, converged: np.ndarray) -> Errors:
    """The errors of ``motion``; ``converged`` (rows, n, 3) is where mass centres should be."""
    kinetic, total = _energies(model, motion)
    energy = np.sqrt(np.mean((total - total[0]) ** 2)) / kinetic.max()
    position = np.linalg.norm(motion.x - converged, axis=-1).max()
    return Errors(float(energy), _violation(model, motion), float(position))


def _energies(model: Model, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    mass = np.array([body.mass for body in model.bodies])
    inertia = np.array([body.inertia for body in model.bodies])
    kinetic = 0.5 * np.einsum("b,tbi,tbi->t", mass, motion.v, motion.v)
    kinetic += 0.5 * np.einsum("tbi,bij,tbj->t", motion.w, inertia, motion.w)
    potential = -np.einsum("b,i,tbi->t", mass, np.array(model.gravity), motion.x)
    return kinetic, kinetic + potential


def _violation(model: Model, motion: Motion) -> float:
    index = {body.name: i for i, body in enumerate(model.bodies)}

    def place(name: str, point: tuple[float, float, float]) -> np.ndarray:
        if name not in index:
            return np.array(point)
        b = index[name]
        return motion.x[:, b] + motion.R[:, b] @ np.array(point)

    distances = [
        place(joint.child, joint.child_point) - place(joint.parent, joint.parent_point)
        for joint in model.joints
    ]
    return float(np.linalg.norm(distances, axis=-1).max())
