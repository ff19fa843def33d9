"""Runs with events that stop and go on have the rows and events of those that did not stop."""

from dataclasses import replace

import pytest

from msahl.expressions.syntax import parse
from msahl.model import Options, PlaneContact, SignalState
from msahl.model.events import ParameterChange
from msahl.model.scheme import split
from tests.contact.test_resume import in_two_parts, tables_of
from tests.support.models import GROUND
from tests.switching.models import event, flywheels, pendulum
from tests.switching.test_actions import along, oscillator, set_state

ORIGIN = (0.0, 0.0, 0.0)


def shifting():
    """A clutch that is engaged and released again and again, and says so."""
    events = (
        event("On", "sin(20*t) > 0.5", engages=("Clutch",), message="on", repeats=True),
        event("Off", "sin(20*t) < -0.5", releases=("Clutch",), repeats=True),
    )
    return replace(flywheels(), events=events)


def falling():
    """A bob that lets go, falls on a floor, and is pinned again where it was."""
    floor = PlaneContact(
        "Floor", GROUND.name, "Bob", (0.0, 0.0, -1.2), ORIGIN, (0.0, 0.0, 1.0), restitution=0.6
    )
    events = (
        event("LetGo", "Tip.x < 0.2", ("Pivot",)),
        event("Open", "t > 0.95", ("Floor",)),
    )
    return replace(pendulum("t > 9"), contacts=(floor,), events=events)


def ticking():
    """A damped oscillator that is pushed and counted, and whose stiffness changes periodically."""
    soft, hard = ((ParameterChange("Spring", "stiffness", k),) for k in (100.0, 150.0))
    events = (
        event(
            "Tick",
            "Guide.slide < 0.2",
            impulses=(along("Guide", "0.1*Guide.slideRate", "slide"),),
            states=(set_state("Ticks", "Ticks + Guide.slideRate"),),
            repeats=True,
        ),
        event("Hard", "sin(9*t) > 0.5", parameters=hard, repeats=True),
        event("Soft", "sin(9*t) < -0.5", parameters=soft, repeats=True),
    )
    states = (SignalState("Ticks", parse("0")),)
    return oscillator(*events, damping=0.5, signals=states)


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
@pytest.mark.parametrize("error", ["off", "estimate"])
@pytest.mark.parametrize("make", [shifting, falling, ticking])
def test_given_steps(monkeypatch, make, error, scheme):
    family, degree = split(scheme)
    model = make()
    simulation = replace(model.simulation, scheme=family, degree=degree, dt=0.02)
    options, model = Options(error=error), replace(model, simulation=simulation)
    complete = tables_of(model, options)
    assert len(complete[2]) >= 3
    for steps in (15, 27, 40):
        first, rest = in_two_parts(monkeypatch, model, options, steps)
        assert [a + b for a, b in zip(first[1], rest[1], strict=True)] == complete[1]
        assert first[2] + rest[2] == complete[2]
        assert rest[0].events == complete[0].events


@pytest.mark.parametrize("make", [shifting, falling, ticking])
def test_steps_by_tolerance(monkeypatch, make):
    model, options = make(), Options(error="off")
    given = {"scheme": "gauss", "degree": 3, "local_tolerance": 1e-8, "output_interval": 0.05}
    model = replace(model, simulation=replace(model.simulation, **given))
    complete = tables_of(model, options)
    first, rest = in_two_parts(monkeypatch, model, options, complete[0].steps // 2)
    assert [a + b for a, b in zip(first[1], rest[1], strict=True)] == complete[1]
    assert first[2] + rest[2] == complete[2]
