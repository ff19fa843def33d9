"""Models that begin at another configuration and are the same models otherwise.

What a model counts from t = 0, or takes from the places of bodies at t = 0, is made explicit:

    bodies               places and velocities there
    joints               frames from which their angles count, and what their coordinates count from
    springs              lengths and values of joint coordinates at which they are unloaded
    bushings             unloaded where their frames coincide
    lifts of cams        over the angle from there
    auxiliary states     their values

All else is fixed in the bodies and moves with them.
"""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from msahl.algebra.functions import Law
from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import plain_vector
from msahl.algebra.vector import Vector, at, dot
from msahl.analysis.constant_inputs import with_inputs
from msahl.analysis.linearised.point import Point
from msahl.analysis.linearised.projection import prepared
from msahl.check.context import Context, context_of
from msahl.check.directions import frame
from msahl.elements.constraints import scalar
from msahl.joints.joint import X, Z
from msahl.joints.registry import KINDS
from msahl.model import (
    Bushing,
    Coupling,
    Joint,
    JointSpring,
    Load,
    Model,
    RigidBody,
    SignalState,
    SpringDamper,
)
from msahl.model.settings import GIVEN
from msahl.model.signals import AnySignal
from msahl.system.collect import collect

NEGLIGIBLE = 1e-14
"""Displacement, over the size of the system, and rotation [rad] that are round-off: a coordinate
keeps its value, so that a planar model remains exactly planar."""


def moved_model(start: Point, point: Point) -> Model:
    """Return the model, which begins at ``start``, so that it begins at ``point``."""
    model = start.model
    size = NEGLIGIBLE * max(float(np.abs(start.state.x).max()), 1.0)
    bodies = tuple(_body(body, point, b, size) for b, body in enumerate(model.bodies))
    context = context_of(replace(model, bodies=bodies))
    joints = tuple(_joint(joint, context) for joint in model.joints)
    offsets = {
        joint.name: _angle(old.child_axes[X], joint)
        for old, joint in zip(model.joints, joints, strict=True)
    }
    travel = _spring_values(start, point)
    return replace(
        model,
        bodies=bodies,
        joints=joints,
        couplings=tuple(_coupling(record, offsets) for record in model.couplings),
        loads=tuple(_load(load, *travel.get(k, (0.0, 0.0))) for k, load in enumerate(model.loads)),
        signals=_signals(model, point),
        simulation=replace(model.simulation, start=GIVEN),
    )


def _body(body: RigidBody, point: Point, b: int, size: float) -> RigidBody:
    """Return a body with its place and its velocity at ``point``."""
    state = point.state
    P = _snapped(at(state.p, b), body.orientation, NEGLIGIBLE)
    R, arm = np.array(matrix(P)), np.array(body.r_BG)
    spin = state.w[b]
    position = _snapped(plain_vector(state.x[b] - R @ arm), body.position, size)
    velocity = plain_vector(R.T @ state.v[b] - np.cross(spin, arm))
    return replace(
        body,
        position=position,
        orientation=P,
        velocity=velocity,
        angular_velocity=plain_vector(spin),
    )


def _snapped(a: Vector, given: Vector, size: float) -> Vector:
    """Return ``a`` with those components of the ``given`` vector from which it hardly differs."""
    x, y, z = (old if abs(new - old) <= size else new for new, old in zip(a, given, strict=True))
    return (x, y, z)


def _joint(joint: Joint, context: Context) -> Joint:
    """Return a joint whose angle, if it has one, counts from where its bodies are now."""
    if "angle" not in KINDS[joint.kind].coordinates:
        return joint
    there = context.rotated(joint.parent_axes[X], joint.parent, joint.child)
    axes, old = frame(joint.child_axes[Z], there), joint.child_axes
    if max(abs(a - b) for a, b in zip(axes[X], old[X], strict=True)) <= NEGLIGIBLE:
        return joint
    return replace(joint, child_axes=axes, child_reference=joint.child_reference or old[X])


def _angle(x: Vector, joint: Joint) -> float:
    """Return the angle of a direction of the child in its frame [rad]."""
    return math.atan2(dot(x, joint.child_axes[1]), dot(x, joint.child_axes[X]))


def _coupling(coupling: Coupling, offsets: Mapping[str, float]) -> Coupling:
    """Return a coupling whose lift is over the angle that its first joint counts now."""
    if coupling.lift is None:
        return coupling
    return replace(coupling, lift=_shifted(coupling.lift, offsets[coupling.first]))


def _shifted(table: Law, travel: float) -> Law:
    """Return a table whose arguments count from a place further on by ``travel``."""
    half = len(table.numbers) // 2
    return replace(
        table, numbers=(*(x - travel for x in table.numbers[:half]), *table.numbers[half:])
    )


def _load(load: Load, before: float, after: float) -> Load:
    """Return a load whose spring is unloaded where it was, by the value of its coordinate
    ``before`` and ``after`` the model has moved."""
    if isinstance(load, Bushing):
        return replace(load, aligned=True)
    if isinstance(load, SpringDamper) and load.free_length is None and not load.table:
        return replace(load, free_length=before)
    if isinstance(load, JointSpring):
        travel = after - before
        if load.table is not None:
            return replace(load, table=_shifted(load.table, travel))
        return replace(load, free=load.free - travel)
    return load


def _spring_values(start: Point, point: Point) -> dict[int, tuple[float, float]]:
    """Return the values of the coordinates of springs at both configurations, angles counted, by
    the number of the load."""
    springs = collect(start.model).along
    if not springs:
        return {}
    before, after = _values(start), _values(point)
    return {
        entry.column: (float(before[entry.coordinate]), float(after[entry.coordinate]))
        for entry in springs
    }


def _values(point: Point) -> np.ndarray:
    """(q,) values of the coordinates, angles counted."""
    group = point.system.scalar
    assert group is not None  # springs act along coordinates
    start = prepared(point.system, point.state)
    value, rate = np.zeros((2, point.state.angle.size))
    scalar.values(group, start.scalar, start.frames, value, rate)
    return value


def _signals(model: Model, point: Point) -> tuple[AnySignal, ...]:
    """Return the signals, with the values of states at ``point``."""
    values = iter(point.state.auxiliary.tolist())
    return with_inputs(
        replace(signal, initial=next(values)) if isinstance(signal, SignalState) else signal
        for signal in model.signals
    )
