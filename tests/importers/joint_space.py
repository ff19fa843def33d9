"""Mass matrix and mass centre of an open model in the coordinates of its joints, by its records."""

import numpy as np

from msahl.joints.placement import Linkage, Place, place_of
from msahl.joints.tree import JointStart, spanning_tree


def linkage(model, values):
    """Bodies placed by the coordinates of joints: {joint: {coordinate: value}}."""
    roots = [ground.name for ground in model.grounds]
    starts = [(JointStart(joint, values.get(joint.name, {})), True) for joint in model.joints]
    branches, loops, more = spanning_tree(roots, starts)
    assert not loops
    places = {name: Place(np.zeros(3), np.eye(3)) for name in roots}
    places |= {b.name: place_of(b.position, b.orientation) for b in model.bodies}
    found = Linkage(places, branches, loops, 1.0)
    found.place()
    return found


def mass_matrix(model, values, names):
    """M (n, n) by the ``names`` of joints, each with one coordinate."""
    found = linkage(model, values)
    chosen = {found.branches[k].start.joint.name: (k, c) for k, c in found.columns()}
    field = found.unit_velocities([chosen[name] for name in names])
    M = np.zeros((len(names), len(names)))
    for body in model.bodies:
        place, rates = found.places[body.name], field.of(body.name)
        J = place.R @ np.array(body.inertia) @ place.R.T
        v = rates.v + np.cross(rates.w, place.R @ np.array(body.r_BG))
        M += body.mass * v @ v.T + rates.w @ J @ rates.w.T
    return M


def mass_centre(model, values):
    """Mass [kg] and mass centre (3,) [m] of all bodies."""
    found = linkage(model, values)
    mass = sum(body.mass for body in model.bodies)
    points = [
        body.mass * (found.places[body.name].x + found.places[body.name].R @ np.array(body.r_BG))
        for body in model.bodies
    ]
    return mass, sum(points) / mass
