"""Elastic bodies with geometric stiffening: rotating blades, and free bodies that keep energy."""

from dataclasses import replace

import numpy as np
import pytest

import msahl
from msahl.algebra.functions import Law
from msahl.check import check
from msahl.deck.source import Source
from msahl.deck.write_model import write_deck
from msahl.model import Joint, JointMotion
from msahl.reduction.followers import Start
from tests.physics.test_elastic_bodies import amplitudes, keeps_momenta
from tests.reduction.stiffened import blade
from tests.support.elastic import ZERO, elastic_model
from tests.support.models import simulate

PUBLISHED = {1.0: (3.681646813958, 22.181011150583), 5.0: (6.4495447485687, 25.446080358049)}
"""Frequencies of flapping by the speed, in units of sqrt(EI/m)/L^2, of a blade without rotary
inertia (Wright, Smith, Thresher and Wang, 1982)."""


def rotating(body, speed, stiffening=True):
    """A blade that a motor rotates about z."""
    q = body.eigenvalues.size
    start = Start(ZERO, ZERO, ZERO, (0.0, 0.0, speed), np.zeros(q), np.zeros(q))
    hub = Joint("Hub", "revolute", "Base", "Box.Root", ZERO, ZERO)
    motor = JointMotion("Motor", "Hub", "angle", Law("polynomial", (0.0, speed)))
    return elastic_model(body, start, stiffening=stiffening, joints=(hub,), motions=(motor,))


@pytest.mark.slow
@pytest.mark.parametrize("speed", PUBLISHED)
def test_frequencies_of_a_rotating_blade(speed):
    """Six modes with the root fixed, four of them of flapping. Rotary inertia takes 1.6e-5 of the
    second frequency, the omitted modes 7e-5 at 5, the particles' inertia 1e-5."""
    found = 2.0 * np.pi * msahl.Model(rotating(blade().body, speed)).modes().frequency
    for wanted in PUBLISHED[speed]:
        assert np.abs(found / wanted - 1.0).min() < 1e-4
    soft = msahl.Model(rotating(blade().body, speed, stiffening=False)).modes().frequency
    assert np.abs(2.0 * np.pi * soft / PUBLISHED[speed][0] - 1.0).min() > 1e-2


def free(dt, t_final=0.04):
    """A free blade of three modes that rotates, and vibrates by a tenth of its length."""
    body = blade(3).body
    a, rate = np.array([0.03, 0.02, 0.01]), np.array([0.3, -0.6, 0.4])
    spin = (1.0, 6.0, -4.0)
    start = Start((0.1, -0.2, 0.3), (0.3, 0.5, -0.2), (0.4, 1.0, -0.3), spin, a, rate)
    return elastic_model(body, start, dt, t_final, stiffening=True)


def test_a_free_body_keeps_energy_and_momenta():
    result = simulate(free(1e-3), scheme="preserving")
    keeps_momenta(result)
    # Round-off of 40 steps; the motion itself changes both energies by a tenth and more.
    assert result.report.extremes["energyErrorMaxRelative"] < 1e-11
    assert result.report.extremes["constraintViolationMax"] < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "order", "dt"), [("preserving", 2, 1e-3), ("gauss2", 4, 2e-3), ("gauss3", 6, 4e-3)]
)
def test_order(scheme, order, dt):
    """Amplitudes against those of a gauss3 run whose error is below these by its own order."""
    exact = amplitudes(simulate(free(5e-4), scheme="gauss3"))[-1]
    errors = [
        np.abs(amplitudes(simulate(free(dt / part), scheme=scheme))[-1] - exact).max()
        for part in (1, 2)
    ]
    # Of coarse steps, which the highest mode takes with 0.1 to 0.4 rad, the order is not yet exact.
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.4), errors


def test_written_decks_read_back_to_equal_records():
    model = rotating(blade(2).body, 3.0)
    assert check(model) == []
    assert Source.of(write_deck(model)).model() == model


def test_squares_that_do_not_fit_are_found():
    model = rotating(blade(2).body, 3.0)
    (body,) = model.elastic_bodies
    wrong = replace(body.squares[0], argument=10_000)
    body = replace(body, squares=(wrong, *body.squares[1:]))
    found = check(replace(model, elastic_bodies=(body,)))
    assert any("squares and followers do not fit together" in one.message for one in found)
