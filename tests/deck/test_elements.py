"""Joints, couplings, motions and loads of a deck become the records they describe."""

import math
import re
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from msahl.algebra.functions import Law
from msahl.algebra.vector import IDENTITY, ZERO
from msahl.deck import read_deck
from msahl.deck.cam_profile import lift
from msahl.deck.diagnosis import add_faults
from msahl.deck.faults import Faults
from msahl.deck.parse import parse
from msahl.deck.schema import built, schema_bytes
from msahl.joints.registry import KINDS
from msahl.model import JointMotion, JointSpring, Model, PointMotion, SpringDamper
from msahl.model.couplings import COORDINATES, Coupling
from tests.support.models import drag, friction

ROOT = Path(__file__).parents[2]
DECKS = sorted((*ROOT.glob("decks/*/*.xml"), *ROOT.glob("msahl/deck/templates/*.xml")))
ROUND_OFF = 1e-15  # a few operations on numbers of order one

DECK = """<data>{units}<system><bodies><ground><name>G</name></ground>
<rigidBody><name>A</name><mass>2</mass><rGB><x>0.5</x></rGB>
<moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
<initialConditions><orientation><eulerRotation><phi units="deg">90</phi><u3>1</u3></eulerRotation>
</orientation></initialConditions></rigidBody>
<rigidBody><name>B</name><mass>3</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
<initialConditions><position basis="G"><x>1</x></position></initialConditions></rigidBody>
</bodies>{rest}</system>
<simulation><deltaT>0.1</deltaT><tFinal>1</tFinal>{more}</simulation></data>"""

HINGE = """<revolute><name>H</name><parent><name>G</name><axis><z>1</z></axis></parent>
<child><name>A</name></child></revolute>"""
RAIL = """<prismatic><name>R</name><parent><name>G</name><axis><x>2</x></axis></parent>
<child><name>B</name></child></prismatic>"""


@pytest.fixture
def read(tmp_path):
    def read_model(
        joints: str = HINGE + RAIL,
        motions: str = "",
        loads: str = "",
        more: str = "",
        units: str = "",
    ) -> Model:
        path = tmp_path / "deck.xml"
        groups = {"joints": joints, "motions": motions, "loads": loads}
        rest = "".join(f"<{tag}>{text}</{tag}>" for tag, text in groups.items() if text)
        path.write_text(DECK.format(rest=rest, more=more, units=units))
        return read_deck(path, thorough=True)

    return read_model


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_all_readers_of_the_schema_accept_every_deck(path):
    faults = Faults(str(path))
    root = parse(path.read_bytes(), faults)
    add_faults(root, built(schema_bytes()).elements["data"], faults)
    assert faults.sound(root)
    assert etree.XMLSchema(etree.fromstring(schema_bytes())).validate(root.getroottree())
    assert built(schema_bytes()).is_valid(root)


def test_every_element_has_a_deck():
    decks = [read_deck(path) for path in DECKS]
    assert {joint.kind for deck in decks for joint in deck.joints} == KINDS.keys()
    assert {c.kind for deck in decks for c in deck.couplings} == COORDINATES.keys()
    files = [*DECKS, *ROOT.glob("decks/*/parts/*.xml")]
    tags = {e.tag for path in files for e in etree.parse(path).iter(etree.Element)}
    declared = set(re.findall(r'<xs:element name="(\w+)"', schema_bytes().decode()))
    # What only a unit test shows: guesses, the other kinds of coefficient, joint tables, rows and
    # steps that are no deck's own affair.
    rare = {"a3", "angularDamping", "assembly", "c0", "c3", "c4", "c5", "freeSlide"}
    # Coordinates of joints at the start, which are read alike.
    rare |= {"angle1", "angle1Rate", "angle2", "angle2Rate", "slide", "slideRate", "slide1"}
    rare |= {"slide1Rate", "slide2", "slide2Rate", "P1", "P2", "P3"}
    # What ``write_deck`` writes, whose tests read it.
    rare |= {"beamOfBodies", "node", "lengths", "stations", "strain", "compliance", "dampingTimes"}
    rare |= {"outline", "axes", "frame", "lift", "nodes", "modes", "follower", "states"}
    rare |= {"squares"}
    rare |= {"offset", "phase", "xMoment", "outputInterval", "tolerance", "localTolerance"}
    assert declared - tags <= rare


def test_decks_are_moderate():
    for path in (*ROOT.glob("decks/joints/*.xml"), *ROOT.glob("decks/*s/*.xml")):
        if path.parent.name in ("joints", "forces", "mechanisms"):
            simulation = read_deck(path).simulation
            assert simulation.t_final <= 10.0
            assert simulation.t_final / simulation.dt <= 2000.5


def test_the_schema_has_every_kind_and_its_parameters():
    ns = {"xs": "http://www.w3.org/2001/XMLSchema"}
    schema = etree.fromstring(schema_bytes())

    def fields(kind: str) -> dict[str, str]:
        path = f"xs:complexType[@name='{kind}']/xs:all/xs:element"
        return {e.get("name"): e.get("type") for e in schema.iterfind(path, ns)}

    path = "xs:complexType[@name='joints']/xs:choice/xs:element"
    types = {e.get("name"): e.get("type") for e in schema.iterfind(path, ns)}
    assert types.keys() == KINDS.keys() | COORDINATES.keys()
    for name, kind in KINDS.items():
        given = fields(types[name])
        assert {key: given[key] for key, *_ in kind.parameters} == {
            key: quantity for key, quantity, *_ in kind.parameters
        }
        ends = {0: "pointEnd", 1: "axisEnd", 2: "axesEnd"}
        assert given["parent"] == given["child"] == ends[kind.axes]


def test_a_frame_along_a_coordinate_direction_is_exact(read):
    hinge, rail = read().joints
    assert hinge.parent_axes == IDENTITY
    # A is rotated by 90 degrees about z: carried into its axes, x is -y and y is x, exactly.
    assert hinge.child_axes == ((0.0, -1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert rail.parent_axes == rail.child_axes
    assert rail.parent_axes == ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))


@pytest.mark.parametrize("kind", ["revolute", "cylindrical", "planar", "prismatic"])
def test_an_axis_on_either_side_or_both_is_one(read, kind):
    axis = "<axis><x>1</x><y>2</y><z>3</z></axis>"  # of A: inertial (-2, 1, 3)
    same = "<axis><x>-2</x><y>1</y><z>3</z></axis>"
    form = (
        "<{0}><name>J</name><parent><name>G</name>{1}</parent>"
        "<child><name>A</name>{2}</child></{0}>"
    )
    joints = [
        read(form.format(kind, *sides)).joints[0]
        for sides in (("", axis), (same, ""), (same, axis))
    ]
    for joint in joints:
        assert joint.parent_axes[2] == pytest.approx(np.array((-2, 1, 3)) / math.sqrt(14))
        assert joint.child_axes[2] == pytest.approx(np.array((1, 2, 3)) / math.sqrt(14))
        assert np.array(joint.parent_axes) == pytest.approx(np.array(joints[0].parent_axes))
        axes = np.array(joint.parent_axes)
        assert axes @ axes.T == pytest.approx(np.eye(3), abs=ROUND_OFF)
        assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_reference_fixes_x(read):
    hinge = HINGE.replace("</axis>", "</axis><reference><x>1</x><y>1</y><z>7</z></reference>")
    x = read(hinge).joints[0].parent_axes[0]
    assert x == pytest.approx((math.sqrt(0.5), math.sqrt(0.5), 0.0))


def test_a_basis_rotates_an_axis(read):
    hinge = HINGE.replace("<axis><z>1</z>", '<axis basis="A"><x>1</x>')
    joint = read(hinge).joints[0]
    assert joint.parent_axes[2] == (0.0, 1.0, 0.0)
    assert joint.child_axes[2] == (1.0, 0.0, 0.0)


def test_parameters_have_units_and_defaults(read):
    ends = "<parent><name>G</name></parent><child><name>B</name></child>"
    (rod,) = read(
        f"<distance><name>D</name>{ends}<length units='cm'>100</length></distance>"
    ).joints
    assert rod.parameters == (("length", 1.0),)
    (free,) = read(f"<distance><name>D</name>{ends}</distance>").joints
    assert math.isnan(free.parameter("length"))


@pytest.mark.parametrize("sign", [1, -1])
def test_crossed_cylinders_face_each_other(read, sign):
    joint = f"""<crossedCylinders><name>C</name>
    <parent><name>G</name><position><x>0.5</x></position><axis><y>1</y></axis></parent><child><name>B</name><axis><z>{sign}</z></axis></child>
    <parentRadius>0.2</parentRadius><childRadius>0.3</childRadius></crossedCylinders>"""
    (crossed,) = read(joint).joints
    a, b = crossed.parent_axes[2], crossed.child_axes[2]
    assert np.dot((0.5, 0.0, 0.0), np.cross(a, b)) == pytest.approx(0.5)
    assert np.linalg.det(np.array(crossed.child_axes)) == pytest.approx(1.0)


def test_couplings(read):
    gear = "<gear><name>T</name><first>H</first><second>H2</second><ratio>-2</ratio></gear>"
    second = HINGE.replace("<name>H<", "<name>H2<").replace("<name>A<", "<name>B<")
    second = second.replace("<axis>", "<position><x>1</x></position><axis>")
    rack = (
        "<rackAndPinion><name>P</name><first>H</first><second>R</second>"
        "<radius units='mm'>50</radius></rackAndPinion>"
    )
    assert read(gear + HINGE + RAIL + rack + second).couplings == (
        Coupling("T", "gear", "H", "H2", -2.0),
        Coupling("P", "rackAndPinion", "H", "R", 0.05),
    )


def test_a_cams_lift_is_that_of_its_circle():
    e, R, r, start = 0.01, 0.04, 0.008, 0.3
    a = np.linspace(0.0, 2.0 * math.pi, 73)[:-1]
    points = np.stack([e + R * np.cos(a), R * np.sin(a)], axis=1)
    angles = start - np.linspace(0.0, 2.0 * math.pi, 50)
    roller = e * np.cos(angles) + np.sqrt((R + r) ** 2 - (e * np.sin(angles)) ** 2)
    # A spline of 72 chords leaves R (2 pi/72)^4/384 of the circle.
    assert lift(points, angles, r)[0] == pytest.approx(roller, abs=1e-8)
    assert lift(points, angles, None)[0] == pytest.approx(R + e * np.cos(angles), abs=1e-8)


def test_a_cam_starts_without_lift_and_closes():
    (cam,) = read_deck(ROOT / "decks/joints/cam_follower.xml").couplings
    assert cam.lift is not None
    half = len(cam.lift.numbers) // 2
    angles, rises = cam.lift.numbers[:half], cam.lift.numbers[half:]
    assert (cam.lift.kind, angles[0], rises[0], rises[-1]) == ("periodic", 0.0, 0.0, 0.0)
    assert angles[-1] == pytest.approx(2 * math.pi)
    assert all(b > a for a, b in pairwise(angles))
    assert min(rises) == pytest.approx(-0.02, abs=1e-7)  # the eccentric points at the follower


LAWS = {
    "constant": ("<constant units='deg'>180</constant>", Law("constant", (math.pi,))),
    "polynomial": (
        "<polynomial><c0>1</c0><c2>3</c2></polynomial>",
        Law("polynomial", (1.0, 0.0, 3.0)),
    ),
    "sine": (
        "<sine><amplitude>2</amplitude><frequency units='Hz'>1</frequency><offset>1</offset>"
        "<phase units='deg'>180</phase></sine>",
        Law("sine", (2.0, 2 * math.pi, math.pi, 1.0)),
    ),
    "ramp": (
        "<ramp><to units='deg'>180</to><end units='ms'>500</end></ramp>",
        Law("ramp", (0.0, math.pi, 0.0, 0.5)),
    ),
    "table": (
        "<table><entry><t>0</t><value>1</value></entry>"
        "<entry><value>3</value><t units='min'>1</t></entry></table>",
        Law("linear", (0.0, 60.0, 1.0, 3.0)),
    ),
    "periodic": (
        "<table interpolation=' periodic'>"
        + "".join(f"<entry><t>{t}</t><value>{v}</value></entry>" for t, v in enumerate("0150"))
        + "</table>",
        Law("periodic", (0.0, 1.0, 2.0, 3.0, 0.0, 1.0, 5.0, 0.0)),
    ),
}


@pytest.mark.parametrize("kind", LAWS)
def test_laws(read, kind):
    text, law = LAWS[kind]
    joint_motion = (
        "<jointMotion><name>M</name><joint>H</joint><coordinate>angle</coordinate>"
        f"<law>{text}</law></jointMotion>"
    )
    assert read(motions=joint_motion).motions == (JointMotion("M", "H", "angle", law),)


def test_a_slide_is_driven_in_lengths_and_a_point_along_a_direction(read):
    law = "<law><constant units='{}'>2</constant></law>"
    motions = (
        f"<jointMotion><name>M</name><joint>R</joint><coordinate>slide</coordinate>{law.format('mm')}</jointMotion>"
        "<pointMotion><name>P</name><body>A</body><position><x>1</x></position>"
        f"<direction basis='A'><x>3</x></direction>{law.format('ft')}</pointMotion>"
    )
    joint_motion, point = read(motions=motions).motions
    assert joint_motion == JointMotion("M", "R", "slide", Law("constant", (0.002,)))
    law = Law("constant", (0.6096,))
    assert point == PointMotion("P", "A", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), law)


def test_a_body_force_acts_at_the_mass_centre(read):
    load = (
        "<bodyForce><name>F</name><body>A</body><acceleration><a2>3</a2></acceleration>"
        "<law><constant>0.5</constant></law></bodyForce>"
    )
    (force,) = read(loads=load).loads
    assert (force.point, force.force, force.force_basis) == ((0.5, 0.0, 0.0), (0.0, 6.0, 0.0), "G")
    assert force.law == Law("constant", (0.5,))


@pytest.mark.parametrize(
    ("first", "last", "size", "place"),
    [
        ("6", None, 12.0, 1.0),
        ("0", "6", 6.0, 4 / 3),
        ("6", "0", 6.0, 2 / 3),
        ("-2", "6", 4.0, 5 / 3),
    ],
)
def test_a_distributed_load_has_its_exact_resultant(read, first, last, size, place):
    end = f"<endLoad>{last}</endLoad>" if last else ""
    load = (
        "<distributed><name>F</name><body>A</body><start><x>0</x></start><end><x>2</x></end>"
        f"<direction basis='A'><y>-4</y></direction><startLoad>{first}</startLoad>{end}"
        "</distributed>"
    )
    (force,) = read(loads=load).loads
    assert force.force == pytest.approx((0.0, -size, 0.0))
    assert force.force_basis == "A"
    assert force.point == pytest.approx((place, 0.0, 0.0))


ENDS = "<parent><name>G</name></parent><child><name>B</name></child>"


def test_springs(read):
    loads = f"""
    <springDamper><name>S</name>{ENDS}<stiffness units="N/mm">2</stiffness></springDamper>
    <springDamper><name>T</name>{ENDS}<table interpolation="cubic">
    <entry><length>0</length><force>-1</force></entry>
    <entry><length>1</length><force>0</force></entry>
    <entry><length units="mm">2000</length><force units="kN">1</force></entry>
    </table></springDamper>
    <torsionalSpringDamper><name>U</name><joint>H</joint><stiffness>2</stiffness>
    <damping>0.5</damping><freeAngle units="deg">90</freeAngle></torsionalSpringDamper>
    <slideSpringDamper><name>V</name><joint>R</joint><preload>3</preload></slideSpringDamper>"""
    s, t, u, v = read(loads=loads).loads
    assert s == SpringDamper("S", "G", "B", ZERO, ZERO, 2000.0, 0.0)
    assert t.table == Law("cubic", (0.0, 1.0, 2.0, -1.0, 0.0, 1000.0))
    assert u == JointSpring("U", "H", "angle", 2.0, 0.5, math.pi / 2)
    assert v == JointSpring("V", "R", "slide", 0.0, 0.0, 0.0, 3.0)


def test_a_bushing_has_its_parents_axes_unless_it_has_an_axis(read):
    text = """<bushing><name>M</name><parent><name>A</name><position><y>-1</y></position>{}</parent>
    <child><name>B</name></child><stiffness><x units="N/mm">1</x></stiffness>
    <angularDamping><z>2</z></angularDamping></bushing>"""
    (own,) = read(loads=text.format("")).loads
    assert own.parent_axes == IDENTITY
    assert own.child_axes == ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    assert own.stiffness == (1000.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert own.damping == (0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
    (given,) = read(loads=text.format("<axis basis='G'><x>1</x></axis>")).loads
    assert given.child_axes[2] == (1.0, 0.0, 0.0)
    assert given.parent_axes[2] == (0.0, -1.0, 0.0)


def test_drag_and_friction(read):
    loads = """<drag><name>D</name><body>B</body><coefficient>0.5</coefficient></drag>
    <friction><name>F</name><joint>H</joint><coordinate>angle</coordinate><coefficient>0.2</coefficient>
    <radius units="mm">20</radius><width units="rpm">60</width></friction>
    <friction><name>E</name><joint>R</joint><coordinate>slide</coordinate><coefficient>0.3</coefficient>
    <width units="mm/s">1</width></friction>"""
    assert read(loads=loads).loads == (
        drag("D", "B", ZERO, 0.5),
        friction("F", "H", "angle", 0.2, 0.02, 2 * math.pi),
        friction("E", "R", "slide", 0.3, 1.0, 0.001),
    )


def test_new_quantities_in_us_units(read):
    loads = f"<springDamper><name>S</name>{ENDS}<stiffness>1</stiffness></springDamper>"
    (spring,) = read(loads=loads, units="<unitSystem>US</unitSystem>").loads
    assert spring.stiffness == pytest.approx(14.593902937206364)  # lbf/ft, NIST SP 811


def test_assembly(read):
    assert (read().position, read().velocity) == ("check", "keepAngular")
    model = read(more="<assembly position='project' velocity='refuse'/>")
    assert (model.position, model.velocity) == ("project", "refuse")
    far = RAIL.replace("<name>B</name>", "<name>B</name><position><y>0.2</y></position>")
    assert read(far, more="<assembly position='project'/>").joints[0].child_point == (0.0, 0.2, 0.0)


def test_every_deck_in_the_guide_is_valid(tmp_path, read):
    texts = re.findall(r"```xml\n(.*?)```", (ROOT / "docs/deck.md").read_text(), re.DOTALL)
    complete, *parts = texts
    path = tmp_path / "deck.xml"
    path.write_text(complete)
    assert read_deck(path).bodies[0].velocity == (1.0, 0.0, 0.0)
    assert len(parts) > 5
    schema = etree.XMLSchema(etree.fromstring(schema_bytes()))
    for part in parts:
        if part.startswith("<part>"):
            assert schema.validate(etree.fromstring(part)), schema.error_log
            continue
        if part.startswith("<rigidBody>"):
            root = etree.fromstring(complete.replace("</bodies>", f"{part}</bodies>"))
            assert schema.validate(root), schema.error_log
            continue
        if part.startswith(("<parameters>", "<includes>")):
            root = etree.fromstring(complete.replace("<data>", f"<data>{part}"))
            assert schema.validate(root), schema.error_log
            continue
        groups = {"joints": "", "motions": "", "loads": "", "simulation": ""}
        beside = ""
        tree = etree.fromstring(f"<parts>{part}</parts>")
        for element in [*tree.xpath("*[not(self::loads)]"), *tree.xpath("loads/*")]:
            if element.tag in ("markers", "groups", "signals", "contacts", "events"):
                beside += etree.tostring(element).decode()
            else:
                groups[_group(str(element.tag))] += etree.tostring(element).decode()
        more = groups.pop("simulation")
        rest = "".join(f"<{tag}>{text}</{tag}>" for tag, text in groups.items())
        root = etree.fromstring(DECK.format(rest=rest + beside, more=more, units=""))
        assert schema.validate(root), (part, schema.error_log)


def _group(tag: str) -> str:
    if tag in KINDS.keys() | COORDINATES.keys():
        return "joints"
    return {"jointMotion": "motions", "pointMotion": "motions", "assembly": "simulation"}.get(
        tag, "loads"
    )
