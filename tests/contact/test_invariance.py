"""The same scene in other words: rotated, with other names, in another order."""

from dataclasses import replace

import numpy as np
import pytest

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.model import PlaneContact
from tests.contact.models import DOWN, run_events
from tests.support.models import GROUND, body, build_model

ROUND_OFF = 1e-11
"""Of places [m] and velocities [m/s] after some impacts of rods, each of which makes a difference
about three times as large."""
ROTATION = from_axis_angle((0.48, 0.6, 0.64), 1.1)
ENDS = (("Head", 0.5), ("Foot", -0.5))


def rotated(vector, R):
    return tuple((R @ vector).tolist())


def rods(names=("A", "B"), rotation=(0.0, 0.0, 0.0), backwards=False):
    """Two rods that are thrown, by velocities in their own axes, onto a rough floor; each has
    contacts at both ends.
    """
    R, bodies, contacts = np.array(matrix(rotation)), [], []
    given = [((0.7, 0.2, 0.0), (1.0, 0.3, 0.0)), ((-0.4, 0.5, 0.1), (0.0, -1.0, -0.5))]
    for k, (name, (tilt, velocity)) in enumerate(zip(names, given, strict=True)):
        place = rotated((2.0 * k, 0.0, 0.7), R)
        motion = {"velocity": velocity, "orientation": compose(rotation, tilt)}
        bodies.append(body(name, 1.0, (1 / 12, 1 / 12, 1e-3), place, **motion))
        for end, z in ENDS:
            floor = PlaneContact(
                f"{name}{end}",
                GROUND.name,
                name,
                (0.0, 0.0, 0.0),
                (0.0, 0.0, z),
                rotated((0.0, 0.0, 1.0), R),
            )
            contacts.append(replace(floor, friction=0.3, restitution=0.5))
    order = slice(None, None, -1 if backwards else 1)
    return build_model(
        bodies[order],
        gravity=rotated(DOWN, R),
        dt=0.01,
        t_final=0.6,
        contacts=tuple(contacts[order]),
    )


def ends(model, rotation=(0.0, 0.0, 0.0), backwards=False):
    """Places (2, 3) of the rods' centres at the end, rotated back, and their velocities (2, 3) in
    their own axes; kinds of events by body and by end, and their times.
    """
    _, sink, events = run_events(model, "gauss3")
    states = sink.table("states")[-1, 1:].reshape(2, 4, 3)[:: -1 if backwards else 1]
    found = np.vstack([states[:, 0] @ np.array(matrix(rotation)), states[:, 2]])
    first = model.bodies[-1 if backwards else 0].name
    told = sorted((round(e[0], 9), e[2].startswith(first), e[2][-4:], e[1]) for e in events)
    return found, told


@pytest.fixture(scope="module")
def given():
    found, told = ends(rods())
    assert sum(event[3] == "impact" for event in told) > 5
    return found, told


@pytest.mark.parametrize(
    "how", [{"rotation": ROTATION}, {"names": ("Z", "Y")}, {"backwards": True}], ids=str
)
def test_the_same_scene_moves_in_the_same_way(given, how):
    only = {key: value for key, value in how.items() if key != "names"}
    found, told = ends(rods(**how), **only)
    assert found == pytest.approx(given[0], abs=ROUND_OFF)
    assert told == given[1]
