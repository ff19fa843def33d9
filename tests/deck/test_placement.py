"""Coordinates of joints at t = 0: the shipped decks' states from them, loops, contradictions."""

import math
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from msahl.algebra.rotation import matrix
from msahl.algebra.rotation_arrays import angles
from msahl.deck import read_deck
from msahl.deck.faults import DeckError
from msahl.joints import coordinates
from msahl.joints.coordinates import Motion
from msahl.joints.registry import KINDS
from msahl.model import JointMotion
from tests.support.effective import effective_deck

ROOT = Path(__file__).parents[2] / "decks"
SHIPPED = sorted([*ROOT.glob("mechanisms/*.xml"), *ROOT.glob("joints/*.xml")])
SHIPPED.remove(ROOT / "mechanisms" / "four_bar_sketched.xml")  # its bodies are approximate
SHIPPED.remove(ROOT / "mechanisms" / "suspension.xml")  # its joints hang on a body that is free
SHIPPED.remove(ROOT / "mechanisms" / "bicycle.xml")  # likewise
SHIPPED.remove(ROOT / "mechanisms" / "rotor.xml")  # it has no joints
SPEEDS = {"cam_valve": 2e-5, "four_bar": 1e-9}
"""Accepted differences of velocities [m/s, rad/s]: the cam is given at rest, but its motor begins
with 1.3e-5 rad/s; the four-bar's velocities violate its joints by 1e-11 m/s, which its singular
values enlarge."""


def motion_of(model, name):
    for body in model.bodies:
        if body.name == name:
            R = np.array(matrix(body.orientation))
            v, w = R @ body.velocity, R @ body.angular_velocity
            return Motion(np.array([body.position]), R[None], v[None], w[None])
    return coordinates.at_rest(1)


def measured(model):
    """Values and rates of every joint by the names of their columns."""
    found = {}
    for joint in model.joints:
        motions = motion_of(model, joint.parent), motion_of(model, joint.child)
        relative = coordinates.relative(joint, *motions)
        levels = coordinates.values_and_rates(joint, relative)
        found[joint.name] = [
            dict(zip(coordinates.columns(joint, level), levels[level][0].tolist(), strict=True))
            for level in (0, 1)
        ]
    return found


def with_joint_coordinates(path, approximate=()):
    """The deck's tree: coordinates of all joints, those named only ``approximate`` and without
    rates, in place of the places and velocities of the bodies they carry."""
    model, tree = read_deck(path), etree.fromstring(effective_deck(path)).getroottree()
    driven = {motion.joint for motion in model.motions if isinstance(motion, JointMotion)}
    carried = {
        body
        for joint in model.joints
        if KINDS[joint.kind].pose is not None
        for body in (joint.parent, joint.child)
    }
    for element in tree.iterfind("system/bodies/rigidBody"):
        for start in element.findall("initialConditions"):
            if element.findtext("name").strip() in carried:
                element.remove(start)
    for joint in model.joints:
        if not coordinates.coordinates(joint):
            continue
        element = next(
            e for e in tree.iterfind("system/joints/*") if e.findtext("name").strip() == joint.name
        )
        for start in element.findall("initialConditions"):
            element.remove(start)
        add_axes(element, joint)
        start = etree.SubElement(element, "initialConditions")
        without_rates = joint.name in approximate or joint.name in driven
        add_start(start, measured(model)[joint.name], joint.name in approximate, without_rates)
    return model, tree


def add_axes(element, joint):
    """Give axis and reference on both sides: a deck that has the axis once carries it to a child
    that stands somewhere."""
    if joint.parent_reference is None:
        return
    sides = (
        ("parent", joint.parent_axes[2], joint.parent_reference),
        ("child", joint.child_axes[2], joint.child_reference),
    )
    for side, axis, reference in sides:
        end = element.find(side)
        for tag, vector in (("axis", axis), ("reference", reference)):
            for given in end.findall(tag):
                end.remove(given)
            place = etree.SubElement(end, tag)
            for letter, component in zip("xyz", vector, strict=True):
                etree.SubElement(place, letter).text = repr(component)


def add_start(start, levels, approximate, without_rates):
    values, rates = levels
    place = start
    for name, value in values.items():
        if name == "P1":
            place = etree.SubElement(start, "orientation")
        child = etree.SubElement(place if name.startswith("P") else start, name)
        # An approximate value is off by far more than round-off.
        child.text = repr(value * 1.03 + 0.02 if approximate else value)
        if approximate:
            (place if name.startswith("P") else child).set("approximate", "true")
    place = start
    for name, rate in () if without_rates else rates.items():
        if name == "wx":
            place = etree.SubElement(start, "angularVelocity")
        tag = {"wx": "omega1", "wy": "omega2", "wz": "omega3"}.get(name, name)
        child = etree.SubElement(place if tag != name else start, tag)
        child.text = repr(rate)


def read(tree, folder):
    path = folder / "deck.xml"
    tree.write(path)
    return read_deck(path)


def assert_same_start(model, other, places, speeds):
    for body, found in zip(model.bodies, other.bodies, strict=True):
        assert found.position == pytest.approx(body.position, abs=places), body.name
        apart = angles(np.array(found.orientation), np.array(body.orientation))
        assert apart == pytest.approx(0.0, abs=places), body.name
        assert found.velocity == pytest.approx(body.velocity, abs=speeds), body.name
        assert found.angular_velocity == pytest.approx(body.angular_velocity, abs=speeds)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_joint_coordinates_reproduce_the_shipped_initial_states(path, tmp_path):
    model, tree = with_joint_coordinates(path)
    assert_same_start(model, read(tree, tmp_path), 1e-12, SPEEDS.get(path.stem, 1e-12))


LOOPS = {
    "four_bar": ("Crank pin", "Rocker pin", "Rocker pivot"),
    "spatial_slider_crank": ("Ball", "Cross", "Guide"),
    "andrews_squeezer": ("Pin", "B", "A5", "A7", "G"),
}
"""Joints of closed loops whose coordinates follow from the others."""


@pytest.mark.parametrize("name", LOOPS)
def test_loops_are_closed_with_given_coordinates_kept(name, tmp_path):
    """The other coordinates are given 3 percent and 0.02 wrong, and without rates."""
    model, tree = with_joint_coordinates(ROOT / "mechanisms" / f"{name}.xml", LOOPS[name])
    # The loops' equations amplify the round-off of the given coordinates.
    assert_same_start(model, read(tree, tmp_path), 1e-11, max(1e-10, SPEEDS.get(name, 0.0)))


def pendulum(ground="", body="", joint="", tail="", start=""):
    """A deck of one hinge about y at the top of a rod."""
    return f"""<data><unitSystem>SI</unitSystem><system><gravity><g3>-9.81</g3></gravity>
    <bodies><ground><name>G</name></ground>{ground}
    <rigidBody><name>Bob</name><mass>2</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
    {body}</rigidBody></bodies>
    <joints><revolute><name>H</name><parent><name>G</name><axis><y>1</y></axis></parent>
    <child><name>Bob</name><position><z>0.5</z></position></child>
    <initialConditions>{joint}</initialConditions></revolute>{tail}</joints></system>
    <simulation><title>t</title><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation></data>"""


def model_of(text, folder):
    path = folder / "deck.xml"
    path.write_text(text)
    return read_deck(path)


def test_a_pendulum_is_written_with_its_angle_alone(tmp_path):
    text = pendulum(joint='<angle units="deg">30</angle><angleRate units="rpm">6</angleRate>')
    (bob,) = model_of(text, tmp_path).bodies
    sine, cosine = math.sin(math.pi / 6), math.cos(math.pi / 6)
    assert bob.position == pytest.approx((-0.5 * sine, 0.0, -0.5 * cosine), abs=1e-16)
    assert bob.orientation == pytest.approx((0.0, 4.0 * math.tan(math.pi / 24), 0.0), abs=1e-15)
    assert bob.angular_velocity == pytest.approx((0.0, 0.2 * math.pi, 0.0), abs=1e-15)
    assert bob.velocity == pytest.approx((-0.1 * math.pi, 0.0, 0.0), abs=1e-15)
    assert bob.position[1] == bob.orientation[0] == 0.0  # exactly in the plane


def test_a_deck_without_coordinates_of_joints_places_nothing(tmp_path):
    with pytest.raises(DeckError, match=r"its points are 0\.5 m apart"):
        model_of(pendulum(), tmp_path)


TIGHT = math.dist((3.0, 0.0), (-0.5 * math.sin(0.3), -0.5 * math.cos(0.3)))
"""Distance [m] of the point (3, 0, 0) from the rod's middle at 0.3 rad."""
FAULTS = {
    "both bodies have places": (
        pendulum(
            joint="<angle>0</angle>",
            body="<initialConditions><position><z>-0.5</z></position></initialConditions>",
        ),
        ":5: joint 'H': 'G' and 'Bob' both have places of their own, from which",
    ),
    "a coordinate that the joint has not": (
        pendulum(joint="<slide>1</slide>"),
        ":7: joint 'H', initialConditions/slide: a revolute has no coordinate slide (it has: angle)"
        "; delete <slide>",
    ),
    "a rate of another joint": (
        pendulum(joint="<angle>1</angle><angularVelocity><omega1>1</omega1></angularVelocity>"),
        "a revolute has no coordinate orientation",
    ),
    "a loop that cannot be closed": (
        pendulum(
            joint="<angle>0.3</angle>",
            tail="<distance><name>D</name><parent><name>G</name><position><x>3</x></position>"
            "</parent><child><name>Bob</name></child><length>1</length></distance>",
        ),
        "joint 'D': it cannot be closed: a constraint violation of",
    ),
    "a loop through a body without place": (
        pendulum(
            joint="<angle>0.3</angle>",
            ground="<rigidBody><name>Stone</name><mass>1</mass>"
            "<moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi></rigidBody>",
            tail="<distance><name>D</name><parent><name>Bob</name></parent>"
            "<child><name>Stone</name></child><length>1</length></distance>"
            "<pointSlider><name>S</name><parent><name>G</name><position><z>9</z></position>"
            "<axis><z>1</z></axis></parent><child><name>Stone</name></child></pointSlider>",
        ),
        "; neither a place of 'Stone' nor a coordinate of its joints is given",
    ),
    "rates that contradict each other": (
        pendulum(
            joint="<angle>0.3</angle><angleRate>1</angleRate>",
            tail="<distance><name>D</name><parent><name>G</name><position><x>3</x></position>"
            f"</parent><child><name>Bob</name></child><length>{TIGHT!r}</length></distance>",
        ),
        "the given rates and velocities contradict it",
    ),
    "an axis in the axes of a body that is placed": (
        pendulum(joint="<angle>0</angle>").replace("<axis>", '<axis basis="Bob">'),
        "its basis is 'Bob', but where 'G' and 'Bob' are follows from joints; give the components",
    ),
    "an orientation given twice": (
        pendulum(
            tail="<spherical><name>S</name><parent><name>G</name></parent><child><name>Bob</name>"
            "</child><initialConditions><orientation><eulerRotation><phi>1</phi><u1>1</u1>"
            "</eulerRotation><P1>1</P1></orientation></initialConditions></spherical>"
        ),
        "give either <eulerRotation> or the parameters <P1>, <P2>, <P3>",
    ),
    "approximate that is neither true nor false": (
        pendulum(joint='<angle approximate="perhaps">0</angle>'),
        "approximate='perhaps'",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
def test_contradictions_are_faults(name, tmp_path):
    text, message = FAULTS[name]
    with pytest.raises(DeckError) as caught:
        model_of(text, tmp_path)
    assert message in str(caught.value)
    assert len(caught.value.faults) == 1, str(caught.value)


def test_the_decks_by_angle_start_as_their_headers_say():
    rod = read_deck(ROOT / "basics" / "pendulum_by_angle.xml")
    assert rod.bodies[0].position == pytest.approx((-0.25, 0.0, -0.4330127), abs=1e-7)
    assert measured(rod)["Hinge"] == [
        {"angle": pytest.approx(math.pi / 6, abs=1e-15)},
        {"angleRate": pytest.approx(2.0, abs=1e-15)},
    ]
    model = read_deck(ROOT / "mechanisms" / "four_bar_by_angle.xml")
    values = {name: math.degrees(of[0]["angle"]) for name, of in measured(model).items()}
    assert values["Crank pivot"] == pytest.approx(-60.0, abs=1e-12)
    assert values["Rocker pivot"] == pytest.approx(-98.8510439, abs=1e-7)
    assert values["Crank pin"] == pytest.approx(23.8693433, abs=1e-7)
    assert_same_start(read_deck(ROOT / "mechanisms" / "four_bar.xml"), model, 1e-12, 1e-9)


def test_a_coordinate_at_the_start_may_be_an_expression(tmp_path):
    """Its type extends that of an angle, and so that of a number in braces."""
    text = pendulum(joint='<angle units="deg">{40 - 10}</angle>')
    assert measured(model_of(text, tmp_path))["H"][0] == {
        "angle": pytest.approx(math.pi / 6, abs=1e-15)
    }


def test_numbers_too_large_to_place_a_body_are_faults(tmp_path):
    """Products of three such numbers overflow."""
    text = pendulum(joint="<angle>1</angle>").replace("<z>0.5</z>", "<z>9e99</z>")
    tail = (
        "<distance><name>D</name><parent><name>G</name><position><x>9e99</x></position></parent>"
        "<child><name>Bob</name></child><length>1e-99</length></distance>"
    )
    with pytest.raises(DeckError, match="joint 'D'"):
        model_of(text.replace("</revolute>", "</revolute>" + tail), tmp_path)
