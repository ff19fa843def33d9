"""Decks that are written from models are read back to the same models."""

import math
import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from msahl.algebra.functions import Law
from msahl.algebra.surfaces import Surface
from msahl.check import check
from msahl.deck import DeckError, Source
from msahl.deck.write_model import write_deck
from msahl.expressions.syntax import FUNCTIONS, Call, Lookup, Name, Number, parse
from msahl.expressions.text import text_of
from msahl.model import (
    ConcentratedLoad,
    Group,
    JointMotion,
    JointSpring,
    Limits,
    Marker,
    MarkerAngle,
    MarkerDistance,
    PointLoad,
    PointMotion,
    Shape,
    Signal,
    SignalState,
    SignalTable,
    Simulation,
    SpringDamper,
    Stop,
)
from tests.support.element_samples import ELEMENTS
from tests.support.models import DECKS, ELASTIC, free_bodies, friction, pendulum

PATH = Path("written.xml")


def read(text):
    """The model of a text that both libraries find valid."""
    return Source(PATH, text).model((), thorough=True)


def assert_read_back(model):
    """Records are compared one by one first, for a short message."""
    again = read(write_deck(model))
    for field in fields(model):
        one, other = getattr(model, field.name), getattr(again, field.name)
        if isinstance(one, tuple):
            assert len(one) == len(other), field.name
            for a, b in zip(one, other, strict=True):
                assert a == b
    assert again == model


@pytest.mark.parametrize("path", [*DECKS, *ELASTIC], ids=lambda path: path.stem)
def test_every_deck_is_read_back(path):
    """With parts, parameters, coordinates of joints, profiles, beams, other units."""
    assert_read_back(Source.of_file(path).model(()))


def without_effect(load):
    """A table replaces the numbers of a spring, which a deck does not give beside it."""
    if isinstance(load, SpringDamper) and load.table:
        return replace(load, stiffness=0.0, free_length=None, preload=0.0)
    if isinstance(load, JointSpring) and load.table:
        return replace(load, stiffness=0.0, free=0.0, preload=0.0)
    return load


UNLIKE = ("concentrated, expression", "actuator, markers")
"""Samples that add lengths and velocities, which decks do not."""
SAMPLES = {name: make for name, make in ELEMENTS.items() if name not in UNLIKE}


@pytest.mark.parametrize("make", SAMPLES.values(), ids=SAMPLES)
def test_every_element_anywhere_is_read_back(make):
    """In random places, with random frames, which have no short form."""
    model = make(np.random.default_rng(5))
    model = replace(model, loads=tuple(map(without_effect, model.loads)))
    assert not check(model)
    assert_read_back(model)


numbers = st.one_of(
    st.just(0.0),
    st.floats(1e-90, 1e90),
    st.floats(-1e90, -1e-90),
    st.floats(-10.0, 10.0).filter(lambda x: abs(x) > 1e-90),
)
positive = numbers.map(abs).filter(bool)
vectors = st.tuples(numbers, numbers, numbers)


@given(vectors, vectors, vectors, vectors, positive, numbers, positive, numbers)
def test_numbers_are_read_back_to_the_last_digit(r, P, v, w, mass, c, k, preload):
    model = pendulum()
    P = tuple(max(-2.0, min(2.0, x)) for x in P)
    body = replace(model.bodies[0], mass=mass, r_BG=r, position=r, orientation=P, velocity=v)
    body = replace(body, angular_velocity=w)
    loads = (
        ConcentratedLoad("F", "Bob", r, v, "Bob", w, "Earth", Law("sine", (c, k, c, preload))),
        SpringDamper("S", "Earth", "Bob", v, w, c, k, k, preload),
        PointLoad("D", "drag", "Bob", w, (("coefficient", k),)),
    )
    marker = Marker("M", "Bob", v, basis="Bob")
    simulation = replace(model.simulation, dt=k, t_final=10.0 * k)
    model = replace(model, gravity=v, bodies=(body,), joints=(), loads=loads, markers=(marker,))
    model = replace(model, simulation=simulation)
    assume(not check(model))  # such as a spring without length
    assert_read_back(model)


leaves = st.one_of(
    st.floats(allow_nan=False, allow_infinity=False).map(Number),
    st.sampled_from(("t", "x", "Crank pin.angle", "pi", "sin", "and")).map(Name),
)


def branches(inner):
    binary = [*"+-*/^", "<", "<=", ">", ">=", "==", "!=", "and", "or"]
    return st.one_of(
        st.builds(lambda f, a, b: Call(f, (a, b)), st.sampled_from(binary), inner, inner),
        st.builds(lambda f, a: Call(f, (a,)), st.sampled_from(("negate", "not", "sin")), inner),
        st.builds(lambda f, a, b: Call(f, (a, b)), st.sampled_from(("min", "mod")), inner, inner),
        st.builds(lambda a: Call("where", (a, a, a)), inner),
        st.builds(lambda f, a: Lookup(f, (a,)), st.sampled_from(("gas", "sin", "a b")), inner),
    )


@given(st.recursive(leaves, branches, max_leaves=12))
def test_expressions_are_read_back(tree):
    assert parse(text_of(tree)) == tree


def test_the_text_of_an_expression_is_as_one_would_write_it():
    given = "-a^2*(b - 3)/-c - -2.5 + min(x, 1, y) > 0 and not (p < 1 or q)"
    shown = "-a^2.0 * (b - 3.0) / -c - -2.5 + min(min(x, 1.0), y) > 0.0 and not (p < 1.0 or q)"
    assert text_of(parse(given)) == shown
    assert "where" in FUNCTIONS


def test_every_setting_is_read_back():
    simulation = Simulation(
        *("All of it", 0.01, 2.0, "radau", 0.25, "exponential", "instantaneous"),
        *(Limits(1e-3, 1e-4, 1e-7), 2, 0.005, None, 1e-5, "yes", "no", "equilibrium"),
    )
    others = {"unit_system": "US", "position": "project", "velocity": "massWeighted"}
    model = replace(pendulum(), simulation=simulation, **others)
    assert_read_back(model)


def test_what_decks_seldom_have_is_read_back():
    """No ground, bodies anywhere, all shapes, sensors, tables, a stop that names a parameter."""
    model = free_bodies(np.random.default_rng(3), 2)
    c, s = math.cos(0.3), math.sin(0.3)
    tilted = ((c, s, 0.0), (-s, c, 0.0), (0.0, 0.0, 1.0))
    shapes = (
        Shape("B0", "box", (0.1, 0.2, 0.3), (0.0, 0.0, 1.0), tilted, "#00ff7a"),
        Shape("B0", "mesh", (0.001,), file="arm.stl"),
        Shape("B1", "mesh", (0.37,), file="meshes/arm.obj"),
        Shape("B1", "cone", (0.1, 0.2), axes=((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))),
    )
    signals = (
        Signal("load", parse("-2*B.x - 3^-t"), "m"),
        SignalState("state", parse("gas(load)"), -1.5),
        SignalTable("gas", Law("cubic", (0.0, 1.0, 2.5, 0.1, 0.3, 0.2))),
        SignalTable("map", Surface("linear", (0.0, 1.0), (0.0, 2.0), ((1.0, 2.0), (3.0, 0.1)))),
    )
    margin = parse("both(B.x - 0.25, 3 - t)".replace("both", "min"))
    stop = Stop("B.x > limit and t < 3", Call("both", margin.arguments))
    motion = PointMotion("P", "B0", (0.1, 0.0, 0.0), (0.6, 0.0, 0.8), Law("ramp", (0, 1, 0, 1)))
    polynomial = Law("polynomial", (0.0, 0.0, 1.5, 0.0))
    model = replace(
        model,
        grounds=(),
        motions=(motion, replace(motion, name="Q", body="B1", law=polynomial)),
        markers=tuple(Marker(n, "B0", (0.0, 0.1 * k, 0.0), tilted) for k, n in enumerate("ABC")),
        sensors=(MarkerDistance("AB", "A", "B"), MarkerAngle("ABC", "A", "B", "C")),
        groups=(Group("all"), Group("one", ("B1",))),
        shapes=shapes,
        signals=signals,
        stops=(stop,),
    )
    assert_read_back(model)


def hinged():
    """Upright, held by a joint with an angle and a slide."""
    model = pendulum(0.0)
    return replace(model, joints=(replace(model.joints[0], name="J", kind="cylindrical"),))


def test_joints_with_friction_and_springs_are_read_back():
    model = hinged()
    loads = (
        friction("F", "J", "angle", 0.3, 0.02, 1e-3),
        friction("G", "J", "slide", 0.1, 1.0, 1e-4),
        JointSpring("S", "J", "slide", 3.0, 0.1, 0.2, compliance=True),
        JointSpring("T", "J", "angle", 0.0, 0.1, table=Law("linear", (-1.0, 1.0, -2.0, 3.0))),
    )
    motion = JointMotion("M", "J", "angle", Law("constant", (0.0,)))
    assert_read_back(replace(model, loads=loads, motions=(motion,)))


def test_a_short_form_is_taken_where_it_says_the_same():
    model = hinged()
    x = (1.0, 0.0, 0.0)
    joint = replace(model.joints[0], parent_reference=x, child_reference=x)
    text = write_deck(replace(model, joints=(joint,))).decode()
    assert "<axis>" in text
    assert "<frame>" not in text
    tilted = ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))
    joint = replace(model.joints[0], parent_axes=tilted, child_axes=tilted)
    text = write_deck(replace(model, joints=(joint,))).decode()
    assert text.count("<frame>") == 2
    assert "<axis>" not in text


def test_the_order_of_a_deck_and_its_note():
    text = write_deck(pendulum(), "By hand").decode()
    tags = ["<!-- By hand -->", "<data>", "<unitSystem>", "<gravity>", "<bodies>", "<joints>"]
    places = [text.index(tag) for tag in (*tags, "<simulation>")]
    assert places == sorted(places)


def test_what_no_deck_can_say_is_refused():
    stop = Stop("t > 1", parse("t - 1"))
    with pytest.raises(ValueError, match="one condition"):
        write_deck(replace(pendulum(), stops=(stop, stop)))
    law = Law("polynomial", (1.0,) * 7)
    load = ConcentratedLoad("F", "Bob", (0,) * 3, (0,) * 3, "Bob", (0,) * 3, "Bob", law)
    with pytest.raises(ValueError, match="polynomial of 7 numbers"):
        write_deck(replace(pendulum(), loads=(load,)))


def tilted():
    """A model whose joint has frames in full."""
    model = hinged()
    axes = ((0.8, 0.0, -0.6), (0.0, 1.0, 0.0), (0.6, 0.0, 0.8))
    joint = replace(model.joints[0], parent_axes=axes, child_axes=axes)
    return replace(model, joints=(joint,), markers=(Marker("M", "Bob", (0.0,) * 3, axes),))


def beam():
    (path,) = (path for path in ELASTIC if path.stem == "cantilever")
    return Source.of_file(path).model(())


@pytest.mark.parametrize(
    ("model", "old", "new", "message"),
    [
        (tilted, r"<frame>[^<]*</frame>(?=\s*</parent>)", "", "is given on the child only"),
        (tilted, r"<frame>", "<axis><z>1</z></axis><frame>", "<axis> is given beside <frame>"),
        (tilted, r"<frame>\s*\S+", "<frame>", "it has 8 numbers; give nine"),
        (tilted, r"<axes>\s*\S+", "<axes>2.0", "three right-handed unit vectors"),
        (
            tilted,
            r"</axes>",
            "</axes><eulerRotation><phi>1</phi><u1>1</u1></eulerRotation>",
            "give ei",
        ),
        (beam, r"<strain>\s*\S+", "<strain>", "it does not have 6 numbers"),
        (beam, r"<node>[^<]*</node>", "<node>Nowhere</node>", "node 'Nowhere' is not a body"),
        (beam, r"<lengths>\s*\S+", "<lengths>-1.0", "an element has no length"),
    ],
)
def test_faults_of_forms_in_full(model, old, new, message):
    text, count = re.subn(old, new, write_deck(model()).decode(), count=1)
    assert count == 1
    with pytest.raises(DeckError, match=re.escape(message)):
        read(text.encode())
