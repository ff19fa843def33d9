"""Where a run stands between two steps: all that its next step depends on, to the last bit.

The accepted state of every island goes with what was prepared from it, so that nothing is computed
twice and no rounding can differ. What a scene has by its deck is not kept but known by its digest:
a run that goes on builds the scene anew, and must come to the same.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from msahl.run.subsystem import Runner


class ResumeError(Exception):
    """A run that cannot go on from where it stood; the message names the reason and the remedy."""


@dataclass(frozen=True)
class Snapshot:
    """A run between two steps: digest of its scene, counters and extremes, and what advances.

    ``numbers`` are what JSON can hold; ``memory`` (m,) is all islands' states, one after the other.
    """

    scene: str
    numbers: dict[str, Any]
    memory: np.ndarray


def remember(runners: Sequence[Runner]) -> np.ndarray:
    """(m,) a copy of all that the islands hand to their next steps."""
    return np.concatenate([array.ravel() for array in _advancing(runners)])


def recall(runners: Sequence[Runner], memory: np.ndarray) -> None:
    """Put back what ``remember`` copied from the same islands."""
    first = 0
    for array in _advancing(runners):
        array[:] = memory[first : first + array.size].reshape(array.shape)
        first += array.size


def counters(runner: Runner) -> dict[str, Any]:
    """What an island's runner counts, and whether it has begun."""
    iterations, factorisations = runner.scene.counts.tolist()
    return {
        "begun": runner.begun,
        "root_steps": runner.root_steps,
        "halvings": runner.halvings,
        "counts": [iterations, factorisations],
        "steps": runner.steps.counters,
    }


def set_counters(runner: Runner, counted: dict[str, Any]) -> None:
    """Put back what ``counters`` told."""
    runner.begun = counted["begun"]
    runner.root_steps, runner.halvings = counted["root_steps"], counted["halvings"]
    runner.scene.counts[:] = counted["counts"]
    runner.steps.recall(counted["steps"])


def digest(runners: Sequence[Runner]) -> str:
    """SHA-256, in hexadecimal, of all that is constant in the islands' scenes."""
    found = hashlib.sha256()
    for runner in runners:
        found.update(f"{runner.solver} {runner.steps.kind} {runner.axis} {runner.large}\n".encode())
        for leaf in _leaves((runner.scene.system, runner.scene.unknowns)):
            if isinstance(leaf, np.ndarray):
                found.update(f"{leaf.shape}{leaf.dtype.str}\n".encode())
                found.update(leaf.tobytes())
            else:
                found.update(f"{leaf!r}\n".encode())
    return found.hexdigest()


def _leaves(value: Any) -> Iterator[Any]:
    """What nested groups hold, in order."""
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    else:
        yield value


def _advancing(runners: Sequence[Runner]) -> Iterator[np.ndarray]:
    """What changes from step to step and is read by the next: all of it doubles."""
    for runner in runners:
        scene = runner.scene
        for leaf in _leaves((scene.state, scene.start, scene.pivots, runner.steps.memory)):
            # ``along`` is None in a scene of points; numbers that count are constant.
            if isinstance(leaf, np.ndarray) and leaf.dtype == float:
                yield leaf
