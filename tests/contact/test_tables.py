"""Compliant contacts by a table of force over depth, against closed forms."""

from dataclasses import replace

import pytest

from msahl.algebra.functions import Law
from msahl.check import check
from msahl.model import Compliance
from tests.contact.models import run_events
from tests.support.models import deck

TABLE = Law("linear", (0.0, 0.01, 0.03, 0.0, 100.0, 1900.0))
DEPTH, FORCE, AT_END = 0.014768336247, 529.150262213, 0.160647105997


def stop(**others):
    """The deck's block and stop, which has these others."""
    model = deck("bump_stop")
    return replace(model, contacts=(replace(model.contacts[0], **others),))


def test_the_block_of_the_deck_goes_back_as_fast_as_it_came():
    """In pieces of two oscillations: steps of order 6 end at the entry between them."""
    report, sink, _ = run_events(stop(), "gauss3", 1e-3)
    states = sink.table("states")
    assert stop().contacts[0].compliance.table == TABLE
    # Digits of the deck's numbers; steps of 1 ms, a tenth of the contact.
    assert states[-1, 1] == pytest.approx(AT_END, abs=1e-9)
    assert states[-1, 7] == pytest.approx(2.0, abs=1e-12)
    assert report.extremes["energyErrorMax"] < 1e-12


@pytest.mark.parametrize("end", ["lower", "upper"])
def test_energy_holds_to_round_off(end):
    """Over steps of the midpoint element, at both ends of a range."""
    model = stop()
    if end == "upper":
        bodies = tuple(replace(one, velocity=(2.0, 0.0, 0.0)) for one in model.bodies)
        limit = replace(model.contacts[0], lower=None, upper=0.3)
        model = replace(model, bodies=bodies, contacts=(limit,))
    report, sink, _ = run_events(model, "preserving", 1e-3)
    assert report.extremes["energyErrorMax"] < 1e-12
    sign = 1.0 if end == "lower" else -1.0
    assert sink.table("states")[-1, 7] == pytest.approx(2.0 * sign, rel=1e-12)


def test_the_deepest_place_is_that_of_the_closed_form():
    _, sink, _ = run_events(stop(), "gauss3", 1e-4)
    # It is at most half of an output interval away from an output time.
    deepest = 0.1 - sink.table("states")[:, 1].min()
    assert deepest == pytest.approx(DEPTH, abs=0.5 * FORCE * 0.5e-4**2)


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9])
def test_damping_gives_the_restitution_by_any_force_over_the_depth(e):
    """The law of the depth is not in the equation between both."""
    law = Compliance(0.0, impact_speed=2.0, table=TABLE)
    model = stop(restitution=e, compliance=law)
    _, sink, _ = run_events(model, "gauss3", 2e-4)
    assert sink.table("states")[-1, 7] == pytest.approx(2.0 * e, rel=1e-7)


FAULTS = {
    "falls": ((0.0, 0.01, 0.03, 0.0, 100.0, 50.0), {}, "its force falls with the depth"),
    "no zero": ((0.0, 0.01, 1.0, 100.0), {}, "the first entry is 0 at 0"),
    "not in order": ((0.0, 0.03, 0.01, 0.0, 1.0, 2.0), {}, "increas"),
    "stiffness as well": (TABLE.numbers, {"stiffness": 1.0}, "over the depth already"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_tables_that_are_no_force_of_a_contact_are_refused(fault):
    numbers, others, message = FAULTS[fault]
    law = Compliance(**({"stiffness": 0.0, "table": Law("linear", numbers)} | others))
    found = check(stop(restitution=1.0, compliance=law))
    assert message in found[0].message
