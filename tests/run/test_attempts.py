"""Runs to a global tolerance: when another one is made, and how accurate it aims to be."""

from types import SimpleNamespace

import numpy as np
import pytest

from msahl.model import Simulation, resolve
from msahl.run.attempts import AIM, BOLDER, FINEST, MOST_RUNS, Attempts
from msahl.run.companion import EarlierRun, Rows

GOAL = 1e-6


def first_attempt():
    return Attempts(resolve(Simulation("", 0.1, 1.0, scheme="auto", tolerance=GOAL)))


def estimate(error, kept=None):
    """What an attempt asks of the estimate of its error."""
    return SimpleNamespace(
        over_tolerance=lambda goal: error / goal,
        stopped=False,
        kept=kept,
        as_earlier_run=lambda: EarlierRun(kept),
    )


def made(attempts, error, steps=None):
    """The attempts with one more run, of an error; of ``steps``, or one more than the last."""
    steps = steps or 1000 + len(attempts.made)
    numbers = {"steps": steps, "error": error, "overTolerance": error / GOAL}
    attempts.made.append({"localTolerance": attempts.local, **numbers})
    return attempts


def test_a_run_within_the_tolerance_is_the_last():
    assert not made(first_attempt(), 0.9 * GOAL).prepare_next(estimate(0.9 * GOAL), 1.0)
    assert not first_attempt().prepare_next(None, 1.0)


def test_the_next_run_aims_at_a_share_of_the_tolerance_in_proportion():
    attempts = made(first_attempt(), 4.0 * GOAL)
    before = attempts.local
    assert attempts.prepare_next(estimate(4.0 * GOAL), 1.0)
    assert attempts.local == pytest.approx(AIM * before / 4.0)
    # No smaller than what rounding lets a step control.
    assert made(attempts, 1.5 * GOAL).prepare_next(estimate(1.5 * GOAL), 0.004 * GOAL / FINEST)
    assert attempts.local == pytest.approx(0.004 * GOAL)


def test_no_further_run_is_made_where_smaller_steps_do_not_help():
    attempts = made(made(first_attempt(), 4.0 * GOAL), 3.0 * GOAL)
    assert not attempts.prepare_next(estimate(3.0 * GOAL), 1.0)
    # In so few steps it is the steps.
    attempts = made(made(first_attempt(), 4.0 * GOAL, 8), 5.0 * GOAL, 18)
    assert attempts.prepare_next(estimate(5.0 * GOAL), 1.0)
    attempts = first_attempt()
    for k in range(MOST_RUNS):
        made(attempts, 100.0 * GOAL * 0.1**k)
    assert not attempts.prepare_next(estimate(2.0 * GOAL), 1.0)


def test_a_run_of_the_same_steps_does_not_say_that_smaller_ones_do_not_help():
    attempts = made(made(first_attempt(), 4.0 * GOAL, 500), 4.0 * GOAL, 500)
    before = attempts.local
    assert attempts.prepare_next(estimate(4.0 * GOAL), 1.0)
    assert attempts.local == pytest.approx(AIM * BOLDER * before / 4.0)
    # However often; it ends where steps cannot be controlled more finely.
    for _ in range(MOST_RUNS):
        made(attempts, 4.0 * GOAL, 500)
    assert attempts.prepare_next(estimate(4.0 * GOAL), 1.0)
    attempts.local = FINEST
    assert not attempts.prepare_next(estimate(4.0 * GOAL), 1.0)


def test_an_accurate_companion_judges_the_next_run_too_and_survives_a_snapshot():
    rng = np.random.default_rng(1)
    rows = [Rows(*(rng.normal(size=(3, n)) for n in (12, 6, 2)))]
    attempts = made(first_attempt(), 2.0 * GOAL)
    attempts.order = 8
    assert attempts.prepare_next(estimate(2.0 * GOAL, rows), 1.0)
    again = first_attempt()
    again.restore(attempts.numbers(), attempts.memory())
    assert again.local == attempts.local
    assert again.made == attempts.made
    for table, other in zip(again.earlier.rows[0], rows[0], strict=True):
        assert np.array_equal(table, other)
    # One of low order is not accurate enough.
    attempts.order = 1
    attempts.made.pop()
    assert made(attempts, 2.0 * GOAL).prepare_next(estimate(2.0 * GOAL, rows), 1.0)
    assert attempts.earlier is None
