"""Models with contacts, and runs of them with their events."""

from dataclasses import replace

import numpy as np

from msahl.model import DistanceLimit, Options, PlaneContact
from msahl.model.scheme import split
from msahl.run.tables import EVENTS
from tests.support.models import GROUND, body, build_model, deck, run_in_memory

DOWN = (0.0, 0.0, -9.81)


def run_events(model, scheme, dt=None, t_final=None, tolerance=None, **options):
    """Report, sink and events (m, columns) of a run; ``scheme`` is a choice such as gauss2."""
    name, degree = split(scheme)
    given = {"scheme": name, "degree": degree, "dt": dt, "t_final": t_final}
    changes = {key: value for key, value in given.items() if value is not None}
    simulation = replace(model.simulation, tolerance=tolerance, **changes)
    if tolerance is None:
        options = {"error": "off"} | options
    report, sink = run_in_memory(replace(model, simulation=simulation), Options(**options))
    return report, sink, sink.table(EVENTS)


def times_of(events, kind):
    """(m,) times of the events of a kind."""
    return np.array([event[0] for event in events if event[1] == kind])


def ball(restitution, height=1.0, **others):
    """A point of 1 kg above a floor."""
    floor = PlaneContact(
        "Floor", GROUND.name, "Ball", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
    )
    contacts = (replace(floor, restitution=restitution),)
    bodies = [body("Ball", 1.0, 0.01, (0.0, 0.0, height), **others)]
    return build_model(bodies, gravity=DOWN, contacts=contacts)


def point_on_sphere():
    """A point on top of a smooth sphere of 1 m, released at 10 degrees."""
    angle = np.radians(10.0)
    bodies = [body("Point", 1.0, 0.01, (float(np.sin(angle)), 0.0, float(np.cos(angle))))]
    sphere = DistanceLimit("Sphere", GROUND.name, "Point", (0.0,) * 3, (0.0,) * 3, lower=1.0)
    return build_model(bodies, gravity=DOWN, dt=0.02, t_final=1.0, contacts=(sphere,))


def pendulum(restitution):
    """The deck of the pendulum at a wall."""
    model = deck("pendulum_at_a_wall")
    return replace(model, contacts=(replace(model.contacts[0], restitution=restitution),))


def box(position, tilt=0.0, restitution=0.5, **others):
    """A box of 0.4 x 0.2 x 0.2 m and 1 kg whose four lower corners may touch a floor."""
    from msahl.algebra.rotation import from_axis_angle

    inertia = (0.08 / 12.0, 0.2 / 12.0, 0.2 / 12.0)
    orientation = from_axis_angle((0.0, 1.0, 0.0), tilt)
    bodies = [body("Box", 1.0, inertia, position, orientation=orientation, **others)]
    corners = [(x, y, -0.1) for x in (-0.2, 0.2) for y in (-0.1, 0.1)]
    contacts = tuple(
        PlaneContact(
            f"Corner{k}",
            GROUND.name,
            "Box",
            (0.0, 0.0, 0.0),
            corner,
            (0.0, 0.0, 1.0),
            restitution=restitution,
        )
        for k, corner in enumerate(corners)
    )
    return build_model(bodies, gravity=DOWN, dt=0.01, t_final=2.0, contacts=contacts)
