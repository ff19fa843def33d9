"""Few kinds of models: machine code gets groups without entries for those that a model lacks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msahl.deck import read_deck
from msahl.jit import compiled
from msahl.jit.arguments import describe
from msahl.jit.compiled import Compiled
from msahl.jit.general import round_up, types_of_groups
from msahl.model import Options
from msahl.run.loop import run
from msahl.run.tables import EVENTS, REACTIONS, STATES, WORK, MemorySink
from msahl.system.build import build_system
from tests.support.empty_groups import with_empty_groups
from tools.optional_groups import find_types

DECKS = Path(__file__).parents[2] / "decks"


def kind_of(name):
    return round_up((describe(build_system(read_deck(DECKS / f"{name}.xml"))),))


@pytest.mark.slow
def test_types_are_those_of_models_that_have_the_groups():
    """Where this fails, a group has new arrays: run python -m tools.optional_groups."""
    assert types_of_groups() == find_types()


def test_models_with_one_group_of_a_set_are_of_the_kind_of_all():
    general = {kind_of(f"forces/{name}") for name in ("spring_compliance", "actuator_motor")}
    contact = {kind_of(f"contact/{name}") for name in ("rolling_coin", "cam_lift_off")}
    both = {kind_of(f"contact/{name}") for name in ("falling_chain",)}
    points = {kind_of(f"forces/{name}") for name in ("drag", "concentrated_expression")}
    assert [len(kinds) for kinds in (general, contact, both, points)] == [1, 1, 1, 1]
    assert len(general | contact | both | points) == 4


@pytest.mark.parametrize("name", ["joints/revolute", "joints/spherical", "elastic/cantilever"])
def test_models_without_optional_groups_pay_nothing(name):
    described = (describe(build_system(read_deck(DECKS / f"{name}.xml"))),)
    assert round_up(described) is described


def tables(model):
    sink = MemorySink()
    report = run(model, Options(error="off"), sink)
    assert report.status == "completed"
    return [np.array(sink.table(name)) for name in (STATES, REACTIONS, WORK)], sink.table(EVENTS)


@pytest.mark.parametrize(
    "changes",
    [{"scheme": "preserving"}, {"scheme": "gauss", "degree": 2}, {"scheme": "radau", "degree": 2}],
    ids=lambda changes: changes["scheme"],
)
@pytest.mark.parametrize(
    "name",
    [
        *("forces/drag", "forces/spring_compliance", "forces/actuator_motor"),
        *("contact/spinning_ball", "contact/cam_lift_off", "contact/crossed_rods"),
    ],
)
def test_groups_without_entries_change_no_digit(monkeypatch, name, changes):
    """All kernels run as plain Python, which finds every index beyond an array."""
    model = read_deck(DECKS / f"{name}.xml")
    dt = model.simulation.dt
    short = replace(model.simulation, t_final=10 * dt, output_interval=None, **changes)
    model = replace(model, simulation=short)
    filled = []

    def with_empty(function, *arguments):
        given = with_empty_groups(arguments)
        filled.append(any(new is not old for new, old in zip(given, arguments, strict=True)))
        return function.function(*given)

    monkeypatch.setattr(compiled, "_loads", lambda *_: False)  # nothing is compiled
    monkeypatch.setattr(Compiled, "__call__", lambda function, *given: function.function(*given))
    expected, events = tables(model)
    monkeypatch.setattr(Compiled, "__call__", with_empty)
    found, others = tables(model)
    assert any(filled)
    for one, other in zip(found, expected, strict=True):
        assert np.array_equal(one, other, equal_nan=True)
    assert events.tolist() == others.tolist()
