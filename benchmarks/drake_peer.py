"""Drake: a continuous MultibodyPlant in minimal coordinates, explicit Runge-Kutta of order 3 and 5.

Its ball joint has roll, pitch and yaw, singular at a pitch of 90 degrees. So joint axes are
rotated: motions in the x-z plane are rolls alone; those of a top near the vertical stay clear of
the pole.
"""

from functools import lru_cache
from importlib.metadata import version
from typing import NamedTuple

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BallRpyJoint, FixedOffsetFrame, RotationalInertia, SpatialInertia
from pydrake.systems.analysis import ResetIntegratorFromFlags, Simulator

from benchmarks.motion import Motion, observe_outputs
from msahl.algebra.rotation import matrix
from msahl.model import Model

VERSION = version("drake")


class Variant(NamedTuple):
    scheme: str  # empty: the discrete solver
    order: int
    controlled: bool


VARIANTS = {
    "drake RK3": Variant("runge_kutta3", 3, controlled=True),
    "drake RK5": Variant("runge_kutta5", 5, controlled=True),
    "drake RK3 fixed": Variant("runge_kutta3", 3, controlled=False),
    "drake RK5 fixed": Variant("runge_kutta5", 5, controlled=False),
}
LARGEST, SMALLEST = 0.1, 1e-6
"""Steps under error control [s]; where a smaller one is asked for, it gives up."""
ORDERS = {code: variant.order for code, variant in VARIANTS.items()}
CONTROLLED = tuple(code for code, variant in VARIANTS.items() if variant.controlled)
_COMMON = "continuous plant (time_step = 0), BallRpyJoint with frames rotated away from its pole"
_STEPS = {
    True: f"error control by target accuracy, steps at most {LARGEST:g} s (its default)",
    False: "fixed steps",
}
SETTINGS = {
    code: f"{variant.scheme}, {_STEPS[variant.controlled]}; {_COMMON}"
    for code, variant in VARIANTS.items()
}

ROLLING = RotationMatrix(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
"""Joint axes whose x, about which roll goes, is y of the problem."""


def motion(
    model: Model, h: float, steps: int, variant: str, every: int = 1, accuracy: float | None = None
) -> Motion:
    """Steps ``h``, or as many as ``accuracy`` asks for; either way some end at the output times."""
    simulator = _simulator(model, h, variant, accuracy)
    t = h * every * np.arange(steps // every + 1)
    rows, seconds = observe_outputs(
        lambda k: simulator.AdvanceTo(t[k]), lambda: _look(simulator, model), steps // every
    )
    x, R, v, w = (np.array(column) for column in zip(*rows, strict=True))
    taken = simulator.get_integrator().get_num_steps_taken()
    return Motion(t, x, R, v, w, seconds, taken)


def _look(simulator: Simulator, model: Model) -> tuple[np.ndarray, ...]:
    plant, context = simulator.get_system(), simulator.get_context()
    bodies = [plant.GetBodyByName(body.name) for body in model.bodies]
    poses = [plant.EvalBodyPoseInWorld(context, body) for body in bodies]
    speeds = [plant.EvalBodySpatialVelocityInWorld(context, body) for body in bodies]
    R = np.array([pose.rotation().matrix() for pose in poses])
    W = np.array([speed.rotational() for speed in speeds])
    v = np.array([speed.translational() for speed in speeds])
    return np.array([pose.translation() for pose in poses]), R, v, np.einsum("bji,bj->bi", R, W)


def _simulator(model: Model, h: float, variant: str, accuracy: float | None) -> Simulator:
    plant = _compile(model)
    simulator = Simulator(plant)
    chosen = VARIANTS[variant]
    set_integrator(simulator, chosen, h, accuracy, SMALLEST)
    _place(plant, simulator.get_mutable_context(), model)
    simulator.Initialize()
    return simulator


def set_integrator(
    simulator: Simulator, chosen: Variant, h: float, accuracy: float | None, smallest: float
) -> None:
    """Take steps ``h``, or of at least ``smallest`` [s] as ``accuracy`` asks for."""
    ResetIntegratorFromFlags(simulator, chosen.scheme, LARGEST if chosen.controlled else h)
    integrator = simulator.get_mutable_integrator()
    if chosen.controlled:
        integrator.set_target_accuracy(accuracy)
        integrator.set_requested_minimum_step_size(smallest)
    else:
        integrator.set_fixed_step_mode(True)


@lru_cache(maxsize=1)
def _compile(model: Model) -> MultibodyPlant:
    plant = MultibodyPlant(time_step=0.0)
    frames = {ground.name: plant.world_frame() for ground in model.grounds}
    for body in model.bodies:
        inertia = RotationalInertia(*np.diag(body.inertia))
        spatial = SpatialInertia.MakeFromCentralInertia(body.mass, np.zeros(3), inertia)
        frames[body.name] = plant.AddRigidBody(body.name, spatial).body_frame()
    axes = _axes(model)
    for joint in model.joints:
        points = (joint.parent, joint.parent_point), (joint.child, joint.child_point)
        ends = [
            FixedOffsetFrame(f"{joint.name} of {name}", frames[name], RigidTransform(axes, point))
            for name, point in points
        ]
        plant.AddJoint(BallRpyJoint(joint.name, *map(plant.AddFrame, ends)))
    plant.mutable_gravity_field().set_gravity_vector(model.gravity)
    plant.Finalize()
    return plant


def _axes(model: Model) -> RotationMatrix:
    """Axes of every joint, in those of its bodies."""
    spinning = any(any(body.angular_velocity) for body in model.bodies)
    return RotationMatrix() if spinning else ROLLING


def _place(plant: MultibodyPlant, context: object, model: Model) -> None:
    """Angles and their rates from orientations and angular velocities of the bodies."""
    axes = _axes(model).matrix()
    bodies = {body.name: body for body in model.bodies}
    for joint in model.joints:
        child, parent = bodies[joint.child], bodies.get(joint.parent)
        R = np.array(matrix(child.orientation))
        W, R_p = R @ child.angular_velocity, np.eye(3)
        if parent:
            R_p = np.array(matrix(parent.orientation))
            W = W - R_p @ parent.angular_velocity
        R_FM = axes.T @ R_p.T @ R @ axes
        hinge = plant.GetJointByName(joint.name)
        hinge.set_angles(context, RollPitchYaw(RotationMatrix(R_FM)).vector())
        hinge.set_angular_velocity(context, axes.T @ R_p.T @ W)
