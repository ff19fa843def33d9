"""Drake: a tree of joints in minimal coordinates.

A tree is integrated by explicit Runge-Kutta formulas of order 3 and 5 and by the implicit Radau
formula of order 3. Loops and gears are constraints, which Drake has for discrete plants only: their
solver SAP takes steps of order 1.
"""

from functools import lru_cache
from importlib.metadata import version
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForce_,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    LinearSpringDamper,
    PrismaticJoint,
    RevoluteJoint,
    RotationalInertia,
    SpatialInertia,
    UnitInertia,
    UniversalJoint,
)
from pydrake.systems.analysis import Simulator

from benchmarks.drake_peer import Variant, set_integrator
from benchmarks.mechanisms.layout import Hinge, Layout, layout
from benchmarks.motion import Motion, observe_outputs
from msahl.model import Model

VERSION = version("drake")


VARIANTS = {
    "drake RK3": Variant("runge_kutta3", 3, controlled=True),
    "drake RK5": Variant("runge_kutta5", 5, controlled=True),
    "drake Radau3": Variant("radau3", 3, controlled=True),
    "drake RK5 fixed": Variant("runge_kutta5", 5, controlled=False),
    "drake SAP": Variant("", 1, controlled=False),
}
ORDERS = {code: variant.order for code, variant in VARIANTS.items()}
CONTROLLED = tuple(code for code, variant in VARIANTS.items() if variant.controlled)
SETTINGS = {
    "drake RK3": "runge_kutta3 with error control, continuous plant",
    "drake RK5": "runge_kutta5 with error control, continuous plant",
    "drake Radau3": "radau3 with error control, continuous plant",
    "drake RK5 fixed": "runge_kutta5 with fixed steps, continuous plant",
    "drake SAP": "discrete plant with the SAP solver; loops by ball constraints (two of them for a "
    "hinge), gears by coupler constraints",
}
STIFF = 1e4
"""Damping of a spring [N s/m] beyond which a mechanism counts as stiff."""
SMALLEST = 1e-5
"""Smallest step under error control [s]; where a smaller one is needed, it gives up."""


def cannot(model: Model, variant: str) -> str:
    """Return why Drake cannot take the model by this solver, empty if it can."""
    given = layout(model)
    loops = bool(given.closing or given.gears)
    if loops and VARIANTS[variant].scheme:
        return "its continuous plants have no constraints"
    if not loops and not VARIANTS[variant].scheme:
        return "order 1, while its continuous integrators take trees"
    stiff = any(spring.damping > STIFF for spring in given.springs)
    if stiff and variant == "drake RK5":
        return "its error control does not return from a step beyond the limit of stability"
    return ""


def motion(
    model: Model, h: float, steps: int, variant: str, every: int = 1, accuracy: float | None = None
) -> Motion:
    """Run ``steps`` steps ``h``, or as many as ``accuracy`` asks for in the same time."""
    simulator, plant = _simulator(model, h, variant, accuracy)
    context = plant.GetMyContextFromRoot(simulator.get_context())
    bodies = [plant.GetBodyByName(body.name) for body in model.bodies]

    def look() -> np.ndarray:
        poses = [plant.EvalBodyPoseInWorld(context, body) for body in bodies]
        return np.array([pose.translation() for pose in poses])

    t = h * every * np.arange(steps // every + 1)
    rows, seconds = observe_outputs(lambda k: simulator.AdvanceTo(t[k]), look, steps // every)
    taken = steps
    if VARIANTS[variant].scheme:
        taken = simulator.get_integrator().get_num_steps_taken()
    none = np.zeros(0)
    return Motion(t, np.array(rows), none, none, none, seconds, taken)


def _simulator(
    model: Model, h: float, variant: str, accuracy: float | None
) -> tuple[Simulator, MultibodyPlant]:
    chosen, given = VARIANTS[variant], layout(model)
    plant = compile_plant(model, 0.0 if chosen.scheme else h)
    simulator = Simulator(plant)
    if chosen.scheme:
        set_integrator(simulator, chosen, h, accuracy, SMALLEST)
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    place(plant, context, given)
    simulator.Initialize()
    return simulator, plant


def place(plant: MultibodyPlant, context: Any, given: Layout) -> None:
    """Set the rates of all joints, and the moments on bodies."""
    for hinge in given.tree:
        rates, joint = given.rates(hinge), plant.GetJointByName(hinge.name)
        velocities = plant.GetVelocities(context).copy()
        velocities[joint.velocity_start() : joint.velocity_start() + len(rates)] = rates
        plant.SetVelocities(context, velocities)
    forces = []
    for name, moment in given.moments.items():
        force = ExternallyAppliedSpatialForce_[float]()
        force.body_index = plant.GetBodyByName(name).index()
        force.F_Bq_W = SpatialForce(tau=moment, f=np.zeros(3))
        forces.append(force)
    if forces:
        plant.get_applied_spatial_force_input_port().FixValue(context, forces)


@lru_cache(maxsize=1)
def compile_plant(model: Model, h: float) -> MultibodyPlant:
    """Return the plant, discrete with the step ``h`` or continuous if ``h`` is 0."""
    given = layout(model)
    plant = MultibodyPlant(time_step=h)
    if h:
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kSap)
    frames = {"": plant.world_frame()}
    for name, mass in given.masses.items():
        tensor = mass.inertia
        products = tensor[0, 1], tensor[0, 2], tensor[1, 2]
        inertia = UnitInertia(RotationalInertia(*np.diag(tensor) / mass.mass,
                                                *np.array(products) / mass.mass))  # fmt: skip
        spatial = SpatialInertia(mass.mass, np.zeros(3), inertia)
        frames[name] = plant.AddRigidBody(name, spatial).body_frame()
    for hinge in given.tree:
        _add_joint(plant, frames, given, hinge)
    for spring in given.springs:
        ends = [plant.GetBodyByName(name) if name else plant.world_body() for name in spring.pair]
        points = [given.local(name, p) for name, p in zip(spring.pair, spring.points, strict=True)]
        plant.AddForceElement(
            LinearSpringDamper(
                ends[0],
                points[0],
                ends[1],
                points[1],
                spring.free,
                spring.stiffness,
                spring.damping,
            )
        )
    if h:
        _constrain(plant, given)
    plant.mutable_gravity_field().set_gravity_vector(given.gravity)
    plant.Finalize()
    return plant


def _add_joint(plant: MultibodyPlant, frames: dict[str, Any], given: Layout, hinge: Hinge) -> None:
    """A joint whose frame has x, y along the axes of a universal joint, z along a hinge's."""
    names = (hinge.inner, hinge.outer)
    if hinge.kind == "universal":
        x, y = hinge.axes
        rotation = RotationMatrix(np.column_stack([x, y, np.cross(x, y)]))
    else:
        rotation = RotationMatrix()
    ends = [
        plant.AddFrame(
            FixedOffsetFrame(
                f"{hinge.name} of {name or 'ground'}",
                frames[name],
                RigidTransform(rotation, given.local(name, hinge.point)),
            )
        )
        for name in names
    ]
    if hinge.kind == "universal":
        plant.AddJoint(UniversalJoint(hinge.name, *ends, damping=hinge.damping))
    elif hinge.kind == "prismatic":
        plant.AddJoint(PrismaticJoint(hinge.name, *ends, hinge.axis))
    elif hinge.kind == "revolute":
        plant.AddJoint(RevoluteJoint(hinge.name, *ends, hinge.axis, damping=hinge.damping))
    else:
        plant.AddJoint(BallRpyJoint(hinge.name, *ends, damping=hinge.damping))


def _constrain(plant: MultibodyPlant, given: Layout) -> None:
    """Loops and gears; a hinge outside a plane needs two common points."""
    for hinge in given.closing:
        for point in given.closing_points(hinge):
            bodies = [
                plant.GetBodyByName(name) if name else plant.world_body()
                for name in (hinge.inner, hinge.outer)
            ]
            places = [given.local(name, point) for name in (hinge.inner, hinge.outer)]
            plant.AddBallConstraint(bodies[0], places[0], bodies[1], places[1])
    for gear in given.gears:
        joints = [plant.GetJointByName(name) for name in (gear.second, gear.first)]
        plant.AddCouplerConstraint(*joints, gear.ratio)
