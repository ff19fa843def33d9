"""The fitted order: what it says of clean, coarse and noisy series."""

import numpy as np
import pytest

from msahl.study.order import describe, fit_order

STEPS = [0.1, 0.04, 0.01, 0.004, 0.002, 0.001, 0.0004]


def test_power_law():
    fit = fit_order(STEPS, [3.0 * h**2 for h in STEPS])
    assert fit is not None
    assert fit.order == pytest.approx(2.0, abs=1e-12)  # round-off of a logarithm
    assert fit.uncertainty < 1e-10
    assert (fit.coarsest, fit.finest) == (0.1, 0.0004)
    assert fit.error(0.05) == pytest.approx(3.0 * 0.05**2)
    assert fit.step(3e-4) == pytest.approx(0.01)


def test_coarse_and_rounded_steps_are_omitted():
    errors = [2.0, 1.5, 1e-4, 1.6e-5, 4e-6, 1e-6, 2e-6]
    fit = fit_order(STEPS, errors)
    assert fit is not None
    assert fit.order == pytest.approx(2.0, abs=0.02)  # the numbers above are rounded
    assert (fit.coarsest, fit.finest) == (0.01, 0.001)
    words = describe(fit, STEPS, errors)
    assert "pre-asymptotic above" in words
    assert "rounding errors" in words


def test_uncertainty_covers_the_truth():
    random = np.random.default_rng(1)
    inside = 0
    for _ in range(200):
        errors = [h**2 * np.exp(0.01 * random.normal()) for h in STEPS]
        fit = fit_order(STEPS, errors)
        assert fit is not None
        inside += abs(fit.order - 2.0) <= fit.uncertainty
    # A 95 % interval: of 200, fewer than 175 has a chance of 1e-5.
    assert inside >= 175


@pytest.mark.parametrize("errors", [[1e-15] * 7, [1.0, 2.0] * 3 + [1.0], [0.0] * 7])
def test_no_order(errors):
    assert fit_order(STEPS, errors) is None


def test_slopes_that_still_fall_are_no_order():
    # Three slopes of 3 are an accident if finer steps go on with 2.4 and 2.
    errors = np.cumprod([1.0, 0.4**3, 0.25**3, 0.4**3, 0.5**2.4, 0.5**2.0, 0.4**2])
    fit = fit_order(STEPS, errors.tolist())
    assert fit is not None
    assert fit.finest == STEPS[-1]
    assert fit.order == pytest.approx(2.0, abs=0.2)


def test_words_without_order():
    assert describe(None, STEPS, [1e-15] * 7) == "rounding error at every step"
    assert describe(None, STEPS, [1.0] * 7).startswith("none")
