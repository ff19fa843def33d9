"""Mass matrix and mass centre of an open model in the coordinates of its joints, by its records."""

from dataclasses import replace

import numpy as np

from msahl.joints.placement import Linkage, Place, place_of
from msahl.joints.tree import JointStart, spanning_tree


def without_rotors(model):
    """The model without bodies that are geared to a joint; and what these add to M, by joint."""
    geared = {coupling.first: coupling for coupling in model.couplings}
    bearings = [joint for joint in model.joints if joint.name in geared]
    names = {joint.child for joint in bearings}
    inertias = {body.name: body.inertia[2][2] for body in model.bodies}
    added = {
        geared[joint.name].second: inertias[joint.child] / geared[joint.name].ratio ** 2
        for joint in bearings
    }
    bare = replace(
        model,
        bodies=tuple(body for body in model.bodies if body.name not in names),
        joints=tuple(joint for joint in model.joints if joint not in bearings),
        couplings=(),
    )
    return bare, added


def linkage(model, values):
    """Bodies placed by the coordinates of joints: {joint: {coordinate: value}}."""
    roots = [ground.name for ground in model.grounds]
    starts = [(JointStart(joint, values.get(joint.name, {})), True) for joint in model.joints]
    branches, loops, _ = spanning_tree(roots, starts)
    assert not loops
    places = {name: Place(np.zeros(3), np.eye(3)) for name in roots}
    places |= {b.name: place_of(b.position, b.orientation) for b in model.bodies}
    found = Linkage(places, branches, loops, 1.0)
    found.place()
    return found


def mass_matrix(model, values, names):
    """M (n, n) by the ``names`` of joints, each with one coordinate."""
    model, added = without_rotors(model)
    found = linkage(model, values)
    chosen = {found.branches[k].start.joint.name: (k, c) for k, c in found.columns()}
    field = found.unit_velocities([chosen[name] for name in names])
    M = np.diag([added.get(name, 0.0) for name in names])
    for body in model.bodies:
        place, rates = found.places[body.name], field.of(body.name)
        J = place.R @ np.array(body.inertia) @ place.R.T
        v = rates.v + np.cross(rates.w, place.R @ np.array(body.r_BG))
        M += body.mass * v @ v.T + rates.w @ J @ rates.w.T
    return M


def mass_centre(model, values):
    """Mass [kg] and mass centre (3,) [m] of all bodies."""
    model, _ = without_rotors(model)
    found = linkage(model, values)
    mass = sum(body.mass for body in model.bodies)
    points = [
        body.mass * (found.places[body.name].x + found.places[body.name].R @ np.array(body.r_BG))
        for body in model.bodies
    ]
    return mass, sum(points) / mass
