"""Run the decks of the thesis and compute their metrics."""

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np

from msahl.algebra.rotation_arrays import rotations
from msahl.deck import read_deck
from msahl.model import Model, Options
from msahl.post.metrics import Metrics, compute_metrics
from msahl.results.read import Run
from msahl.run.report import Report
from msahl.study.runs import run_in_memory, with_step

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "docs" / "validation"
FIGURES = OUT / "figures"


@dataclass(frozen=True)
class Measured:
    """A run and its metrics; ``work`` (m - 1, k) is the virtual work taken at mid-step [J]."""

    report: Report
    run: Run
    metrics: Metrics
    work: np.ndarray


@cache
def model_of(deck: str) -> Model:
    """Return the model of one of the thesis's decks."""
    return read_deck(ROOT / "decks" / "thesis" / f"{deck}.xml")


@cache
def run_deck(deck: str, dt: float, t_final: float, as_given: bool = False) -> Measured:
    """Run a deck with consistent initial velocities, or with those ``as_given``."""
    model = with_step(model_of(deck), dt, t_final)
    if as_given:
        model = replace(model, velocity="asGiven")
    report, run = run_in_memory(model, Options())
    metrics = compute_metrics(run)
    return Measured(report, run, metrics, mid_work(run, metrics))


def mid_work(run: Run, metrics: Metrics) -> np.ndarray:
    """Return lam . (C_0 V_0 + C_1 V_1)/2 dt of every step and joint, V of the joint's child [J].

    This interpretation of eq. 3.16-3.18 takes force and velocity at the middle of the step.
    """
    table = run.states.to_numpy()[:, 1:].reshape(len(run.time), -1, 4, 3)
    v = np.einsum("mnij,mnj->mni", rotations(table[:, :, 1]), table[:, :, 2])
    names = [body.name for body in run.model.bodies]
    child = [names.index(joint.child) for joint in run.model.joints]
    mean = 0.5 * (v[1:] + v[:-1])[:, child]
    return np.asarray((metrics.reactions.force[1:] * mean).sum(axis=2) * np.diff(run.time)[:, None])
