"""Tables of equilibria: the forces in them balance every body."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.rotation import matrix
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import find
from msahl.analysis.equilibria.tables import tables
from msahl.model import Bushing, ConcentratedLoad, SpringDamper
from tests.support.models import deck


def loaded_loop():
    """The loop with a bushing and a force in the axes of a body, doubled by a law of time."""
    model = deck("bushing_loop")
    name = model.bodies[1].name
    force = ConcentratedLoad(
        "Push", name, (0.1, 0.0, 0.0), (3.0, 0.0, 2.0), name, (0.0, 0.0, 0.0), name,
        law=Law("constant", (2.0,)),
    )  # fmt: skip
    return replace(model, loads=(*model.loads, force))


def columns(found, name, letters):
    """Three values of an element in the tables."""
    for header, rows in found.values():
        if f"{name}.{letters[0]}" in header:
            return np.array([rows[0, header.index(f"{name}.{c}")] for c in letters])
    raise KeyError(name)


def pulls(load, found, place):
    """Ends of a load between two bodies, and the force on the child."""
    if isinstance(load, Bushing):
        return columns(found, load.name, ("Fx", "Fy", "Fz"))
    header, rows = found["loads"]
    ends = (load.parent, load.parent_point), (load.child, load.child_point)
    a, b = (place[n][0] + place[n][1] @ np.array(s) if n in place else np.array(s) for n, s in ends)
    return rows[0, header.index(f"{load.name}.load")] * (a - b) / np.linalg.norm(a - b)


@pytest.mark.parametrize("model", [loaded_loop(), deck("suspension")], ids=["loop", "car"])
def test_the_forces_on_every_body_balance(model):
    solution = find(search_start(model), np.zeros(3))
    found = tables([solution])
    place, force = {}, {}
    for body in model.bodies:
        x = columns(found, body.name, ("x", "y", "z"))
        P = columns(found, body.name, ("P1", "P2", "P3"))
        place[body.name] = (x, np.array(matrix(tuple(P.tolist()))))
        force[body.name] = body.mass * np.array(model.gravity)
    for joint in model.joints:
        F = columns(found, joint.name, ("Fx", "Fy", "Fz"))
        for name, sign in ((joint.child, 1.0), (joint.parent, -1.0)):
            force[name] = force.get(name, 0.0) + sign * F
    for load in model.loads:
        if isinstance(load, ConcentratedLoad):
            force[load.body] = force[load.body] + columns(found, load.name, ("Fx", "Fy", "Fz"))
        elif isinstance(load, Bushing | SpringDamper):
            F = pulls(load, found, place)
            for name, sign in ((load.child, 1.0), (load.parent, -1.0)):
                force[name] = force.get(name, 0.0) + sign * F
    weight = sum(body.mass for body in model.bodies) * np.linalg.norm(model.gravity)
    for name in place:
        # An equilibrium is balanced to 1e-9 of its largest force.
        assert np.abs(force[name]).max() <= 1e-8 * weight, name


def test_a_quarter_of_a_car_stands_on_its_tyre():
    found = tables([find(search_start(deck("quarter_car")), np.zeros(3))])
    header, rows = found["loads"]
    # 300 kg on a wheel of 40 kg; the actuator pushes, the spring of the suspension is pressed.
    assert rows[0, header.index("Tyre.load")] == pytest.approx(340.0 * 9.81, rel=1e-12)
    assert rows[0, header.index("Spring.load")] == pytest.approx(-300.0 * 9.81, rel=1e-12)
