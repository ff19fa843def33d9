"""Derivatives of runs that end between two steps, and of those whose steps end at breakpoints."""

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import msahl
from tests.support.models import ROOT

DECKS = ROOT / "decks"
G, UP, ALONG, SPIN = 9.80665, 6.0, 5.0, 3.0


def height(t):
    """Height [m] of the end of the stick of ``stop.xml`` at the time ``t``."""
    return 2.0 + UP * t - 0.5 * G * t**2 - 0.5 * np.cos(SPIN * t)


def test_the_end_between_two_steps_moves_with_the_speed():
    def rate(t):
        return UP - G * t + 0.5 * SPIN * math.sin(SPIN * t)

    top = brentq(rate, 0.4, 0.9)
    limit = float(height(top)) - 1e-5
    assert height(0.02 * np.arange(150)).max() < limit  # no step ends above it
    end = brentq(lambda t: height(t) - limit, top - 0.01, top, xtol=1e-15)
    model = msahl.load(DECKS / "basics/stop.xml")
    wanted = {"stop_when": f"End.z > {limit!r}", "error": "off", "solver": "newton"}
    found = model.gradient(["Stick.x final"], "Stick.velocity.v3", **wanted)
    assert found.values[0] == pytest.approx(ALONG * end, abs=1e-11)
    # The rate at the end is 0.01 m/s, so the slope is 1e2 times as sensitive as those elsewhere.
    assert found.jacobian[0, 0] == pytest.approx(-ALONG * end / rate(end), rel=1e-7)
