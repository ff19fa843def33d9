"""Tendons, actuators and forces of balls as elements of the deck; replicates; what is listed."""

import math

import numpy as np
import pytest

from msahl.expressions.text import text_of
from msahl.importers.mjcf_geoms import shell_of
from msahl.model import ConcentratedLoad, JointActuator
from tests.importers.faults import faults_of
from tests.importers.test_mjcf import BALL, body, hinge, imported, only_body  # noqa: F401


def lost(found):
    notes = {(n.where, n.message) for n in found.notes if n.kind == "not carried over"}
    return {note for note in notes if "contact with shapes" not in note[1]}


def fixed(name, *terms, more=""):
    joints = "".join(f'<joint joint="{joint}" coef="{c}"/>' for joint, c in terms)
    return f'<tendon><fixed name="{name}" {more}>{joints}</fixed></tendon>'


ARMS = body(hinge("a") + BALL + body(hinge("b") + BALL + body(hinge("c") + BALL)))


def test_a_tendon_loads_its_joints_by_its_coefficients(imported):  # noqa: F811
    tendon = fixed("T", ("a", 2), ("b", -3), more='damping="0.5" stiffness="4" springlength="0.1"')
    found = imported(ARMS, tendon).source.model()
    texts = {s.name: text_of(s.expression) for s in found.signals}
    assert texts == {
        "T length": "2.0 * a.angle + -3.0 * b.angle",
        "T rate": "2.0 * a.angleRate + -3.0 * b.angleRate",
        "T force": "-4.0 * ('T length' - 0.1) + -0.5 * 'T rate'",
    }
    loads = {load.joint: text_of(load.expression) for load in found.loads}
    assert loads == {"a": "2.0 * 'T force'", "b": "-3.0 * 'T force'"}


def test_an_equality_of_tendons_is_a_gear_if_two_joints_take_part(imported):  # noqa: F811
    """2 a - 3 b = 0.3: b = 2/3 a - 0.1."""
    equality = '<equality><tendon name="e" tendon1="T" polycoef="0.3 0 0 0 0"/></equality>'
    found = imported(ARMS, fixed("T", ("a", 2), ("b", -3)) + equality)
    (gear,) = found.source.model().couplings
    assert (gear.kind, gear.first, gear.second) == ("gear", "b", "a")
    assert gear.ratio == 1.5
    assert b"<angle>0.15</angle>" in found.source.data.replace(b' units="rad"', b"")
    three = imported(ARMS, fixed("T", ("a", 2), ("b", -3), ("c", 1)) + equality)
    expected = "msahl couples two coordinates in proportion only"
    assert ("tendon 'e'", expected) in lost(three)


def test_what_a_tendon_has_no_counterpart_for_is_listed(imported):  # noqa: F811
    more = 'range="-1 1" armature="0.1"'
    spatial = '<tendon><spatial name="S"><site site="s"/></spatial></tendon>'
    motors = '<actuator><motor name="m" tendon="S"/><muscle name="u" tendon="T"/></actuator>'
    found = imported(ARMS, fixed("T", ("a", 2), more=more) + spatial + motors)
    assert lost(found) == {
        ("fixed 'T'", "its range: msahl has no stop along a tendon"),
        ("fixed 'T'", "its armature"),
        ("spatial 'S'", "msahl has no such element"),
        ("motor 'm'", "its tendon is not carried over"),
        ("muscle 'u'", "msahl has no muscle actuator"),
    }


def test_controls_of_a_keyframe_are_counted_with_actuators_that_are_not_carried_over(
    imported,  # noqa: F811
):
    motors = (
        '<actuator><muscle joint="a"/><motor name="first" joint="a"/>'
        '<motor name="second" joint="b"/></actuator>'
    )
    key = '<keyframe><key name="k" ctrl="0.1 0.2 0.3"/></keyframe>'
    found = imported(ARMS, motors + key, key="k").source.model()
    controls = {s.name: text_of(s.expression) for s in found.signals}
    assert controls == {"first control": "0.2", "second control": "0.3"}


def test_a_filter_is_a_state_and_limits_of_states_are_listed(imported):  # noqa: F811
    actuators = (
        '<actuator><muscle joint="a"/><general name="g" joint="a" dyntype="filter" dynprm="0.1" '
        'ctrlrange="-1 1"/><intvelocity name="i" joint="b" actrange="-1 1"/>'
        '<general name="h" joint="c" dyntype="integrator" actrange="0 1"/></actuator>'
    )
    key = '<keyframe><key name="k" ctrl="0 0.7" act="0.1 0.2 0.3 0.4"/></keyframe>'
    found = imported(ARMS, actuators + key, key="k")
    limits = "an actuator whose activation has limits"
    assert lost(found) >= {("intvelocity 'i'", "msahl has no intvelocity actuator")}
    assert ("general 'h'", limits) in lost(found)
    control, state = found.source.model().signals
    assert text_of(control.expression) == "0.7"
    assert (state.name, state.initial) == ("g activation", 0.2)
    assert text_of(state.rate) == "(min(max('g control', -1.0), 1.0) - 'g activation') / 0.1"
    (load,) = found.source.model().loads
    assert text_of(load.expression) == "'g activation'"


def test_a_motor_at_a_ball_pushes_both_bodies(imported):  # noqa: F811
    ball = '<joint name="{}" type="ball"/>' + BALL
    world = body(ball.format("j") + body(ball.format("k"), 'name="b"'), 'name="a"')
    motors = '<actuator><motor name="m" joint="k" gear="1 2 3" ctrlrange="-1 1"/></actuator>'
    found = imported(world, motors).source.model()
    loads = [load for load in found.loads if isinstance(load, ConcentratedLoad)]
    assert [(load.body, load.moment, load.moment_basis) for load in loads] == [
        ("b", (1.0, 2.0, 3.0), "b"), ("a", (-1.0, -2.0, -3.0), "b"),
    ]  # fmt: skip
    assert {text_of(load.expression) for load in loads} == {"min(max('m control', -1.0), 1.0)"}


def test_armature_and_range_of_a_ball_are_listed(imported):  # noqa: F811
    more = 'type="ball" armature="0.1" range="0 40" frictionloss="0.2"'
    found = imported(body(hinge(more=more) + BALL))
    assert {message for _, message in lost(found)} == {
        "armature of a ball joint", "the range of a ball joint",
    }  # fmt: skip
    expressions = {text_of(load.expression) for load in found.source.model().loads}
    assert expressions == {f"-0.2 * tanh('j link.w{x}' / 0.01)" for x in "xyz"}


def test_kv_and_dampratio_contradict_each_other(imported):  # noqa: F811
    servo = '<actuator><position name="p" joint="a" kv="1" dampratio="1"/></actuator>'
    assert "position 'p': it gives kv and dampratio; give one" in faults_of(imported, ARMS, servo)


def test_a_damping_ratio_of_one_arm_is_that_of_its_oscillator(imported):  # noqa: F811
    """kv = 2 z sqrt(kp J) of a sphere at 0.5 m with the armature 0.3."""
    sphere = '<geom type="sphere" size="0.1" mass="2" pos="0.5 0 0"/>'
    servo = '<actuator><position joint="a" kp="7" dampratio="0.6"/></actuator>'
    found = imported(body(hinge("a", 'armature="0.3"') + sphere), servo).source.model()
    (load,) = [load for load in found.loads if isinstance(load, JointActuator)]
    kv = 2.0 * 0.6 * math.sqrt(7.0 * (2.0 * (0.4 * 0.01 + 0.25) + 0.3))
    words = text_of(load.expression).split()
    assert float(words[-3]) == pytest.approx(kv, rel=1e-14)  # round-off of a few products


def test_replicates_of_bodies_have_names_with_as_many_digits_as_their_number(
    imported,  # noqa: F811
):
    world = f'<replicate count="10" offset="0 1 0" sep="_">{body(hinge() + BALL)}</replicate>'
    named = world.replace("<body ", '<body name="b" ')
    model = imported(named, '<actuator><motor name="m" joint="j"/></actuator>').source.model()
    assert [one.name for one in model.bodies] == [f"b_{i:02d}" for i in range(10)]
    assert [one.position[1] for one in model.bodies] == pytest.approx(range(10))
    assert [load.name for load in model.loads] == [f"m_{i:02d}" for i in range(10)]


@pytest.mark.parametrize(
    ("count", "inside", "words"),
    [
        ("0", BALL, "expected how many copies there are"),
        ("x", BALL, "expected how many copies there are"),
        ("9" * 30, BALL, "with all copies the file has more than"),
        ("2", hinge(), "it cannot be copied alone"),
    ],
)
def test_faults_of_replicates(imported, count, inside, words):  # noqa: F811
    world = body(hinge("own") + f'<replicate count="{count}">{inside}</replicate>' + BALL)
    assert words in faults_of(imported, world)


def surface(kind, half):
    """Area and second moments of a surface: of thin slices across z by Gauss' formula."""
    z, w = np.polynomial.legendre.leggauss(400)
    c = half[-1] + (half[0] if kind == "capsule" else 0.0)
    z, w = c * z, c * w
    if kind == "sphere":
        r, slope = np.sqrt(c * c - z * z), z / np.sqrt(c * c - z * z)
    else:
        over = np.maximum(abs(z) - (half[1] if kind == "capsule" else c), 0.0)
        r = np.sqrt(half[0] ** 2 - over**2)
        slope = over / r
    band = 2.0 * math.pi * r * np.sqrt(1.0 + slope**2) * w
    area, x, zz = band.sum(), (band * r * r).sum() / 2.0, (band * z * z).sum()
    if kind == "cylinder":
        ends = 2.0 * math.pi * half[0] ** 2
        area, x, zz = area + ends, x + ends * half[0] ** 2 / 4.0, zz + ends * c * c
    return area, np.array([x, x, zz])


@pytest.mark.parametrize(
    ("kind", "half"), [("sphere", [0.2]), ("capsule", [0.1, 0.3]), ("cylinder", [0.1, 0.3])]
)
def test_shells_have_the_inertia_of_their_surfaces(kind, half):
    area, second = surface(kind, half)
    found = shell_of(kind, half)
    # Gauss' formula over the ends of the sphere and the kinks of the capsule.
    assert found.mass == pytest.approx(area, rel=1e-3)
    assert np.diag(found.J) == pytest.approx(second.sum() - second, rel=1e-3)


def test_a_shell_has_the_mass_of_its_surface(imported):  # noqa: F811
    geom = '<geom type="box" size="0.1 0.2 0.3" density="5" shellinertia="true"/>'
    found = only_body(imported(body(hinge() + geom)))
    assert found.mass == pytest.approx(5.0 * 8.0 * (0.02 + 0.06 + 0.03))
    given = only_body(imported(body(hinge() + geom.replace("density", 'mass="3" density'))))
    assert given.mass == 3.0
    assert given.inertia[0][0] == pytest.approx(3.0 / found.mass * found.inertia[0][0])
