"""Define the models of docs/validation/error.md: what each shows, how it is built, its duration."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.algebra.vector import ZERO, Vector, times
from msahl.deck import read_deck
from msahl.model import (
    ConcentratedLoad,
    Coupling,
    Ground,
    Joint,
    JointMotion,
    JointSpring,
    Law,
    Load,
    Model,
    RigidBody,
    Simulation,
    SpringDamper,
)
from msahl.run.mesh_error import FinerMesh
from tools.validation.pieces import Motion
from tools.validation.reference import Truth
from tools.validation.thesis_runs import ROOT

EARTH = "Earth"
DOWN = (0.0, 0.0, 9.80665)
UP = (0.0, 0.0, -9.80665)
REFINEMENTS = (1, 4, 16)
"""Steps from one output time to the next at the three fixed step sizes."""


@dataclass(frozen=True)
class Case:
    """A model from a builder, run for ``t_final`` [s], with ``outputs`` output times after the
    start, which are the ends of the largest steps. Its reference is that of ``reference`` or, if it
    has them, equations of ``motion`` by hand, or its ``own_truth``. ``finer`` returns the model
    with a finer mesh of its beams.
    """

    name: str
    kind: str
    build: Callable[[], Model]
    t_final: float
    outputs: int
    motion: Callable[[], Motion] | None = None
    own_truth: Callable[["Case"], Truth] | None = None
    finer: Callable[[], FinerMesh | None] = lambda: None

    @cached_property
    def model(self) -> Model:
        """Return the model."""
        return self.build()

    @property
    def times(self) -> np.ndarray:
        """Return the output times, the start first."""
        return self.t_final * np.arange(self.outputs + 1) / self.outputs


def deck(place: str) -> Callable[[], Model]:
    """Return a builder of the model of a deck."""
    return lambda: read_deck(ROOT / "decks" / f"{place}.xml")


def model_of(
    bodies: list[RigidBody],
    joints: list[Joint] | None = None,
    loads: list[Load] | None = None,
    gravity: Vector = ZERO,
    motions: list[JointMotion] | None = None,
    couplings: list[Coupling] | None = None,
) -> Model:
    """Return a model of these records."""
    return Model(
        gravity,
        (Ground(EARTH),),
        tuple(bodies),
        tuple(joints or ()),
        tuple(loads or ()),
        Simulation("", 0.01, 1.0),
        motions=tuple(motions or ()),
        couplings=tuple(couplings or ()),
    )


def body(
    name: str,
    mass: float,
    inertia: tuple[float, float, float],
    position: Vector = ZERO,
    orientation: Vector = ZERO,
    velocity: Vector = ZERO,
    angular_velocity: Vector = ZERO,
) -> RigidBody:
    """Return a body whose reference point is its mass centre."""
    a, b, c = inertia
    J = ((a, 0.0, 0.0), (0.0, b, 0.0), (0.0, 0.0, c))
    return RigidBody(name, mass, ZERO, J, position, orientation, velocity, angular_velocity)


def push(name: str, on: str, force: Vector, law: Law | None = None) -> ConcentratedLoad:
    """Return a force of constant direction at the mass centre of a body."""
    return ConcentratedLoad(name, on, ZERO, force, EARTH, ZERO, EARTH, law)


def pendulum(degrees: float) -> Model:
    """The thesis's single pendulum from an angle to its hanging position."""
    rotation = from_axis_angle((0.0, 1.0, 0.0), np.radians(degrees))
    bob = body("Bob", 2.0, (0.008,) * 3, times(matrix(rotation), (0.0, 0.0, 5.0)), rotation)
    joint = Joint("Pivot", "spherical", EARTH, "Bob", ZERO, (0.0, 0.0, -5.0))
    return model_of([bob], [joint], gravity=DOWN)


def struck_pendulum() -> Model:
    """The pendulum from 45 degrees, struck by 100 N for 3 ms, given as a table."""
    model = pendulum(45.0)
    law = Law("linear", (1.0, 1.0005, 1.0025, 1.003, 0.0, 1.0, 1.0, 0.0))
    return replace(model, loads=(push("Blow", "Bob", (100.0, 0.0, 0.0), law),))


def struck_body() -> Model:
    """A free body of 1 kg at rest, struck by 1000 N for 0.2 ms."""
    law = Law("linear", (0.5, 0.5001, 0.5002, 0.0, 1.0, 0.0))
    start = body("Body", 1.0, (0.1, 0.1, 0.1), velocity=(0.1, 0.0, 0.0))
    return model_of([start], loads=[push("Blow", "Body", (0.0, 1000.0, 0.0), law)])


def shaken_body() -> Model:
    """A free body under a force whose period is the largest step."""
    law = Law("sine", (1.0, 200.0 * np.pi, 0.5 * np.pi, 0.0))
    return model_of(
        [body("Body", 1.0, (0.1, 0.1, 0.1))],
        loads=[push("Shaker", "Body", (1000.0, 0.0, 0.0), law)],
    )


def late_pulse() -> Model:
    """A body at rest on a spring until a smooth pulse of 0.3 s, two ramps, acts at 1 s."""
    rise = Law("ramp", (0.0, 1.0, 1.0, 1.15))
    fall = Law("ramp", (0.0, -1.0, 1.15, 1.3))
    start = body("Body", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 1.0))
    spring = SpringDamper("Spring", EARTH, "Body", ZERO, ZERO, 40.0, 0.0, 1.0)
    force = (3.0, 0.0, 2.0)
    loads = [push("Rise", "Body", force, rise), push("Fall", "Body", force, fall)]
    return model_of([start], loads=[spring, *loads])


def bouncing_ball() -> Model:
    """A ball that falls along a slide on a spring that pushes only: a table with a breakpoint."""
    ball = body("Ball", 1.0, (0.01, 0.01, 0.01), (0.0, 0.0, 0.5))
    slide = Joint("Slide", "prismatic", EARTH, "Ball", ZERO, ZERO)
    # Counted from the start at 0.5 m: contact below -0.4 m.
    table = Law("linear", (-1.4, -0.4, 0.6, -4000.0, 0.0, 0.0))
    spring = JointSpring("Ground", "Slide", "slide", 0.0, 0.0, table=table)
    return model_of([ball], [slide], [spring], gravity=UP)


def overdamped_spring() -> Model:
    """A body on a spring and a strong damper: rates of 5 and of 2000 a second."""
    start = body("Body", 1.0, (0.1, 0.1, 0.1), (0.0, 0.0, 1.2))
    return model_of([start], loads=[SpringDamper("Leg", EARTH, "Body", ZERO, ZERO, 1e4, 2e3, 1.0)])


def planet() -> Model:
    """A body on a central spring, on an elliptic orbit of several revolutions, that spins."""
    start = body("Planet", 1.0, (0.02, 0.02, 0.03), (1.0, 0.0, 0.0), velocity=(0.0, 1.4, 0.0))
    spring = SpringDamper("Pull", EARTH, "Planet", ZERO, ZERO, 4.0, 0.0, 0.5)
    return model_of([start], loads=[spring])


def sleeping_top(spin: float) -> Model:
    """The top of decks/extreme/spin.xml, leaning by 0.3 rad and spinning at ``spin`` rad/s."""
    rotation = from_axis_angle((0.0, 1.0, 0.0), 0.3)
    place = times(matrix(rotation), (0.0, 0.0, 0.2))
    top = body("Top", 1.0, (0.4, 0.4, 0.75), place, rotation, angular_velocity=(0.0, 0.0, spin))
    joint = Joint("Pivot", "spherical", EARTH, "Top", ZERO, (0.0, 0.0, -0.2))
    return model_of([top], [joint], gravity=(0.0, 0.0, -3.0))


def cam_and_follower() -> Model:
    """A cam that a moment accelerates lifts a follower against a spring."""
    cam = body("Cam", 1.0, (0.1, 0.1, 0.1), angular_velocity=(0.0, 0.0, 2.0))
    follower = body("Follower", 0.5, (0.01, 0.01, 0.01), (1.0, 0.0, 0.0))
    x = np.linspace(0.0, 2.0 * np.pi, 9)
    lift = Law("periodic", (*x.tolist(), *(0.05 * (1.0 - np.cos(x[:-1]))).tolist(), 0.0))
    joints = [
        Joint("Axle", "revolute", EARTH, "Cam", ZERO, ZERO),
        Joint("Guide", "prismatic", EARTH, "Follower", (1.0, 0.0, 0.0), ZERO),
    ]
    moment = ConcentratedLoad("Motor", "Cam", ZERO, ZERO, EARTH, (0.0, 0.0, 0.4), EARTH)
    spring = JointSpring("Return", "Guide", "slide", 20.0, 0.5)
    coupling = Coupling("Contact", "camFollower", "Axle", "Guide", lift=lift)
    return model_of([cam, follower], joints, [moment, spring], couplings=[coupling])


def halted_arm() -> Model:
    """A pendulum on an arm that a ramp rotates by a right angle and stops."""
    arm = body("Arm", 2.0, (0.1, 0.1, 0.1), (0.5, 0.0, 0.0))
    bob = body("Bob", 1.0, (0.01, 0.01, 0.01), (1.0, 0.0, -0.8))
    joints = [
        Joint("Axle", "revolute", EARTH, "Arm", ZERO, (-0.5, 0.0, 0.0)),
        Joint("Hinge", "spherical", "Arm", "Bob", (0.5, 0.0, 0.0), (0.0, 0.0, 0.8)),
    ]
    motion = JointMotion("Motor", "Axle", "angle", Law("ramp", (0.0, 0.5 * np.pi, 0.2, 0.9)))
    return model_of([arm, bob], joints, gravity=UP, motions=[motion])


CASES = (
    Case("pendulum 45", "pendulum", deck("thesis/single_pendulum_45"), 4.0, 50),
    Case("pendulum 179", "near-separatrix", lambda: pendulum(179.0), 8.0, 80),
    Case("double pendulum 89", "pendulum", deck("thesis/double_pendulum_89"), 3.0, 60),
    Case("triple pendulum 45", "pendulum", deck("thesis/triple_pendulum_45"), 3.0, 60),
    Case("double pendulum 135", "chaotic", deck("thesis/double_pendulum_135"), 5.0, 100),
    Case("triple pendulum 135", "chaotic", deck("thesis/triple_pendulum_135"), 5.0, 100),
    Case("folded chain", "pendulum", deck("extreme/folded_chain"), 0.4, 80),
    Case("top 1", "top", deck("thesis/top_1"), 2.0, 60),
    Case("top 3", "top", deck("thesis/top_3"), 2.0, 60),
    Case("fast top", "top", lambda: sleeping_top(60.0), 1.0, 200),
    Case("gyroscope", "top", deck("mechanisms/gyroscope"), 0.5, 100),
    Case("torque-free body", "top", deck("basics/torque_free"), 5.0, 100),
    Case("offset body", "pendulum", deck("basics/offset_body"), 2.0, 60),
    Case("slider-crank in space", "closed loop", deck("mechanisms/spatial_slider_crank"), 0.8, 160),
    Case("Bricard", "redundant loop", deck("mechanisms/bricard"), 1.0, 20),
    Case("four-bar", "redundant loop", deck("mechanisms/four_bar_sketched"), 0.6, 60),
    Case("Andrews squeezer", "closed loop", deck("mechanisms/andrews_squeezer"), 0.005, 50),
    Case("driven four-bar", "joint motion", deck("mechanisms/four_bar"), 1.0, 50),
    Case("Hooke joint", "joint motion", deck("joints/universal"), 1.0, 50),
    Case("halted arm", "joint motion", halted_arm, 1.6, 40),
    Case("struck pendulum", "pulse", struck_pendulum, 2.0, 25),
    Case("struck body", "pulse", struck_body, 1.0, 20),
    Case("shaken body", "pulse", shaken_body, 0.2, 20),
    Case("late pulse", "breakpoint", late_pulse, 2.5, 50),
    Case("bouncing ball", "breakpoint", bouncing_ball, 1.2, 60),
    Case("cam and follower", "breakpoint", cam_and_follower, 2.0, 60),
    Case("planet", "orbit", planet, 12.0, 120),
    Case("conical pendulum", "orbit", deck("basics/conical_pendulum"), 6.0, 60),
    Case("point slider", "orbit", deck("joints/point_slider"), 1.0, 50),
    Case("friction hinge", "friction", deck("forces/friction_hinge"), 2.0, 40),
    Case("friction slide", "friction", deck("forces/friction_slide"), 1.5, 60),
    Case("stiff pendulum", "stiff", deck("extreme/stiff_pendulum"), 0.5, 100),
    Case("damped spring", "decay", deck("forces/spring_damper"), 2.0, 60),
    Case("overdamped spring", "stiff", overdamped_spring, 0.5, 50),
    Case("rolling disk", "rolling", deck("mechanisms/rolling_disk"), 1.0, 100),
    Case("screw", "joint", deck("joints/screw"), 1.0, 25),
    Case("gear", "joint", deck("joints/gear"), 2.0, 50),
)
