"""Drake: compliant point contact, of a discrete plant or, under error control, of CENIC.

Hydroelastic contact is switched off: spheres touch a half space or each other at one point. A
contact is so stiff that half a period of a body on it lasts a given number of steps or, under error
control, a given time. SAP has a linear damper, which is given the coefficient of restitution; the
others have Hunt and Crossley's, whose restitution depends on the speed: they are given that at the
speed of the first impact. The slip up to which friction is rounded goes with the step, too.
"""

import logging
import math
from importlib.metadata import version
from typing import Any, NamedTuple

import numpy as np
from pydrake.geometry import AddContactMaterial, HalfSpace, ProximityProperties, Sphere
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.multibody.plant import (
    AddMultibodyPlant,
    CoulombFriction,
    MultibodyPlant,
    MultibodyPlantConfig,
)
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
)
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator
from pydrake.systems.framework import DiagramBuilder

from benchmarks.contact.layout import Ball, Pair, damping_ratio, pairs
from benchmarks.contact.scenes import FIRST_IMPACT
from benchmarks.mechanisms.layout import Hinge, Layout, Mass, layout
from benchmarks.motion import Motion, observe_outputs
from msahl.model import Model

VERSION = version("drake")
# Half spaces are not for deformable bodies, it says of every model.
logging.getLogger("drake").setLevel(logging.ERROR)


class _Variant(NamedTuple):
    approximation: str  # of the discrete plant; empty: CENIC
    lasts: float  # a contact: steps, or seconds under error control
    slip: float  # up to which friction is rounded [m/s], of discrete plants by second of step


VARIANTS = {
    "drake SAP, 10": _Variant("sap", 10, 1e-2),
    "drake SAP, 100": _Variant("sap", 100, 1e-2),
    "drake lagged, 3": _Variant("lagged", 3, 1e-2),
    "drake lagged, 10": _Variant("lagged", 10, 1e-2),
    "drake similar, 10": _Variant("similar", 10, 1e-2),
    "drake CENIC, 10 ms": _Variant("", 1e-2, 1e-4),
    "drake CENIC, 1 ms": _Variant("", 1e-3, 1e-6),
    "drake CENIC, 0.1 ms": _Variant("", 1e-4, 1e-7),
}
ORDERS = dict.fromkeys(VARIANTS, 1)
CONTROLLED = tuple(code for code, variant in VARIANTS.items() if not variant.approximation)
LEAST_SLIP = 1e-10
"""Slip [m/s] below which friction is always rounded: Drake refuses zero."""
LARGEST, SMALLEST = 0.1, 1e-12
"""Steps under error control [s]; where a smaller one is asked for, it gives up."""
DISSIPATION = 50.0
"""Hunt and Crossley's dissipation of contacts without rebound [s/m]."""
_NAMES = {"sap": "SAP", "lagged": "lagged convex (ICF)", "similar": "similar convex"}
SETTINGS = {
    code: (
        f"discrete plant, {_NAMES[v.approximation]}; contacts last {v.lasts:g} steps, friction is "
        f"rounded up to {v.slip:g} m/s per second of step"
        if v.approximation
        else f"CENIC by target accuracy, steps at most {LARGEST:g} s; contacts last "
        f"{1e3 * v.lasts:g} ms, stiction tolerance {v.slip:g} m/s"
    )
    for code, v in VARIANTS.items()
}


def cannot(model: Model, variant: str) -> str:
    """Return why Drake cannot take the model by this solver, empty if it can."""
    return ""


def motion(
    model: Model, h: float, steps: int, variant: str, every: int = 1, accuracy: float | None = None
) -> Motion:
    """Run ``steps`` steps ``h``, or as many as ``accuracy`` asks for in the same time."""
    simulator, plant = _simulator(model, h, VARIANTS[variant], accuracy)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    bodies = [plant.GetBodyByName(body.name) for body in model.bodies]

    def look() -> np.ndarray:
        poses = [plant.EvalBodyPoseInWorld(context, body) for body in bodies]
        return np.array([pose.translation() for pose in poses])

    t = h * every * np.arange(steps // every + 1)
    rows, seconds = observe_outputs(lambda k: simulator.AdvanceTo(t[k]), look, steps // every)
    taken = steps
    if accuracy is not None:
        taken = simulator.get_integrator().get_num_steps_taken()
    none = np.zeros(0)
    return Motion(t, np.array(rows), none, none, none, seconds, taken)


def _simulator(
    model: Model, h: float, chosen: _Variant, accuracy: float | None
) -> tuple[Simulator, MultibodyPlant]:
    builder = DiagramBuilder()
    plant = _add_plant(builder, model, h, chosen)
    simulator = Simulator(builder.Build())
    if accuracy is not None:
        integrator = ResetIntegratorFromFlags(simulator, "cenic", LARGEST)
        integrator.set_target_accuracy(accuracy)
        integrator.set_requested_minimum_step_size(SMALLEST)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    _place(plant, context, layout(model))
    simulator.Initialize()
    return simulator, plant


def _place(plant: MultibodyPlant, context: Any, given: Layout) -> None:
    hinged = {hinge.outer for hinge in given.tree}
    for hinge in given.tree:
        plant.GetJointByName(hinge.name).set_angular_rate(context, given.rates(hinge)[0])
    for name, mass in given.masses.items():
        if name not in hinged:
            body, speed = plant.GetBodyByName(name), SpatialVelocity(w=mass.w, v=mass.v)
            plant.SetFreeBodyPose(context, body, RigidTransform(mass.x))
            plant.SetFreeBodySpatialVelocity(context, body, speed)


def _add_plant(builder: DiagramBuilder, model: Model, h: float, chosen: _Variant) -> MultibodyPlant:
    """Add a discrete plant with the step ``h``, or a continuous one."""
    given, unit = layout(model), h if chosen.approximation else 1.0
    config = MultibodyPlantConfig(
        time_step=h if chosen.approximation else 0.0,
        contact_model="point",
        discrete_contact_approximation=chosen.approximation or "lagged",
        sap_near_rigid_threshold=0.0,
        stiction_tolerance=max(LEAST_SLIP, chosen.slip * unit),
    )
    plant, _ = AddMultibodyPlant(config, builder)
    plant.set_name("plant")
    frames = {"": plant.world_frame()}
    for name, mass in given.masses.items():
        frames[name] = plant.AddRigidBody(name, _inertia(mass)).body_frame()
    for hinge in given.tree:
        _add_hinge(plant, frames, given, hinge)
    planes: set[bytes] = set()
    for number, pair in enumerate(pairs(model)):
        _add_pair(plant, pair, number, chosen.lasts * unit, planes)
    plant.mutable_gravity_field().set_gravity_vector(given.gravity)
    plant.Finalize()
    return plant


def _inertia(mass: Mass) -> SpatialInertia:
    J = mass.inertia / mass.mass
    unit = UnitInertia(RotationalInertia(*np.diag(J), J[0, 1], J[0, 2], J[1, 2]))
    return SpatialInertia(mass.mass, np.zeros(3), unit)


def _add_hinge(plant: MultibodyPlant, frames: dict[str, Any], given: Layout, hinge: Hinge) -> None:
    ends = [
        plant.AddFrame(
            FixedOffsetFrame(
                f"{hinge.name} of {name or 'ground'}",
                frames[name],
                RigidTransform(given.local(name, hinge.point)),
            )
        )
        for name in (hinge.inner, hinge.outer)
    ]
    plant.AddJoint(RevoluteJoint(hinge.name, *ends, hinge.axis))


def _add_pair(
    plant: MultibodyPlant, pair: Pair, number: int, lasts: float, planes: set[bytes]
) -> None:
    """Add the shapes of a pair, a plane once; stiffnesses of two shapes are in series."""
    _add_ball(plant, pair.ball, f"{number} ball", _material(pair, lasts))
    if isinstance(pair.other, Ball):
        _add_ball(plant, pair.other, f"{number} other", _material(pair, lasts))
        return
    key = np.concatenate([pair.other.point, pair.other.normal]).tobytes()
    if key not in planes:
        planes.add(key)
        pose = HalfSpace.MakePose(pair.other.normal, pair.other.point)
        properties = _material(pair, lasts)
        plant.RegisterCollisionGeometry(
            plant.world_body(), pose, HalfSpace(), f"{number} other", properties
        )


def _material(pair: Pair, lasts: float) -> ProximityProperties:
    properties, ratio = ProximityProperties(), damping_ratio(pair.restitution)
    frequency = math.pi / lasts
    dissipation = DISSIPATION
    if pair.restitution:
        frequency /= math.sqrt(1.0 - ratio * ratio)
        e = pair.restitution
        dissipation = (1.0 - e) / (e * FIRST_IMPACT)
    # Of each of the two shapes, whose dissipations are averaged and relaxation times added.
    AddContactMaterial(
        properties=properties,
        dissipation=dissipation,
        point_stiffness=2.0 * pair.mass * frequency**2,
        friction=CoulombFriction(pair.friction, pair.friction),
    )
    properties.AddProperty("material", "relaxation_time", ratio / frequency)
    return properties


def _add_ball(
    plant: MultibodyPlant, ball: Ball, name: str, properties: ProximityProperties
) -> None:
    body, place = plant.GetBodyByName(ball.body), RigidTransform(ball.point)
    plant.RegisterCollisionGeometry(body, place, Sphere(ball.radius), name, properties)
