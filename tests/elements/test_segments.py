"""Distances between segments: against a search, and their gradients against differences."""

import numpy as np
import pytest
from scipy.optimize import minimize

from msahl.elements.constraints import segments

HALF = (0.7, 0.4)
PLACES = {
    "inside, inside": (0.1, 0.1, 0.3),
    "end, inside": (1.5, 0.1, 0.3),
    "inside, end": (0.1, 0.9, -0.3),
    "end, end": (1.5, 1.2, 0.6),
}
E = 1e-6


def distance_square(m, half=HALF):
    """Less D.D, by a search over both places from several starts."""

    def square(x):
        u, w = x
        return u * u + w * w - 2.0 * u * m[0] + 2.0 * w * m[1] - 2.0 * u * w * m[2]

    bounds = [(-h, h) for h in half]
    starts = [(sign * half[0], other * half[1]) for sign in (-1, 0, 1) for other in (-1, 0, 1)]
    return min(minimize(square, s, bounds=bounds, tol=1e-14).fun for s in starts)


def products_of(vectors):
    """(6,) of an axis, another one and the vector between the middles (3, 3)."""
    a, e = (v / np.linalg.norm(v) for v in vectors[:2])
    D = 0.8 * vectors[2]
    return np.array([*D, D @ a, D @ e, a @ e])


def random_products(rng):
    """Those of two segments anywhere, near each other."""
    return products_of(rng.normal(size=(3, 3)))


@pytest.mark.slow
def test_nearest_points_are_those_of_a_search():
    rng = np.random.default_rng(1)
    for _ in range(200):
        m = tuple(random_products(rng)[3:])
        # The search ends at its own tolerance.
        assert segments.below(HALF, m) == pytest.approx(distance_square(m), abs=1e-9)


@pytest.mark.parametrize("m", PLACES.values(), ids=PLACES)
def test_feet_move_by_their_derivatives(m):
    at = segments.feet(HALF, m)
    for i in range(3):
        dm = np.eye(3)[i]
        ends = [segments.feet(HALF, tuple(m + sign * E * dm)) for sign in (1.0, -1.0)]
        found = [(ends[0][k] - ends[1][k]) / (2.0 * E) for k in range(2)]
        assert segments.feet_change(m, at, tuple(dm)) == pytest.approx(found, abs=1e-8)


def weighed(m, dm):
    """Change, weights, slopes and curves of one coordinate over a step."""
    out = (np.zeros((1, 6)), np.zeros((1, 6)), np.zeros((1, 6, 6)))
    ends = np.array([HALF])
    before = segments.value(ends, 0, m, 0)
    change = segments.weigh(ends, 0, (m, dm), 0, before, out)
    return before, change, out[0][0], out[1][0], out[2][0]


def test_weights_times_changes_are_the_change():
    """Over large steps as well, in which the feet come to ends of the segments and leave them."""
    rng = np.random.default_rng(2)
    for _ in range(300):
        m, end = random_products(rng), random_products(rng)
        dm = end - m
        before, change, weights, _, _ = weighed(m, dm)
        after = segments.value(np.array([HALF]), 0, end, 0)
        assert change == pytest.approx(after - before, abs=1e-13)
        assert weights @ dm == pytest.approx(change, abs=1e-13)
        assert weights[:3] == pytest.approx((2.0 * m + dm)[:3] / (before + after), rel=1e-12)


def test_derivatives_are_those_of_differences():
    rng = np.random.default_rng(3)
    checked = 0
    for _ in range(200):
        vectors, other = rng.normal(size=(2, 3, 3))
        m = products_of(vectors)
        if segments.value(np.array([HALF]), 0, m, 0) < 0.3:
            continue
        dm = products_of(vectors + 0.1 * other) - m
        _, _, _, slopes, curves = weighed(m, dm)
        for j in range(6):
            step = E * np.eye(6)[j]
            (_, c1, w1, *_), (_, c0, w0, *_) = weighed(m, dm + step), weighed(m, dm - step)
            assert (c1 - c0) / (2.0 * E) == pytest.approx(slopes[j], abs=1e-7)
            by_difference = (w1 - w0) / (2.0 * E)
            # A point of the quadrature may be at a jump of the second derivative.
            if np.abs(by_difference - curves[:, j]).max() < 1e-6:
                checked += 1
    assert checked > 600


@pytest.mark.slow
def test_kinks_change_their_sign_where_a_foot_comes_to_an_end():
    rng, crossed = np.random.default_rng(4), 0
    ends = np.array([HALF])
    for _ in range(100):
        m, end = random_products(rng), random_products(rng)
        way = [m + xi * (end - m) for xi in np.linspace(0.0, 1.0, 2001)]
        kinks = np.array([segments.kink(ends, 0, one, 0) for one in way])
        sides = [segments.feet(HALF, tuple(one[3:]))[2:] for one in way]
        changed = np.array([sides[i] != sides[i + 1] for i in range(2000)])
        differs = np.sign(kinks[1:]) != np.sign(kinks[:-1])
        single = changed & (np.abs(np.diff(kinks)) < 0.05)
        assert (differs[single] | (np.abs(kinks[1:][single]) < 1e-3)).all()
        crossed += int(single.sum())
    assert crossed > 50
