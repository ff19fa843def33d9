"""Errors at one output time only, at which a value jumps, do not count in the estimate."""

import numpy as np
import pytest

from msahl.run.lasting import Lasting
from tests.contact.models import pendulum, run_events
from tests.contact.test_closed_forms import WALL


def test_what_differs_once_does_not_last():
    errors = np.array([[1.0, 0.1], [9.0, 0.2], [1.0, 9.0], [1.0, 9.0], [1.0, 0.1]])
    medians = [[0.0, 0.0], [1.0, 0.1], [1.0, 0.2], [1.0, 9.0], [1.0, 9.0]]
    assert Lasting(2).add(errors).tolist() == medians


def test_medians_do_not_depend_on_chunks():
    errors = np.random.default_rng(3).normal(size=(7, 3))
    all_at_once, parts = Lasting(3), Lasting(3)
    found = [parts.add(errors[:1]), parts.add(errors[1:5]), parts.add(errors[5:])]
    assert (np.concatenate(found) == all_at_once.add(errors)).all()


@pytest.mark.parametrize("steps", [30, 40])
def test_an_impact_at_an_output_time_is_no_error(steps):
    """Run and companion have it on either side of that time; the force jumps by 2 N."""
    dt = WALL[0] / steps
    report, _, events = run_events(pendulum(0.8), "gauss3", dt, 1.2, error="estimate")
    assert events[0][0] == pytest.approx(WALL[0], abs=1e-10)
    assert report.error["force"] > 1.0
    assert report.error["lasting"]["force"] < 1e-8  # what the estimate says away from the impact
