"""Define the problems: models from which all codes are set up, so that all solve the same one."""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from benchmarks.chain_deck import chain_deck
from msahl.algebra.rotation import matrix
from msahl.deck import read_deck
from msahl.model import Model

THESIS = Path(__file__).parents[1] / "decks" / "thesis"
GRID, ROWS = 0.5, 20
"""Interval [s] at whose ends all codes are compared, and the number of intervals: 10 s."""
SMALL_STEPS = (0.01, 0.004, 0.002)
"""The asked 0.01 and 0.002 s, and one between them for the slope in the picture."""


@dataclass(frozen=True, slots=True)
class Problem:
    """A model with consistent velocities, and how long it is run [s]."""

    name: str
    model: Model
    steps: tuple[float, ...]
    span: float  # over which errors are taken
    timed: float  # most that one timing sample covers
    grid: float = GRID  # interval at whose ends all codes are compared [s]
    rows: int = ROWS  # how many of these
    series: int = 0  # most bodies one after the other; 0: all of them

    @property
    def bodies(self) -> int:
        return len(self.model.bodies)


def all_problems(quick: bool) -> list[Problem]:
    """Every problem; ``quick`` omits the longest chain and all but the largest steps."""
    steps = SMALL_STEPS[:1] if quick else SMALL_STEPS
    small = [
        ("single 45", "single_pendulum_45"),
        ("double 89", "double_pendulum_89"),
        ("triple 135", "triple_pendulum_135"),
        ("top 1", "top_1"),
    ]
    problems = [
        Problem(name, _model(THESIS / f"{deck}.xml"), steps, 10.0, 100.0) for name, deck in small
    ]
    problems += [Problem("chain 10", chain(10), (0.01,), 5.0, 20.0)]
    problems += [Problem("chain 100", chain(100), (0.01,), 2.0, 2.0)]
    return problems if quick else [*problems, Problem("chain 1000", chain(1000), (0.01,), 0.5, 0.5)]


def chain(n: int, dt: float = 0.01, t_final: float = 10.0) -> Model:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "chain.xml"
        path.write_text(chain_deck(n, dt, t_final))
        return _model(path)


def _model(path: Path) -> Model:
    return _with_consistent_velocities(read_deck(path))


def _with_consistent_velocities(model: Model) -> Model:
    """Angular velocities as given, v such that no joint opens; joints in the order of a tree.

    The peers ask for it: one has no joint velocities but its own, the other does not repair them.
    """
    bodies = {body.name: body for body in model.bodies}
    for joint in model.joints:
        child, parent = bodies[joint.child], bodies.get(joint.parent)
        speed = np.zeros(3)
        if parent:
            R = np.array(matrix(parent.orientation))
            speed = R @ (parent.velocity + np.cross(parent.angular_velocity, joint.parent_point))
        v = np.array(matrix(child.orientation)).T @ speed
        v -= np.cross(child.angular_velocity, joint.child_point)
        bodies[child.name] = replace(child, velocity=tuple(v.tolist()))
    return replace(model, bodies=tuple(bodies.values()))
