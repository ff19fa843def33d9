"""Faults of joints, couplings, motions and loads are reported with line, element and remedy."""

from pathlib import Path

import pytest

from msahl.deck import DeckError, read_deck

DECK = """\
<data>
  <system>
    <bodies>
      <ground><name>G</name></ground>
      <rigidBody>
        <name>A</name>
        <mass>1</mass>
        <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
      </rigidBody>
      <rigidBody>
        <name>B</name>
        <mass>1</mass>
        <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
        <initialConditions><position><x>1</x></position></initialConditions>
      </rigidBody>
    </bodies>
    <joints>
<revolute><name>H</name><parent><name>G</name><axis><z>1</z></axis></parent>
  <child><name>A</name></child></revolute>
<prismatic><name>R</name><parent><name>G</name><axis><x>1</x></axis></parent>
  <child><name>B</name></child></prismatic>
{joints}    </joints>
    <motions>
{motions}    </motions>
    <loads>
{loads}    </loads>
  </system>
  <simulation><deltaT>0.01</deltaT><tFinal>1</tFinal></simulation>
</data>
"""
FIRST = {"joints": 22, "motions": 24, "loads": 26}
"""Line of the first element of each group, the others being empty."""


def joint(kind: str, parent: str = "", child: str = "", rest: str = "", ends: str = "GA") -> str:
    a, b = (f"<name>{name}</name>" for name in ends)
    return (
        f"<{kind}><name>J</name><parent>{a}{parent}</parent>\n"
        f"<child>{b}{child}</child>\n{rest}</{kind}>"
    )


def axis(text: str) -> str:
    x, y, z = text.split()
    return f"<axis><x>{x}</x><y>{y}</y><z>{z}</z></axis>"


def at(x: float) -> str:
    return f"<position><x>{x}</x></position>"


def tags(kind: str, **children: object) -> str:
    inner = "".join(f"<{tag}>{value}</{tag}>\n" for tag, value in children.items())
    return f"<{kind}>{inner}</{kind.split()[0]}>"


X, Y, Z = axis("1 0 0"), axis("0 1 0"), axis("0 0 1")
RADII = "<parentRadius>{}</parentRadius><childRadius>{}</childRadius>"
RADIUS = "<radius>0.5</radius>"

JOINTS = {
    "no axis": (
        joint("revolute"),
        ":22: joint 'J': <axis> is missing; add it to <parent> or <child>",
    ),
    "no axis of two": (
        joint("universal", X),
        ":23: joint 'J', child: <axis> is missing; add it to <child>",
    ),
    "zero axis": (
        joint("revolute", "", axis("0 0 0")),
        ":23: joint 'J', child/axis: the axis is zero; give a direction",
    ),
    "axis where none is": (
        joint("spherical", Z),
        ":22: joint 'J', parent/axis: unknown element <axis> in <parent>; expected one of <name>",
    ),
    "axes that differ": (
        joint("revolute", Z, axis("0 1e-3 1")),
        ":22: joint 'J': the axis is (0, 0, 1) on the parent but (0, 0.0009999995, 0.9999995) on "
        "the child (inertial axes, t = 0); give it on one side only, or rotate one",
    ),
    "axes that are opposite": (joint("revolute", Z, axis("0 0 -1")), "give it on one side only"),
    "reference along the axis": (
        joint("revolute", Z + "<reference><z>-2</z></reference>"),
        ":22: joint 'J': <reference> is parallel to the axis; give another direction",
    ),
    "two references": (
        joint(
            "pointSlider", Z + "<reference><x>1</x></reference>", "<reference><x>1</x></reference>"
        ),
        ":22: joint 'J': <reference> is given on both sides; keep one",
    ),
    "two references of a slider that are not parallel": (
        joint(
            "prismatic", Z + "<reference><x>1</x></reference>", "<reference><y>1</y></reference>"
        ),
        ":22: joint 'J': its references are at 90 deg at t = 0 and must be parallel",
    ),
    "universal with parallel axes": (
        joint("universal", X, X),
        ":22: joint 'J': its two axes are parallel; a universal needs two directions, rotate one",
    ),
    "universal askew": (
        joint("universal", X, axis("1 1 0")),
        ":22: joint 'J': its axes are at 45 deg at t = 0 and must be at 90 deg; rotate one",
    ),
    "edge not in its plane": (joint("edgeSlider", Z, axis("0 1 1")), "its axes are at 45 deg"),
    "crossed cylinders with parallel axes": (
        joint("crossedCylinders", X, X, RADII.format(1, 1)),
        "its two axes are parallel; a crossedCylinders needs two directions",
    ),
    "crossed cylinders apart": (
        joint("crossedCylinders", Y, Z, RADII.format(0.3, 0.2), "GB"),
        ":22: joint 'J': the surfaces are 0.5 m apart at t = 0 (less than zero: they "
        "overlap); move the child by (-0.5, 0, 0) m",
    ),
    "crossed cylinders in each other": (
        joint("crossedCylinders", Y, axis("0 0 -1"), RADII.format(1, 0.2), "GB"),
        "the surfaces are -0.2 m apart at t = 0 (less than zero: they overlap); move the "
        "child by (0.2, 0, 0) m",
    ),
    "radius zero": (
        joint("sphericalSlider", Z, rest="<radius>0</radius>"),
        ":24: joint 'J', radius: it is 0; it must be greater than 0",
    ),
    "radius missing": (
        joint("sphericalSlider", Z),
        ":22: joint 'J': <radius> is missing; add it to <sphericalSlider>",
    ),
    "radii cancel": (
        joint("parallelCylinders", Z, rest=RADII.format(1, -1), ends="GB"),
        ":22: joint 'J': parentRadius and childRadius make a distance of zero",
    ),
    "parallel cylinders apart": (
        joint("parallelCylinders", Z, rest=RADII.format(0.5, 0.2), ends="GB"),
        ":22: joint 'J': the constrained distance is 1 m at t = 0, but parentRadius and "
        "childRadius say 0.7 m; move the child",
    ),
    "rod too long": (
        joint("distance", rest="<length>1.5</length>", ends="GB"),
        ":22: joint 'J': the constrained distance is 1 m at t = 0, but length says 1.5 m",
    ),
    "rod of no length": (
        joint("distance"),
        ":22: joint 'J': the constrained distance is zero at t = 0; move one of the two points",
    ),
    "open hinge": (
        joint("revolute", Z, at(0.25)),
        ":22: joint 'J': its points are 0.25 m apart at t = 0: (0, 0, 0) m on parent 'G' but "
        "(0.25, 0, 0) m on child 'A' (inertial axes); move the child by (-0.25, 0, 0) m",
    ),
    "off the axis": (
        joint("cylindrical", Z, at(0.25)),
        ":22: joint 'J': the child's point is 0.25 m from where the parent's axis requires "
        "it at t = 0; move the child by (-0.25, 0, 0) m",
    ),
    "off the plane": (
        joint("planar", X, at(0.25)),
        "from where the parent's plane requires it at t = 0; move the child by (-0.25, 0",
    ),
    "above the plane": (
        joint("cylindricalSlider", X, Z, RADIUS, "GB"),
        ":22: joint 'J': the child's point is 0.5 m from where the parent's plane",
    ),
    "disk off the floor": (
        joint("rollingDisk", X, Z, RADIUS, "GB"),
        ":22: joint 'J': the surfaces are 0.5 m apart at t = 0",
    ),
    "disk lying flat": (joint("rollingDisk", X, X, RADIUS, "GB"), "its two axes are parallel"),
    "disk on a body": (
        joint("rollingDisk", X, Z, "<radius>1</radius>", "AB"),
        ":22: joint 'J': the parent of a rollingDisk is a ground; 'A' is a body",
    ),
    "edge on a body": (
        joint("knifeEdge", "", X, ends="AB"),
        "the parent of a knifeEdge is a ground",
    ),
}

LAW = tags("law", constant=1)


def gear(**changes: object) -> str:
    return tags("gear", **({"name": "T", "first": "H", "second": "H", "ratio": 2} | changes))


def cam(points: str, follower: str = "flat", more: str = "", first: str = "H") -> str:
    profile = "".join(
        "<point><x>{}</x><y>{}</y></point>".format(*point.split()) for point in points.split(",")
    )
    return (
        f"<camFollower><name>C</name><first>{first}</first><second>R</second>\n"
        f"<profile>{profile}</profile>\n<follower>{follower}</follower>{more}</camFollower>"
    )


SQUARE = "1 0,0 1,-1 0,0 -1"
BEAN = "1 0,0.8 0.6,0 0.3,-0.8 0.6,-1 0,-0.8 -0.6,0 -0.3,0.8 -0.6"
ROLLER = "<rollerRadius>{}</rollerRadius>"
SECOND = """<revolute><name>H2</name><parent><name>G</name><position><x>1</x></position>
<axis><z>1</z></axis></parent><child><name>B</name></child></revolute>
"""

COUPLINGS = {
    "zero gear ratio": (
        SECOND + gear(second="H2", ratio=0),
        ":27: joint 'T', ratio: the ratio is zero, which couples nothing; give another",
    ),
    "zero pinion": (
        tags("rackAndPinion", name="T", first="H", second="R", radius=0),
        ":25: joint 'T', radius: the radius is zero",
    ),
    "ratio that is no number": (
        SECOND + gear(second="H2", ratio="NaN"),
        ":27: joint 'T', ratio: 'NaN' is not a finite number",
    ),
    "gear of one joint": (gear(), ":22: joint 'T': first and second are both 'H'; couple two"),
    "gear of no joint": (
        gear(second="K"),
        ":24: joint 'T': second 'K' is not a joint of this model (joints: H, R)",
    ),
    "gear of a slide": (
        gear(second="R"),
        ":24: joint 'T': joint 'R', a prismatic, has no coordinate angle (it has: slide); "
        "name one of revolute, cylindrical, screw",
    ),
    "coupling with a joint's name": (
        SECOND + gear(name="H", second="H2"),
        ":24: joint 'H', name: the name is taken by line 18; choose another",
    ),
    "few points": (
        cam("1 0,0 1,-1 0"),
        ":23: joint 'C', profile: a profile needs 4 points or more",
    ),
    "points out of order": (
        cam("1 0,-1 0,0 1,0 -1"),
        ":23: joint 'C', profile: its points must go once round the cam's axis",
    ),
    "cam beside its axis": (
        cam("2 0,3 1,4 0,3 -1"),
        "its points must go once round the cam's axis",
    ),
    "roller without radius": (
        cam(SQUARE, "roller"),
        "<rollerRadius> is missing; a roller needs it",
    ),
    "flat with a roller": (cam(SQUARE, "flat", ROLLER.format(1)), "a flat follower has no roller"),
    "roller of no size": (cam(SQUARE, "roller", ROLLER.format(0)), "it is 0 m; it must be greater"),
    "points at one place but for round-off": (
        cam("1 0,0 1,-1e-20 1,-1 0,0 -1"),
        ":22: joint 'C': two neighbouring points of the profile are one; give each once",
    ),
    "hollow under a flat": (cam(BEAN), "a flat follower needs a convex profile"),
    "hollow under a roller": (
        cam(BEAN, "roller", ROLLER.format(2)),
        ":22: joint 'C': a roller of 2 m does not fit the hollow of radius",
    ),
    "unknown follower": (
        cam(SQUARE, "knife"),
        "unknown value 'knife'; expected one of flat, roller",
    ),
    "follower along the cam's axis": (
        SECOND.replace("<z>1</z>", "<x>1</x>") + cam(SQUARE, first="H2"),
        ":24: joint 'C': the axis of 'R' is at 0 deg to the axis of 'H2' and must be at 90",
    ),
    "roller past the axis": (
        SECOND.replace("<x>1</x>", "<x>1</x><y>0.5</y>").replace(
            "<name>B</name>", "<name>B</name><position><y>0.5</y></position>"
        )
        + cam(SQUARE, "roller", ROLLER.format(0.1), "H2"),
        ":24: joint 'C': the axis of 'R' passes the axis of 'H2' at a distance of 0.5 m",
    ),
}


def joint_motion(law: str, **changes: object) -> str:
    fields = {"name": "M", "joint": "H", "coordinate": "angle", "law": law} | changes
    return tags("jointMotion", **fields)


def table(pairs: str, interpolation: str = "linear") -> str:
    entries = "".join(
        "<entry><t>{}</t><value>{}</value></entry>\n".format(*pair.split())
        for pair in pairs.split(",")
    )
    return joint_motion(f'<table interpolation="{interpolation}">{entries}</table>')


SINE = "<sine><amplitude>1</amplitude><frequency>{}</frequency></sine>"
RAMP = "<ramp><to>1</to><start>{}</start><end>{}</end></ramp>"

MOTIONS = {
    "unknown joint": (
        joint_motion("<constant>1</constant>", joint="K"),
        ":25: motion 'M': joint 'K' is not a joint of this model (joints: H, R)",
    ),
    "no such coordinate": (
        joint_motion("<constant>1</constant>", coordinate="slide"),
        ":25: motion 'M': joint 'H', a revolute, has no coordinate slide (it has: angle)",
    ),
    "unknown coordinate": (
        joint_motion("<constant>1</constant>", coordinate="rotation"),
        ":26: motion 'M', coordinate: unknown value 'rotation'; expected one of angle, slide",
    ),
    "unit of the other coordinate": (
        joint_motion('<constant units="m">1</constant>'),
        ":27: motion 'M', law/constant: 'm' does not fit here; expected one of rad, deg",
    ),
    "no law": (
        joint_motion(""),
        ":27: motion 'M', law: <law> is empty; add one of <constant>, <polynomial>",
    ),
    "two laws": (
        joint_motion("<constant>1</constant><polynomial><c1>1</c1></polynomial>"),
        ":27: motion 'M', law/polynomial: <polynomial> is given beside <constant>; keep one",
    ),
    "polynomial of nothing": (
        joint_motion("<polynomial/>"),
        "it has no coefficient; add <c0> to <c5>",
    ),
    "sine without frequency": (
        joint_motion(SINE.format(0)),
        "law/sine/frequency: it is zero; give another frequency, or",
    ),
    "ramp backward": (
        joint_motion(RAMP.format(1, 1)),
        "it ends at 1 s, not after its start at 1 s",
    ),
    "short table": (
        table("0 1"),
        ":27: motion 'M', law/table: a linear table needs 2 entries or more",
    ),
    "short cubic": (table("0 1,1 2", "cubic"), "a cubic table needs 3 entries or more; it has 2"),
    "short periodic": (
        table("0 1,1 2,2 1", "periodic"),
        "a periodic table needs 4 entries or more",
    ),
    "table that does not increase": (
        table("0 1,2 2,2 3"),
        ":29: motion 'M', law/table/entry: <t> must increase; 2 follows 2 (SI)",
    ),
    "open period": (
        table("0 1,1 2,2 3,3 1.1", "periodic"),
        ":30: motion 'M', law/table/entry: a periodic table ends with the value it begins with; 1 "
        "and 1.1 differ",
    ),
    "unknown interpolation": (table("0 1,1 1", "smooth"), "unknown value interpolation='smooth'"),
    "the scheme's name": (
        joint_motion("<constant>1</constant>", name="scheme"),
        ":24: motion 'scheme', name: the name is that of the scheme's own column",
    ),
    "two motions of one coordinate": (
        joint_motion("<constant>1</constant>")
        + "\n"
        + joint_motion("<constant>2</constant>", name="N"),
        ":29: motion 'N': the angle of 'H' already has a prescribed motion (line 24); keep one",
    ),
    "a joint's name": (
        joint_motion("<constant>1</constant>", name="R"),
        ":24: motion 'R', name: the name is taken by line 20; choose another",
    ),
    "point of a ground": (
        tags("pointMotion", name="P", body="G", direction="<x>1</x>", law="<constant>1</constant>"),
        ":25: motion 'P': 'G' is a ground and never moves; name a rigid body",
    ),
    "point along nothing": (
        tags("pointMotion", name="P", body="A", direction="<x>0</x>", law="<constant>1</constant>"),
        ":26: motion 'P', direction: the direction is zero; give a direction",
    ),
}

ENDS = {"parent": "<name>G</name>", "child": "<name>B</name>"}
SHORT = {"parent": "<name>G</name>", "child": "<name>A</name>"}
FRICTION = {
    "name": "F",
    "joint": "H",
    "coordinate": "angle",
    "coefficient": 1,
    "radius": 1,
    "width": 1,
}
LINE = {"name": "D", "body": "A", "start": "<x>0</x>", "end": "<x>1</x>", "direction": "<z>1</z>"}
ENTRY = "<entry><length>{}</length><force>{}</force></entry>"

LOADS = {
    "factor with units": (
        tags(
            "concentrated",
            name="L",
            body="A",
            force="<xForce>1</xForce>",
            law='<constant units="m">1</constant>',
        ),
        ":29: load 'L', law/constant: it is a plain number here; delete units",
    ),
    "body force on a ground": (
        tags("bodyForce", name="L", body="G", acceleration="<a1>1</a1>"),
        ":27: load 'L': 'G' is a ground and never moves; name a rigid body",
    ),
    "segment of no length": (
        tags("distributed", **(LINE | {"end": "<x>0</x>"}), startLoad=1),
        ":26: load 'D': <start> and <end> are one point; give two, or a <concentrated>",
    ),
    "loads that cancel": (
        tags("distributed", **LINE, startLoad=1, endLoad=-1),
        ":26: load 'D': <startLoad> and <endLoad> cancel; give the <moment> of a <concentrated>",
    ),
    "load along nothing": (
        tags("distributed", **(LINE | {"direction": "<x>0</x>"}), startLoad=1),
        ":30: load 'D', direction: the direction is zero; give a direction",
    ),
    "spring of zero length": (
        tags("springDamper", name="S", **SHORT, stiffness=1),
        ":26: load 'S': its length is zero at t = 0, so it has no direction; move one of its",
    ),
    "spring of nothing": (
        tags("springDamper", name="S", **ENDS),
        ":26: load 'S': it has neither <stiffness>, <table>, <damping> nor <preload>; add one",
    ),
    "negative damping": (
        tags("springDamper", name="S", **ENDS, damping=-1),
        ":29: load 'S', damping: it is -1; it must not be less than zero",
    ),
    "spring to itself": (
        tags("springDamper", name="S", **(ENDS | {"parent": "<name>B</name>"}), stiffness=1),
        ":26: load 'S': parent and child are both 'B'; name two different bodies",
    ),
    "spring said twice": (
        tags(
            "springDamper",
            name="S",
            **ENDS,
            stiffness=1,
            table=ENTRY.format(0, 0) + ENTRY.format(1, 1),
        ),
        ":29: load 'S', stiffness: <table> gives it already; delete <stiffness> or the table",
    ),
    "compliance of a table": (
        tags(
            'springDamper form="compliance"',
            name="S",
            **ENDS,
            table=ENTRY.format(0, 0) + ENTRY.format(1, 1),
        ),
        ":29: load 'S', table: form=\"compliance\" is for a linear spring, and <table> is not one; "
        "give a <stiffness>, or delete form",
    ),
    "compliance of no stiffness": (
        tags('springDamper form="compliance"', name="S", **ENDS, damping=1),
        ":26: load 'S': form=\"compliance\" needs the inverse of the stiffness, which is 0; give "
        "one greater than zero, or delete form",
    ),
    "compliance of a bushing that only damps": (
        tags('bushing form="compliance"', name="S", **SHORT, damping="<x>1</x>"),
        ":26: load 'S': form=\"compliance\" needs the inverse of each stiffness that is not zero",
    ),
    "spring table that does not increase": (
        tags("springDamper", name="S", **ENDS, table=ENTRY.format(1, 0) + ENTRY.format(0, 1)),
        ":29: load 'S', table/entry: <length> must increase; 0 follows 1 (SI)",
    ),
    "torsion of a slide": (
        tags("torsionalSpringDamper", name="S", joint="R", stiffness=1),
        ":27: load 'S': joint 'R', a prismatic, has no coordinate angle",
    ),
    "slide spring of no joint": (
        tags("slideSpringDamper", name="S", joint="K", stiffness=1),
        ":27: load 'S': joint 'K' is not a joint of this model",
    ),
    "open bushing": (
        tags("bushing", name="S", **ENDS, stiffness="<x>1</x>"),
        ":26: load 'S': its points are 1 m apart at t = 0",
    ),
    "bushing of nothing": (
        tags("bushing", name="S", **SHORT),
        ":26: load 'S': it has neither stiffness nor damping; add one",
    ),
    "bushing that joint motions": (
        tags("bushing", name="S", **SHORT, angularDamping="<x>-1</x>"),
        ":26: load 'S': a damping is less than zero; a damper only removes energy",
    ),
    "bushing with half a frame": (
        tags(
            "bushing",
            name="S",
            stiffness="<x>1</x>",
            child="<name>A</name>",
            parent="<name>G</name><reference><x>1</x></reference>",
        ),
        ":26: load 'S': <reference> has no effect without <axis>; add an <axis>",
    ),
    "negative drag": (
        tags("drag", name="D", body="A", coefficient=-1),
        ":28: load 'D', coefficient: it is -1; it must not be less than zero",
    ),
    "friction without width": (
        tags("friction", **(FRICTION | {"width": 0})),
        ":31: load 'F', width: it is 0; it must be greater than zero",
    ),
    "friction of a negative size": (
        tags("friction", **(FRICTION | {"coefficient": -1})),
        ":29: load 'F', coefficient: it is -1; it must not be less than zero",
    ),
    "width of the other coordinate": (
        tags("friction", **FRICTION).replace("<width>", '<width units="m/s">'),
        ":31: load 'F', width: 'm/s' does not fit here; expected one of rad/sec",
    ),
    "friction without radius": (
        tags("friction", **FRICTION).replace("<radius>1</radius>", ""),
        ":26: load 'F': <radius> is missing; add it",
    ),
    "friction with a needless radius": (
        tags("friction", **(FRICTION | {"joint": "R", "coordinate": "slide"})),
        ":30: load 'F', radius: friction along a slide has no radius; delete it",
    ),
    "friction of no joint": (
        tags("friction", **(FRICTION | {"joint": "K"})),
        ":27: load 'F': joint 'K' is not a joint of this model",
    ),
}


def faults_of(path: Path) -> list[str]:
    with pytest.raises(DeckError) as caught:
        read_deck(path)
    return [str(fault).removeprefix(f"{path}") for fault in caught.value.faults]


def written(tmp_path: Path, **groups: str) -> Path:
    path = tmp_path / "deck.xml"
    texts = {group: groups.get(group, "") for group in FIRST}
    path.write_text(DECK.format(**{g: f"{t}\n" if t else "" for g, t in texts.items()}))
    return path


def test_the_deck_itself_is_good(tmp_path):
    assert len(read_deck(written(tmp_path)).joints) == 2


CASES = {
    f"{group}, {name}": (group, *case)
    for group, cases in (
        ("joints", JOINTS),
        ("joints", COUPLINGS),
        ("motions", MOTIONS),
        ("loads", LOADS),
    )
    for name, case in cases.items()
}


@pytest.mark.parametrize("case", CASES)
def test_a_fault_is_reported_once_where_it_is(tmp_path, case):
    group, text, expected = CASES[case]
    (found,) = faults_of(written(tmp_path, **{group: text}))
    assert expected in found


def test_friction_is_known_in_three_kinds_only(tmp_path):
    screw = joint("screw", Z, rest="<pitch>1</pitch>")
    load = tags("friction", **(FRICTION | {"joint": "J"}))
    (found,) = faults_of(written(tmp_path, joints=screw, loads=load))
    assert "load 'F': friction in a screw is not modelled; name one of revolute, prismatic" in found


def test_a_cam_and_its_follower_have_one_parent(tmp_path):
    joints = (
        joint("revolute", Z + at(1), ends="BA")
        .replace(">J<", ">K<")
        .replace("<name>A</name>", f"<name>A</name>{at(2)}")
    )
    (found,) = faults_of(written(tmp_path, joints=joints + cam(SQUARE, first="K")))
    assert "'K' and 'R' must have one parent" in found


def test_what_no_motion_mends_is_a_fault_even_when_joints_are_closed(tmp_path):
    path = written(tmp_path, joints=joint("universal", X, X) + joint("spherical", at(3)))
    project = "<tFinal>1</tFinal><assembly position='project'/>"
    path.write_text(
        path.read_text()
        .replace("<tFinal>1</tFinal>", project)
        .replace("<spherical><name>J<", "<spherical><name>far<")
    )
    (found,) = faults_of(path)
    assert "its two axes are parallel" in found


def test_a_joint_with_a_fault_is_still_known_by_name(tmp_path):
    bad = joint("revolute", axis("0 0 0"))
    motion = joint_motion("<constant>1</constant>", joint="J")
    found = faults_of(written(tmp_path, joints=bad, motions=motion))
    assert len(found) == 1
    assert "the axis is zero" in found[0]


@pytest.mark.parametrize(
    ("attribute", "expected"),
    [("position='close'", "expected one of check, project"),
     ("velocity='keep'", "expected one of keepAngular, massWeighted, asGiven, refuse")],
)  # fmt: skip
def test_assembly_has_few_words(tmp_path, attribute, expected):
    path = written(tmp_path)
    assembly = f"<tFinal>1</tFinal><assembly {attribute}/>"
    path.write_text(path.read_text().replace("<tFinal>1</tFinal>", assembly))
    (found,) = faults_of(path)
    assert "simulation/assembly: unknown value" in found
    assert expected in found
