"""Exudyn: rigid bodies in redundant coordinates and spherical joints, implicit integration.

Its kinematic tree (minimal coordinates, explicit) has no spherical joint, and three revolutes in
its place are singular in the plane of these motions; so it is omitted.
"""

import os
from typing import Any, NamedTuple

import numpy as np

# The build without range checks, which Exudyn recommends for speed; to be chosen before import.
os.environ.setdefault("EXUDYN_MODULE", "fast")

import exudyn as exu
from exudyn.itemInterface import SensorBody
from exudyn.rigidBodyUtilities import RigidBodyInertia

from benchmarks.motion import Motion
from msahl.algebra.rotation import matrix
from msahl.model import Model

VERSION = exu.__version__
SPARSE_FROM = 10
"""Bodies from which the sparse solver is the faster one for Exudyn (measured: 3 no, 10 yes)."""


class _Variant(NamedTuple):
    solver: Any
    node: Any


_VECTOR, _PARAMETERS = exu.NodeType.RotationRotationVector, exu.NodeType.RotationEulerParameters
VARIANTS = {
    "exudyn index 3": _Variant(exu.DynamicSolverType.GeneralizedAlpha, _VECTOR),
    "exudyn index 2": _Variant(exu.DynamicSolverType.TrapezoidalIndex2, _VECTOR),
    "exudyn index 2 EP": _Variant(exu.DynamicSolverType.TrapezoidalIndex2, _PARAMETERS),
}
ORDERS = dict.fromkeys(VARIANTS, 2)
_COMMON = (
    "fast build, modified Newton with default tolerances (relative 1e-8, absolute 1e-10), one "
    f"thread, dense solver below {SPARSE_FROM} bodies, then EigenSparse; CreateRigidBody and "
    "CreateSphericalJoint"
)
SETTINGS = {
    "exudyn index 3": "GeneralizedAlpha, index 3, spectral radius 0.9 (its default), Lie group "
    f"nodes with rotation vector; {_COMMON}",
    "exudyn index 2": "TrapezoidalIndex2 (its generalised-alpha solver as Newmark with velocity "
    "constraints), Lie group nodes with rotation vector; otherwise the same",
    "exudyn index 2 EP": "TrapezoidalIndex2, nodes with Euler parameters (CreateRigidBody's own "
    "default); otherwise the same",
}


def loop_seconds(model: Model, h: float, steps: int, variant: str) -> float:
    """Seconds as Exudyn's solver counts them, without output."""
    mbs = _build(model, VARIANTS[variant].node)[0]
    return _solve(mbs, model, h, steps, variant, stored=0)


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    mbs, bodies = _build(model, VARIANTS[variant].node)
    kinds = exu.OutputVariableType
    wanted = (kinds.Position, kinds.RotationMatrix, kinds.Velocity, kinds.AngularVelocityLocal)
    sensors = [[_sensor(mbs, body, kind) for body in bodies] for kind in wanted]
    mbs.Assemble()
    seconds = _solve(mbs, model, h, steps, variant, stored=every)
    iterations = int(mbs.sys["dynamicSolver"].it.newtonStepsCount)
    tables = [np.stack([mbs.GetSensorStoredData(s) for s in group], axis=1) for group in sensors]
    x, R, v, w = (table[:, :, 1:] for table in tables)
    t, counted = tables[0][:, 0, 0], (seconds, steps, iterations)
    return Motion(t, x, R.reshape(*R.shape[:2], 3, 3), v, w, *counted)


def _sensor(mbs: Any, body: int, kind: Any) -> int:
    return mbs.AddSensor(SensorBody(bodyNumber=body, storeInternal=True, outputVariableType=kind))


def _build(model: Model, node: Any) -> tuple[Any, list[int]]:
    mbs = exu.SystemContainer().AddSystem()
    items = {ground.name: mbs.CreateGround() for ground in model.grounds}
    for body in model.bodies:
        R = np.array(matrix(body.orientation))
        items[body.name] = mbs.CreateRigidBody(
            referencePosition=list(body.position),
            referenceRotationMatrix=R,
            initialVelocity=list(R @ body.velocity),
            initialAngularVelocity=list(R @ body.angular_velocity),
            inertia=RigidBodyInertia(body.mass, np.array(body.inertia)),
            gravity=list(model.gravity),
            nodeType=node,
        )
    places = {body.name: body for body in model.bodies}
    for joint in model.joints:
        child = places[joint.child]
        point = child.position + np.array(matrix(child.orientation)) @ joint.child_point
        pair = [items[joint.parent], items[joint.child]]
        mbs.CreateSphericalJoint(itemNumbers=pair, position=list(point), show=False)
    mbs.Assemble()
    return mbs, [items[body.name] for body in model.bodies]


def _solve(mbs: Any, model: Model, h: float, steps: int, variant: str, stored: int) -> float:
    """Rows are stored every ``stored`` steps; none if 0."""
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.active = stored > 0
    settings.solution.sensors.writePeriod = h * max(stored, 1)
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = steps * h
    settings.timeIntegration.adaptiveStep = False
    settings.timeIntegration.verboseMode = 0
    if len(model.bodies) >= SPARSE_FROM:
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    mbs.SolveDynamic(settings, solverType=VARIANTS[variant].solver)
    return float(mbs.sys["dynamicSolver"].timer.total)
