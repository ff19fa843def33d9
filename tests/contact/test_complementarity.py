"""Complementarity problems of contacts and impact laws, against enumeration of all cases."""

import itertools

import numpy as np
import pytest

from msahl.contact.complementarity import NoSolution, solve
from msahl.contact.impact import impulses

ROUND_OFF = 1e-11
"""Of problems whose matrices have condition numbers up to 1e4."""


def random_response(rng, contacts, velocities):
    """W = G M^-1 G^T of a random mechanism: redundant where there are few velocities."""
    G, root = rng.normal(size=(contacts, velocities)), rng.normal(size=(velocities, velocities))
    M = root @ root.T + np.eye(velocities)
    return G, G @ np.linalg.solve(M, G.T)


def by_enumeration(W, q):
    """A solution z of w = W z + q, found by trying every set of contacts that press."""
    for count in range(q.size + 1):
        for active in itertools.combinations(range(q.size), count):
            rows, z = list(active), np.zeros(q.size)
            if rows:
                z[rows] = np.linalg.lstsq(W[np.ix_(rows, rows)], -q[rows], rcond=None)[0]
            size = 1e-9 * np.abs(q).max()
            if (z >= -1e-9 * np.abs(z).max(initial=0.0)).all() and (W @ z + q >= -size).all():
                return z
    return None


@pytest.mark.parametrize("velocities", [1, 3, 8])
@pytest.mark.parametrize("contacts", [1, 2, 3, 4])
def test_rates_after_are_those_of_enumeration(contacts, velocities):
    rng = np.random.default_rng(contacts + 10 * velocities)
    for _ in range(100):
        G, W = random_response(rng, contacts, velocities)
        q = G @ rng.normal(size=velocities)  # so that a solution exists, as of a mechanism's rates
        z = solve(W, q)
        w = W @ z + q
        size = np.abs(q).max()
        assert (z >= 0.0).all()
        assert w.min() >= -ROUND_OFF * size
        assert abs(w @ z) <= ROUND_OFF * size * np.abs(z).max(initial=1e-300)
        # Rates are unique, impulses of redundant contacts are not.
        assert w == pytest.approx(W @ by_enumeration(W, q) + q, abs=1e-8 * size)


def test_a_problem_without_solution_is_named():
    with pytest.raises(NoSolution):
        solve(np.array([[-1.0]]), np.array([-1.0]))


@pytest.mark.parametrize("law", ["poisson", "newton"])
def test_one_contact_rebounds_by_its_restitution(law):
    W, v, e = np.array([[0.3]]), np.array([-2.0]), np.array([0.6])
    assert v + W @ impulses(law, W, v, e) == pytest.approx([1.2], abs=1e-15)


@pytest.mark.slow
def test_poisson_never_gains_energy():
    rng = np.random.default_rng(3)
    for _ in range(2000):
        G, W = random_response(rng, int(rng.integers(1, 5)), 5)
        v, e = G @ rng.normal(size=5), np.full(len(W), rng.uniform())
        impulse = impulses("poisson", W, v, e)
        gained = impulse @ (v + 0.5 * W @ impulse)
        assert gained <= 1e-12 * (1.0 + np.abs(impulse).max() * np.abs(v).max())
        after = v + W @ impulse
        assert after.min() >= -ROUND_OFF * np.abs(v).max()


def test_chain_of_equal_balls_passes_the_impulse_on():
    """Newton's cradle, by contacts at once: Poisson's law with e = 1 moves two balls apart."""
    # Three balls of 1 kg in a row: gaps 1-2 and 2-3; the first comes in at 1 m/s.
    W = np.array([[2.0, -1.0], [-1.0, 2.0]])
    v = np.array([-1.0, 0.0])
    impulse = impulses("poisson", W, v, np.ones(2))
    balls = np.array([1.0 - impulse[0], impulse[0] - impulse[1], impulse[1]])
    assert balls.sum() == pytest.approx(1.0, abs=1e-15)
    assert balls @ balls == pytest.approx(1.0, abs=1e-14)
    assert (np.diff(balls) >= -1e-15).all()
