"""The matrix of a system with contacts has the blocks of those that are closed, and no others."""

from itertools import combinations

import numpy as np
import pytest

from msahl.linalg.elimination import products
from msahl.linalg.pattern import SIZE
from msahl.model import SphereContact
from msahl.system.build import build_system
from msahl.system.contacts import contacts_of, set_closed, set_sticking
from msahl.system.evaluate import jacobian_at_rest
from msahl.system.graph import graph_of, pattern_of
from msahl.system.reductions import all_unknowns
from msahl.system.state import build_state
from msahl.system.unknowns import choose
from tests.support.models import body, build_model, deck


def row_of_spheres(n):
    """Spheres of 0.1 m in a row, each of which may touch each other one."""
    names = [f"S{k}" for k in range(n)]
    bodies = [body(name, 1.0, 0.01, (0.2 * k, 0.0, 0.0)) for k, name in enumerate(names)]
    origin = (0.0, 0.0, 0.0)
    contacts = tuple(
        SphereContact(f"{a}.{b}", a, b, origin, origin, 0.1, 0.1) for a, b in combinations(names, 2)
    )
    return build_model(bodies, contacts=contacts)


def with_closed(model, chosen):
    """The system of a ``model`` with the contacts closed for whose names ``chosen`` is true; those
    with friction stick.
    """
    system = build_system(model)
    state = build_state(model, system)
    contacts = contacts_of(model, system, state)
    which = np.array([chosen(side.name) for side in model.contact_sides])
    nothing = np.zeros(system.scalar.coordinates.kind.size)
    set_closed(system, contacts, which, nothing)
    if system.forces.sliding is not None:
        own = contacts.sliding[which & (contacts.sliding >= 0)]
        set_sticking(system, np.isin(np.arange(system.forces.sliding.row.size), own), nothing)
    return system, state


def multiplications(n, chosen):
    system, _ = with_closed(row_of_spheres(n), chosen)
    return products(choose(system, all_unknowns(system)).elimination)


def is_of_neighbours(name):
    """Whether a contact is one of two neighbours in the row."""
    first, second = (int(part[1:]) for part in name.split("."))
    return second == first + 1


def test_open_contacts_cost_no_multiplications():
    assert multiplications(8, lambda name: False) == 2 * multiplications(4, lambda name: False)


def test_multiplications_grow_with_the_closed_contacts():
    counts = [multiplications(n, is_of_neighbours) for n in (6, 12, 18)]
    assert counts[2] - counts[1] == counts[1] - counts[0] > 0


def test_order_sees_closed_contacts_alone():
    system, _ = with_closed(row_of_spheres(6), is_of_neighbours)
    graph = graph_of(system)
    assert graph.bodies.first.size - 1 == 5
    assert {tuple(sorted(pair)) for pair in graph.coupled.tolist()} == {
        (k, k + 1) for k in range(5)
    }


@pytest.mark.parametrize(
    "name",
    ["box_on_slope", "ball_on_a_plank", "steps", "crossed_rods", "woodpecker", "geneva_wheel"],
)
def test_nothing_of_a_closed_contact_is_outside_the_pattern(name):
    model = deck(name)
    system, state = with_closed(model, lambda name: True)
    values = jacobian_at_rest(system, state).reshape(-1, SIZE)[1:]
    entries = pattern_of(system).entries.reshape(-1, SIZE)[1:]
    assert not values[~entries].any()
    of_open = system.pattern.reshape(-1, SIZE)[1:]
    assert values[~of_open].any()
