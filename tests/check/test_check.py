"""A model made in Python is checked without XML: faults are sentences, sound models have none."""

import math
from dataclasses import fields, is_dataclass, replace
from pathlib import Path

import pytest

from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.check import check
from msahl.deck import read_deck
from msahl.deck.faults import KINDS
from msahl.model import (
    ConcentratedLoad,
    Coupling,
    Ground,
    Joint,
    JointMotion,
    Limits,
    Model,
    PointMotion,
    RigidBody,
    Simulation,
    SpringDamper,
)
from tests.support.models import drag

ROOT = Path(__file__).parents[2]
DECKS = sorted((ROOT / "decks").glob("*/*.xml")) + sorted(ROOT.glob("msahl/deck/templates/*.xml"))

BALL = ((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1))
BOB = RigidBody("Bob", 1.0, ZERO, BALL, ZERO, ZERO, ZERO, ZERO)
AXLE = Joint("Axle", "revolute", "Base", "Bob", ZERO, ZERO)
MOTOR = JointMotion("Motor", "Axle", "angle", Law("polynomial", (0.0, 1.0)))
PUSH = ConcentratedLoad("Push", "Bob", ZERO, (1.0, 0.0, 0.0), "Base", ZERO, "Base")
RUN = Simulation("", 0.01, 1.0)
MODEL = Model(ZERO, (Ground("Base"),), (BOB,), (AXLE,), (PUSH,), RUN, motions=(MOTOR,))


def body(**changes):
    return replace(MODEL, bodies=(replace(BOB, **changes),))


def joint(**changes):
    return replace(MODEL, joints=(replace(AXLE, **changes),))


def motion(*motions):
    return replace(MODEL, motions=motions)


def load(record):
    return replace(MODEL, loads=(record,))


def law(kind, *numbers):
    return motion(replace(MOTOR, law=Law(kind, numbers)))


def run(**changes):
    return replace(MODEL, simulation=replace(RUN, **changes))


WHEEL = replace(BOB, name="Wheel")
GEARED = replace(
    MODEL,
    bodies=(BOB, WHEEL),
    joints=(AXLE, replace(AXLE, name="Other", child="Wheel")),
)
SLIDING = replace(GEARED, joints=(AXLE, replace(GEARED.joints[1], kind="prismatic")))
SPRING = SpringDamper("Spring", "Base", "Bob", ZERO, (1.0, 0.0, 0.0), 1.0, 0.0)

WRONG = {
    "speed that jumps": (
        replace(
            law("linear", 0.0, 0.5, 2.0, 0.0, 1.0, 1.0),
            simulation=replace(RUN, scheme="auto", tolerance=1e-3),
        ),
        "motion 'Motor', law: the speed of a linear table jumps at its entries, first at t = 0.5 s",
    ),
    "no body": (replace(MODEL, bodies=(), joints=(), motions=(), loads=()), "nothing in the model"),
    "mass": (body(mass=-1.0), "body 'Bob', mass: the mass is -1 kg; it must be greater than zero"),
    "mass of nan": (body(mass=math.nan), "body 'Bob', mass: nan is not a finite number"),
    "inertia": (
        body(inertia=((0.1, 0.0, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.3))),
        "body 'Bob', inertia: principal moments about G 0.1, 0.1, 0.3 kg-m^2: none may exceed",
    ),
    "inertia of nan": (body(inertia=((math.nan,) * 3,) * 3), "inertia: nan is not a finite number"),
    "inertia not symmetric": (
        body(inertia=((0.1, 0.02, 0.0), (0.0, 0.1, 0.0), (0.0, 0.0, 0.1))),
        "inertia: the tensor is not symmetric",
    ),
    "far away": (body(position=(1e200, 0.0, 0.0)), "position: 1e+200 is too large"),
    "name": (body(name="Bob,1"), "body 'Bob,1', name: a name must not contain ,"),
    "no name": (body(name=""), "body 2, name: the name is empty"),
    "name twice": (
        replace(MODEL, bodies=(BOB, BOB)),
        "body 'Bob', name: the name is taken by body 2; choose another",
    ),
    "name of a joint and a load": (load(replace(PUSH, name="Axle")), "is taken by joint 1"),
    "child": (
        joint(child="Bib"),
        "joint 'Axle', child: child 'Bib' is not a body of this model (bodies: Base, Bob)",
    ),
    "kind of joint": (joint(kind="hinge"), "joint 'Axle', kind: unknown kind of joint 'hinge'"),
    "no parameter": (joint(kind="screw"), "a screw has the parameters pitch; give these"),
    "parameter": (
        joint(kind="sphericalSlider", parameters=(("radius", -1.0),)),
        "joint 'Axle', radius: it is -1; it must be greater than 0",
    ),
    "two grounds": (joint(child="Base"), "parent and child are both 'Base'"),
    "axes": (
        joint(parent_axes=((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 2.0))),
        "parent_axes: its rows must be three right-handed unit vectors",
    ),
    "frames": (
        joint(child_axes=((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))),
        "joint 'Axle', child_axes: its frames are rotated by 90 deg about the axis at t = 0",
    ),
    "points": (
        joint(child_point=(1.0, 0.0, 0.0)),
        "joint 'Axle': its points are 1 m apart at t = 0: (0, 0, 0) m on parent 'Base'",
    ),
    "coordinate": (
        motion(replace(MOTOR, coordinate="slide")),
        "motion 'Motor', joint: joint 'Axle', a revolute, has no coordinate slide",
    ),
    "word for a coordinate": (
        motion(replace(MOTOR, coordinate="spin")),
        "unknown coordinate 'spin'",
    ),
    "motion of no joint": (motion(replace(MOTOR, joint="J")), "joint 'J' is not a joint of this"),
    "motions of one coordinate": (
        motion(MOTOR, replace(MOTOR, name="Second")),
        "motion 'Second': the angle of 'Axle' already has a prescribed motion ('Motor'); keep one",
    ),
    "direction": (
        motion(PointMotion("M", "Bob", ZERO, ZERO, MOTOR.law)),
        "motion 'M', direction: the direction is zero",
    ),
    "length of a direction": (
        motion(PointMotion("M", "Bob", ZERO, (0.0, 0.0, 2.0), MOTOR.law)),
        "its length is 2; give a vector of length 1",
    ),
    "point of a ground": (
        motion(PointMotion("M", "Base", ZERO, (0.0, 0.0, 1.0), MOTOR.law)),
        "'Base' is a ground and never moves",
    ),
    "kind of law": (law("spline", 1.0), "law/kind: unknown kind of law 'spline'"),
    "table": (law("linear", 0.0, 0.0, 1.0, 2.0), "law/entry[2]: the argument must increase"),
    "short table": (law("cubic", 0.0, 1.0, 1.0, 2.0), "a cubic table needs 3 entries or more"),
    "odd table": (law("linear", 0.0, 1.0, 1.0), "a linear table has 3 numbers; give pairs"),
    "sine": (law("sine", 1.0, 0.0, 0.0, 0.0), "law/frequency: it is zero"),
    "ramp": (law("ramp", 0.0, 1.0, 2.0, 1.0), "it ends at 1 s, not after its start at 2 s"),
    "numbers of a ramp": (law("ramp", 0.0, 1.0), "a ramp law has 4 numbers; it has 2"),
    "open period": (
        law("periodic", 0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 0.0, 0.5),
        "a periodic table ends with the value it begins with",
    ),
    "no curve": (law("linear", 0.0, 1e-310, 0.0, 1.0), "no curve can be computed"),
    "gear of one joint": (
        replace(GEARED, couplings=(Coupling("G", "gear", "Axle", "Axle", 1.0),)),
        "joint 'G': first and second are both 'Axle'",
    ),
    "ratio": (
        replace(GEARED, couplings=(Coupling("G", "gear", "Axle", "Other", 0.0),)),
        "joint 'G', ratio: the ratio is zero, which couples nothing",
    ),
    "cam without lift": (
        replace(SLIDING, couplings=(Coupling("C", "camFollower", "Axle", "Other"),)),
        "joint 'C', lift: a camFollower has no lift",
    ),
    "cam on a hinge": (
        replace(GEARED, couplings=(Coupling("C", "camFollower", "Axle", "Other"),)),
        "joint 'Other', a revolute, has no coordinate slide",
    ),
    "load on a ground": (load(drag("D", "Base", ZERO, 1.0)), "'Base' is a ground and never moves"),
    "drag": (load(drag("D", "Bob", ZERO, -1.0)), "load 'D', coefficient: it is -1; it must not be"),
    "basis": (load(replace(PUSH, force_basis="Wall")), "force_basis 'Wall' is not a body of this"),
    "damping": (load(replace(SPRING, damping=-1.0)), "load 'Spring', damping: it is -1"),
    "length": (load(replace(SPRING, child_point=ZERO)), "its length is zero at t = 0"),
    "step": (run(dt=2.0), "simulation, deltaT: the step 2 s is longer than the run of 1 s"),
    "tolerance": (run(tolerance=1e-6), "simulation, tolerance: the preserving scheme takes the"),
    "tolerance of zero": (run(scheme="gauss", tolerance=0.0), "tolerance: it is 0 m; it must be"),
    "two tolerances": (
        run(scheme="gauss", tolerance=1e-6, local_tolerance=1e-6),
        "localTolerance: steps are chosen by a tolerance or by a localTolerance; give one of them",
    ),
    "steps": (run(dt=1e-10, t_final=1e3), "deltaT: 1e+13 steps of 1e-10 s to 1000 s are more"),
    "scheme": (run(scheme="euler"), "simulation, scheme: unknown value 'euler'; expected one of"),
    "degree": (run(scheme="gauss", degree=0), "simulation, degree: the degree is 0"),
    "limit": (run(limits=Limits(violation=0.0)), "verdict/constraintViolation: the limit is 0"),
    "start": (replace(MODEL, velocity="any"), "assembly/velocity: unknown value 'any'"),
    "gravity": (replace(MODEL, gravity=(0.0, 0.0, math.inf)), "gravity: inf is not a finite"),
}


def test_a_sound_model_has_no_faults():
    assert check(MODEL) == []
    assert check(GEARED) == []


@pytest.mark.parametrize("name", WRONG)
def test_a_fault_is_a_sentence_with_a_remedy(name):
    model, message = WRONG[name]
    faults = check(model)
    assert any(message in str(fault) for fault in faults), [*map(str, faults)]
    assert all(
        fault.kind.split()[0] in {*KINDS.values(), "simulation"} for fault in faults if fault.kind
    )


def test_faults_of_several_elements_come_together():
    model = replace(
        body(mass=0.0), joints=(replace(AXLE, parent="X"),), loads=(replace(PUSH, body="Y"),)
    )
    assert [fault.kind for fault in check(model)] == ["body", "joint", "load"]


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_every_deck_gives_a_model_without_faults(path):
    assert check(read_deck(path)) == []


def changed(value, new):
    """Every value that differs from ``value`` in one number, word or record within it."""
    if is_dataclass(value):
        for field in fields(value):
            for each in changed(getattr(value, field.name), new):
                yield replace(value, **{field.name: each})
    elif isinstance(value, tuple):
        for i, entry in enumerate(value):
            for each in changed(entry, new):
                yield (*value[:i], each, *value[i + 1 :])
    elif type(new) is type(value):
        yield new


FULL = ("bushing", "cam_valve", "flyball_governor", "friction_hinge", "joint_motion_ramp", "screw")


@pytest.mark.sampled
@pytest.mark.parametrize("new", [math.nan, math.inf, 0.0, -1.0, 1e300, 1e-300, "", "nothing"])
@pytest.mark.parametrize("name", FULL)
def test_no_single_change_stops_the_check(name, new):
    (path,) = (path for path in DECKS if path.stem == name)
    model = read_deck(path)
    for k, wrong in enumerate(changed(replace(model, simulation=RUN), new)):
        if k % 17 == 0 or k < 60:
            found = check(wrong)
            assert found or not isinstance(new, float) or math.isfinite(new), wrong
    for wrong in changed(model.simulation, new):
        check(replace(MODEL, simulation=wrong))
