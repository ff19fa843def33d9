"""Runs with contacts that stop and go on have the rows and events of those that did not stop."""

from dataclasses import replace

import numpy as np
import pytest

import msahl.run.loop
from msahl.model import Compliance, Options
from msahl.model.scheme import split
from msahl.run.tables import EVENTS, TABLES
from tests.contact.models import ball, pendulum
from tests.contact.test_compliant import ball as soft_ball
from tests.contact.test_faces import slid
from tests.support.models import deck, run_in_memory


def tables_of(model, options, **others):
    """Report, bytes of all tables, and events of a run."""
    report, sink = run_in_memory(model, options, **others)
    tables = [sink.table(name).tobytes() for name in TABLES if name in sink.kept]
    return report, tables, sink.table(EVENTS).tolist()


def in_two_parts(monkeypatch, model, options, steps):
    """What ``tables_of`` returns of a run stopped after ``steps``, and of the rest."""
    saved, done = [], [0]
    with monkeypatch.context() as patch:
        patch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
        first = tables_of(
            model,
            options,
            save=saved.append,
            progress=lambda steps, t: done.append(steps),
            stopped=lambda: done[-1] >= steps,
        )
    assert first[0].status == "interrupted"
    return first, tables_of(model, options, since=saved[-1])


# The ball's rebounds accumulate at 4.06 s: step 202 of 0.02 s ends among them.
CASES = [
    ("ball", "preserving", 202),
    ("ball", "gauss2", 202),
    ("ball", "gauss2", 100),
    ("pendulum_at_a_wall", "preserving", 150),
    ("slack_rope", "gauss3", 90),
    ("slack_rope", "radau2", 200),
    ("slack_rope", "gauss3", 30),
    # In the first contact, and in the flight after it.
    ("compliant", "preserving", 24),
    ("compliant", "gauss2", 24),
    ("compliant", "gauss3", 40),
    ("sliding_sphere", "gauss2", 20),
    ("sliding_sphere", "decaying", 29),
    ("box_on_slope", "preserving", 24),
    ("box_on_slope", "radau2", 40),
    # While faces slide; after an impact of edges.
    ("stack_of_boxes", "gauss2", 5),
    ("crossed_boxes", "preserving", 35),
    # Before and after its corners are beyond the edge, and while it tips.
    ("slid", "gauss3", 3),
    ("slid", "gauss3", 9),
    ("slid", "preserving", 18),
]


@pytest.mark.sampled
@pytest.mark.parametrize(("name", "scheme", "steps"), CASES)
@pytest.mark.parametrize("error", ["off", "estimate"])
def test_given_steps(monkeypatch, name, scheme, steps, error):
    if name == "ball":
        model = ball(0.8)
        model = replace(model, simulation=replace(model.simulation, dt=0.02, t_final=5.0))
    elif name == "slid":
        model = slid()
        model = replace(model, simulation=replace(model.simulation, dt=0.01, t_final=0.25))
    elif name == "compliant":
        model = soft_ball(Compliance(2e3, 1.5, 1.0), 0.1, 0.7, 0.0, 9.81)
        model = replace(model, simulation=replace(model.simulation, dt=0.006, t_final=1.0))
    else:
        model = pendulum(0.8) if name.startswith("pend") else deck(name)
    family, degree = split(scheme)
    changes = {"scheme": family} | ({"degree": degree} if degree else {})
    model = replace(model, simulation=replace(model.simulation, **changes))
    options = Options(error=error)
    complete, rows, events = tables_of(model, options)
    first, rest = in_two_parts(monkeypatch, model, options, steps)
    assert [a + b for a, b in zip(first[1], rest[1], strict=True)] == rows
    assert first[2] + rest[2] == events
    assert rest[0].contacts == complete.contacts


def test_steps_by_tolerance(monkeypatch):
    model = ball(0.8)
    simulation = replace(
        model.simulation, t_final=5.0, scheme="gauss", degree=3, local_tolerance=1e-8
    )
    model = replace(model, simulation=replace(simulation, output_interval=0.05))
    complete, rows, events = tables_of(model, Options(error="off"))
    middle = complete.steps // 2
    first, rest = in_two_parts(monkeypatch, model, Options(error="off"), middle)
    assert [a + b for a, b in zip(first[1], rest[1], strict=True)] == rows
    assert first[2] + rest[2] == events
    assert np.diff([event[0] for event in events]).min() >= 0.0
