"""Beams in collocation steps: derivatives, orders, energy balance with damping."""

import numpy as np
import pytest

from tests.support.beams import ELASTIC, FLEXIBLE, cantilever, free_beam
from tests.support.collocation_step import Step
from tests.support.models import simulate_and_estimate as simulate

SOFT = (1e3, 4e2, 4e2, 10.0, 12.0, 15.0)
T = 0.1
SCHEMES = [("preserving", 2, 40), ("decaying", 2, 40), ("gauss2", 4, 10), ("radau2", 3, 16)]
"""Schemes, their orders, and steps of the coarser of two runs."""


@pytest.mark.parametrize("word", ["gauss1", "gauss2", "radau2"])
@pytest.mark.parametrize("stiffness", [ELASTIC, FLEXIBLE, (np.inf,) * 6])
def test_the_jacobian_is_the_derivative_of_the_equations(word, stiffness):
    rng = np.random.default_rng(3)
    model = free_beam(rng, 2, 1, stiffness, damping=(0.02,) * 6, center=(0.01, 0.02, -0.03))
    step = Step(model, word, 0.05, rng)
    step.z *= 0.2
    A = step.derivative()
    for _ in range(3):
        direction = rng.normal(size=step.shape)
        along = np.einsum("ifjg,jg->if", A, direction)
        difference = step.difference(direction, 1e-6)
        # Central differences: 1e-12 by curvature, 1e-10 by round-off.
        assert np.abs(along - difference).max() < 1e-9 * np.abs(difference).max()


def end(word, steps):
    """The run of a damped cantilever that begins to fall, up to ``T``."""
    model = cantilever(2, 1, SOFT, (0.002,) * 6, gravity=(0.0, 3.0, -9.81))
    return simulate(model, dt=T / steps, t_final=T, scheme=word)


@pytest.mark.parametrize(("word", "order", "steps"), SCHEMES)
def test_every_scheme_has_its_order(word, order, steps):
    exact = end("gauss3", 40).of("position")[-1]
    coarse, fine = (
        np.abs(end(word, n).of("position")[-1] - exact).max() for n in (steps, 2 * steps)
    )
    assert fine > 1e-10
    assert abs(np.log2(coarse / fine) - order) < 0.4


def test_the_work_of_damping_is_in_the_balance():
    result = end("gauss3", 40)
    energy = result.report.verdict["checks"]["energy"]
    assert result.column("Beam.work")[-1] < -1e-5
    assert energy["word"] == "PASS"
