"""SDF: the same machines as by other formats, frames, joints of all types, loops, and what is
listed."""

import json
import re

import numpy as np
import pytest

import msahl
from msahl.importers import ImportOptions, import_file
from msahl.joints.placement import place_of
from tests.importers import oracle
from tests.importers.faults import faults_of
from tests.importers.joint_space import mass_centre, mass_matrix
from tests.importers.sdf_of_urdf import sdf_of
from tests.support.models import ROOT

ARM = ROOT / "examples" / "arm.urdf"
FOUR_BAR = ROOT / "examples" / "four_bar.sdf"
ROD = """<inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass>
<inertia><ixx>0.1</ixx><iyy>0.2</iyy><izz>0.25</izz><ixy>0.01</ixy></inertia></inertial>"""
SECONDS = {"scheme": "gauss5", "dt": 5e-3, "t_final": 0.5, "error": "off"}
CLOSE = {"rel": 1e-9, "abs": 1e-11}
"""Of motions by the same scheme in other coordinates: round-off that half a second amplifies."""


def link(name, pose="", inside=ROD):
    place = f"<pose>{pose}</pose>" if pose and not pose.startswith("<") else pose
    return f'<link name="{name}">{place}{inside}</link>'


def joint(name, kind, parent, child, inside=""):
    ends = f"<parent>{parent}</parent><child>{child}</child>"
    return f'<joint name="{name}" type="{kind}">{ends}{inside}</joint>'


def axis(xyz, inside="", tag="axis"):
    return f"<{tag}><xyz>{xyz}</xyz>{inside}</{tag}>"


@pytest.fixture
def imported(tmp_path):
    """Import a model of these elements."""

    def of(*elements, version="1.9", holder='model name="M"', **options):
        path = tmp_path / "model.sdf"
        tag = holder.partition(" ")[0]
        inside = chr(10).join(elements)
        path.write_text(f'<sdf version="{version}"><{holder}>{inside}</{tag}></sdf>')
        return import_file(path, ImportOptions(**options))

    return of


def lost(found):
    return [note.message for note in found.notes if note.kind == "not carried over"]


def run(found, **options):
    return msahl.load(found.source.data).run(**{**SECONDS, **options})


def places(result, body):
    return np.array([result[f"{body}.{c}"][-1] for c in ("x", "y", "z")])


@pytest.fixture(params=[False, True], ids=["relative", "absolute"])
def arm(request, tmp_path):
    path = tmp_path / "arm.sdf"
    path.write_text(sdf_of(ARM.read_bytes(), request.param))
    return path


def test_a_robot_is_the_same_as_by_urdf(arm):
    start = {"pose": {"elbow": 0.4, "shoulder": -0.3}, "rates": {"elbow": 2.0, "left": 0.01}}
    pair = [import_file(path, ImportOptions(**start)) for path in (ARM, arm)]
    first, second = (one.source.model() for one in pair)
    for kind in ("bodies", "joints", "couplings", "loads", "contacts", "shapes", "markers"):
        names = [[getattr(one, "name", "") for one in getattr(m, kind)] for m in (first, second)]
        assert names[0] == names[1], kind
    for a, b in zip(first.bodies, second.bodies, strict=True):
        assert b.mass == a.mass
        # Round-off of products of a few rotations.
        for name in ("r_BG", "inertia", "position", "velocity"):
            assert np.array(getattr(b, name)) == pytest.approx(
                np.array(getattr(a, name)), rel=1e-13, abs=1e-14
            )
        R_a, R_b = (place_of(one.position, one.orientation).R for one in (a, b))
        assert R_b == pytest.approx(R_a, abs=1e-14)
    for a, b in zip(first.contacts, second.contacts, strict=True):
        assert (b.lower, b.upper) == (a.lower, a.upper)
    motions = [run(one, t_final=0.2) for one in pair]
    names = [f"{joint.name}.{'slide' if joint.kind == 'prismatic' else 'angle'}"
             for joint in first.joints]  # fmt: skip
    for name in names:
        assert motions[1][name] == pytest.approx(motions[0][name], **CLOSE)


def test_an_arm_moves_as_in_mujoco(arm):
    text = re.sub(r"<mimic.*?</mimic>", "", arm.read_text(), flags=re.S)
    arm.write_text(text)
    numbers = json.loads(oracle.EXPECTED.read_text())[ARM.name]
    model, names = import_file(arm).source.model(), numbers["names"]
    kinds = {joint.name: "slide" if joint.kind == "prismatic" else "angle"
             for joint in model.joints}  # fmt: skip
    for q, centre, M in zip(numbers["poses"], numbers["centres"], numbers["matrices"], strict=True):
        values = {n: {kinds[n]: x} for n, x in zip(names, q, strict=True)}
        assert mass_centre(model, values)[1] == pytest.approx(centre, abs=1e-12)
        assert np.abs(mass_matrix(model, values, names) - M).max() < 1e-12 * np.abs(M).max()
    start = ImportOptions(
        pose=dict(zip(names, numbers["q"], strict=True)),
        rates=dict(zip(names, numbers["v"], strict=True)),
        contacts="none",
    )
    result = run(import_file(arm, start))
    found = [result[f"{name}.{kinds[name]}"][-1] for name in names]
    assert found == pytest.approx(numbers["fall"][oracle.TIMES.index(0.5)], abs=1e-9)


def test_a_four_bar_linkage_moves_as_its_deck(tmp_path):
    found = import_file(FOUR_BAR)
    model = found.source.model()
    assert [joint.kind for joint in model.joints] == ["revolute"] * 4
    assert found.notes == ()
    text = (ROOT / "decks" / "mechanisms" / "four_bar_by_angle.xml").read_text()
    text = re.sub(r"<motions>.*?</motions>", "", text, flags=re.S).replace(
        '<angle units="deg">-60</angle>',
        '<angle units="deg">-60</angle><angleRate units="rad/sec">0</angleRate>',
    )
    options = {"scheme": "gauss5", "dt": 5e-3, "t_final": 0.5, "error": "off"}
    expected = msahl.load(text.encode()).run(**options)
    result = run(found)
    for body in ("Crank", "Coupler", "Rocker"):
        assert places(result, body) == pytest.approx(places(expected, body), **CLOSE)
    assert abs(places(result, "Crank")[0] - 0.075) > 0.04  # it has moved


def pendulum(*elements):
    """A link on a hinge about y, 1 m beside the world's origin, with its end at x = 1.5."""
    return (
        link("a", "1 0 0 0 0 0"),
        joint("j", "revolute", "world", "a", axis("0 1 0")),
        *elements,
    )


@pytest.mark.parametrize(
    ("version", "inside"),
    [
        ("1.4", axis("0 1 0")),  # in the model's axes
        ("1.5", axis("0 0 1")),  # in the joint's, which are those of the child
        ("1.5", axis("0 1 0", "<use_parent_model_frame>true</use_parent_model_frame>")),
        ("1.7", '<axis><xyz expressed_in="__model__">0 1 0</xyz></axis>'),
        ("1.7", '<axis><xyz expressed_in="f">1 0 0</xyz></axis>'),
        ("1.7", '<pose relative_to="f">0 0 0 0 0 0</pose>' + axis("1 0 0")),
        ("1.9", '<pose relative_to="f" degrees="true">0 0 0 0 0 -90</pose>' + axis("0 1 0")),
    ],
)
def test_axes_are_in_the_frames_of_their_version(imported, version, inside):
    # z of the link is y of the model: -90 degrees about x. x of the frame f is y of the model.
    rolled = "1 0 0 -1.5707963267948966 0 0"
    frame = "<frame name='f'><pose>1 0 0 0 0 1.5707963267948966</pose></frame>"
    model = imported(
        link("a", rolled), frame if version >= "1.7" else "",
        joint("j", "revolute", "world", "a", inside), version=version,
    ).source.model()  # fmt: skip
    (one,) = model.joints
    assert one.parent_axes[2] == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
    assert one.parent_point == pytest.approx((1.0, 0.0, 0.0))
    assert one.child_axes[2] == pytest.approx((0.0, 0.0, 1.0), abs=1e-15)


def test_frames_nest_and_move_with_their_links(imported):
    inner = (
        '<model name="inner" placement_frame="tip"><pose relative_to="a">1 0 0 0 0 0</pose>'
        + link("b", "0 0 2 0 0 0")
        + "<frame name='tip' attached_to='b'><pose>0 0 1 0 0 0</pose></frame></model>"
    )
    found = imported(
        *pendulum(), inner, joint("k", "revolute", "a", "inner::tip", axis("1 0 0")),
        "<frame name='end' attached_to='inner::b'><pose relative_to='inner::tip'>0 1 0 0 0 0</pose>"
        "</frame>",
    )  # fmt: skip
    model = found.source.model()
    assert [body.name for body in model.bodies] == ["a", "inner::b"]
    # a is at x = 1, and the tip 1 m beside it, 1 m above b.
    at = {body.name: place_of(body.position, body.orientation) for body in model.bodies}
    assert at["a"].x == pytest.approx((1.0, 0.0, 0.0))
    assert at["inner::b"].x == pytest.approx((2.0, 0.0, -1.0))
    (hinge,) = (joint for joint in model.joints if joint.name == "k")
    assert hinge.child_point == pytest.approx((0.0, 0.0, 1.0))
    (end,) = (marker for marker in model.markers if marker.name == "end")
    assert (end.body, end.point) == ("inner::b", pytest.approx((0.0, 1.0, 1.0)))


def test_a_joint_from_the_child_has_the_same_coordinate(imported):
    limit = "<limit><lower>-1</lower><upper>2</upper></limit>"
    spring = ("<dynamics><damping>0.3</damping><spring_stiffness>5</spring_stiffness>"
              "<spring_reference>0.5</spring_reference></dynamics>")  # fmt: skip
    second = link("b", "1.5 0 0 0 0 0")
    results = []
    for ends, sign in ((("a", "b"), 1.0), (("b", "a"), -1.0)):
        # In the reversed joint, the angle of a relative to b is minus that of b relative to a.
        text = joint("k", "revolute", *ends,
                     f"<pose relative_to='b'/>{axis(f'0 {sign} 0', limit + spring)}")  # fmt: skip
        results.append(run(imported(*pendulum(second, text), pose={"k": 0.2})))
    assert results[1]["k.angle"] == pytest.approx(results[0]["k.angle"], **CLOSE)
    assert places(results[1], "b") == pytest.approx(places(results[0], "b"), **CLOSE)


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
@pytest.mark.parametrize("dynamics", ["", "<dynamics><damping>0.2</damping></dynamics>"])
def test_two_axes_move_as_two_hinges_of_mjcf(imported, tmp_path, kind, dynamics):
    axes = axis("1 0 0", dynamics) + axis("0 1 0", "", "axis2")
    found = imported(link("a", "0 0 1 0 0 0"), joint("j", kind, "world", "a", axes))
    model = found.source.model()
    assert [j.kind for j in model.joints] == (
        ["revolute", "revolute"] if dynamics else ["universal"]
    )
    path = tmp_path / "same.xml"
    damping = ' damping="0.2"' if dynamics else ""
    path.write_text(
        f'<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="j" axis="1 0 0"{damping}/>'
        '<joint name="k" axis="0 1 0"/><inertial pos="0.1 0 0" mass="2" '
        'fullinertia="0.1 0.2 0.25 0.01 0 0"/></body></worldbody></mujoco>'
    )
    expected = run(import_file(path))
    # Small bodies between hinges change the motion by 1e-9.
    assert places(run(found), "a") == pytest.approx(places(expected, "a"), abs=1e-8)
    assert np.linalg.norm(places(expected, "a") - (0.1, 0.0, 1.0)) > 0.05


@pytest.mark.parametrize(
    ("given", "pitch"),
    [
        ("<screw_thread_pitch>0.2</screw_thread_pitch>", 0.2),
        ("<thread_pitch>-31.41592653589793</thread_pitch>", 0.2),
        ("", 1.0),
    ],
)
def test_a_screw_falls_as_its_thread_lets_it(imported, given, pitch):
    body = re.sub("0.1 0 0 0 0 0", "0 0 0 0 0 0", ROD).replace("<ixy>0.01</ixy>", "")
    text = joint("j", "screw", "world", "a", axis("0 0 1") + given)
    result = run(imported(link("a", "0 0 1 0 0 0", body), text))
    lead = pitch / (2 * np.pi)
    # m z" = -m g - F and J w' = F lead with z' = lead w
    fall = -9.81 / (1.0 + 0.25 / (2.0 * lead**2))
    assert places(result, "a")[2] == pytest.approx(1.0 + 0.5 * fall * 0.25, rel=1e-10)


def test_balls_floating_and_static_models(imported):
    world = 'world name="W"'
    static = '<model name="floor"><static>1</static>' + link("slab") + "</model>"
    free = '<model name="ball"><pose>0 0 5 0 0 0</pose>' + link("ball") + "</model>"
    hung = ('<model name="hung">' + link("a", "0 0 1 0 0 0")
            + joint("j", "ball", "world", "a") + "</model>")  # fmt: skip
    found = imported("<gravity>0 0 -2</gravity>", static, free, hung, holder=world)
    model = found.source.model()
    assert model.gravity == (0.0, 0.0, -2.0)
    assert {body.name for body in model.bodies} == {"ball::ball", "hung::a"}
    assert [j.kind for j in model.joints] == ["spherical"]
    result = run(found)
    assert places(result, "ball::ball")[2] == pytest.approx(5.0 - 0.5 * 2.0 * 0.25, rel=1e-12)
    found = imported(free, holder=world)
    assert found.source.model().gravity == (0.0, 0.0, -9.8)  # that of the format


def test_a_link_without_inertial_has_that_of_the_format(imported):
    (body,) = imported(link("a", "", "")).source.model().bodies
    assert body.mass == 1.0
    assert np.array(body.inertia) == pytest.approx(np.eye(3))


def test_mimic_and_gearbox_are_gears(imported):
    mimic = '<mimic joint="j"><multiplier>-2</multiplier><offset>0.3</offset>' \
            "<reference>0.1</reference></mimic>"  # fmt: skip
    second = (link("b", "0 1 0 0 0 0"), joint("k", "revolute", "world", "b", axis("0 1 0", mimic)))
    result = run(imported(*pendulum(*second), pose={"j": 0.2}))
    # -2 (0.2 - 0.1) + 0.3
    assert result["k.angle"][0] == pytest.approx(0.1)
    assert result["k.angle"] == pytest.approx(-2 * (result["j.angle"] - 0.1) + 0.3, abs=1e-11)
    box = ("<gearbox_ratio>3</gearbox_ratio><gearbox_reference_body>world</gearbox_reference_body>"
           + axis("0 1 0") + axis("0 -1 0", "", "axis2"))  # fmt: skip
    third = (link("b", "0 1 0 0 0 0"), joint("k", "revolute", "world", "b", axis("0 1 0")),
             joint("g", "gearbox", "a", "b", box))  # fmt: skip
    result = run(imported(*pendulum(*third)))
    # theta_2 = -3 theta_1, and theta_2 is the negative angle of k.
    assert result["k.angle"] == pytest.approx(3 * result["j.angle"], abs=1e-11)
    assert abs(result["j.angle"][-1]) > 0.05
    # A hinge whose parent is the link has the negative angle; no axes: z of the joint's frame, that
    # of the child, which is y of the model here.
    box = box.replace(axis("0 1 0") + axis("0 -1 0", "", "axis2"), "")
    rolled = (link("b", "0 1 0 -1.5707963267948966 0 0"),
              joint("k", "revolute", "b", "world", "<pose relative_to='b'/>" + axis("0 0 1")),
              joint("g", "gearbox", "a", "b", box))  # fmt: skip
    result = run(imported(*pendulum(*rolled)))
    assert result["k.angle"] == pytest.approx(3 * result["j.angle"], abs=1e-11)


@pytest.mark.parametrize(
    ("kind", "inside"),
    [
        ("revolute", axis("0 1 0", "<dynamics><damping>0.5</damping></dynamics>")),
        ("ball", ""),
        ("universal", axis("0 1 0") + axis("1 0 0", "", "axis2")),
        ("prismatic", axis("1 0 0")),
    ],
)
def test_loops_are_closed_by_joints_of_several_types(imported, kind, inside):
    # A parallelogram: a and b hang on the world, c connects them.
    found = imported(
        link("a", "0 0 0 0 0.5 0"), link("b", "1 0 0 0 0.5 0"), link("c", "0.5 0 -0.5 0 0 0"),
        joint("ja", "revolute", "world", "a", axis("0 1 0")),
        joint("jb", "revolute", "world", "b", axis("0 1 0")),
        joint("jc", "revolute", "a", "c", '<pose relative_to="__model__">0.2 0 -0.4 0 0 0</pose>'
              '<axis><xyz expressed_in="__model__">0 1 0</xyz></axis>'),
        joint("jd", kind, "b", "c",
              f'<pose relative_to="__model__">1.2 0 -0.4 0 0 0</pose>{inside}'),
    )  # fmt: skip
    result = run(found, t_final=0.3)
    model = found.source.model()
    assert len(model.joints) == 4
    if kind != "prismatic":
        angles = result["ja.angle"]
        assert result["jb.angle"] == pytest.approx(angles, abs=1e-10)  # a parallelogram stays one
        assert abs(angles[-1] - angles[0]) > 0.02


def test_files_that_are_included(tmp_path):
    part = tmp_path / "parts" / "rod"
    part.mkdir(parents=True)
    (part / "model.sdf").write_text(
        f'<sdf version="1.6"><model name="rod"><pose>9 9 9 0 0 0</pose>{link("a")}</model></sdf>'
    )
    path = tmp_path / "world.sdf"

    def of(uri, more=""):
        include = f"<include><uri>{uri}</uri><name>r</name><pose>1 0 0 0 0 0</pose>{more}</include>"
        hinge = joint("j", "revolute", "world", "r::a", axis("0 1 0"))
        path.write_text(f'<sdf version="1.9"><model name="M">{include}{hinge}</model></sdf>')
        return import_file(path)

    for uri in ("parts/rod", "model://parts/rod", "parts/rod/model.sdf"):
        model = of(uri).source.model()
        assert [body.name for body in model.bodies] == ["r::a"]
        assert model.joints[0].parent_point == (1.0, 0.0, 0.0)
    outside = tmp_path.parent / "outside.sdf"
    outside.write_text((part / "model.sdf").read_text())
    for uri in ("../outside.sdf", str(outside), "https://fuel.example/rod", "nothing", ""):
        assert "is no file, nor a folder with model.sdf" in faults_of(of, uri)
    (part / "model.sdf").write_text(
        '<sdf version="1.6"><model name="x"><include><uri>parts/rod</uri></include></model></sdf>'
    )
    assert "includes itself" in faults_of(of, "parts/rod")
    (part / "model.sdf").write_text('<!DOCTYPE a [<!ENTITY b "c">]><sdf version="1.6"/>')
    assert "document type declaration" in faults_of(of, "parts/rod")


@pytest.mark.parametrize(
    ("elements", "message"),
    [
        ((joint("j", "hinge", "world", "a"),), "type 'hinge' is none of revolute"),
        ((joint("j", "ball", "world", "x"),), "'x' is no link or frame here"),
        ((joint("j", "ball", "a", "a"),), "its parent and its child are one link"),
        (('<joint name="j" type="ball"><child>a</child></joint>',), "it has no <parent>"),
        ((joint("j", "revolute", "world", "a", axis("0 0 0")),), "its xyz is zero"),
        ((joint("j", "revolute", "world", "a", axis("0 1")),), "expected 3 finite numbers"),
        ((joint("j", "screw", "world", "a", "<screw_thread_pitch>0</screw_thread_pitch>"),),
         "its pitch is zero"),
        ((link("a"),), "the name is taken"),
        ((link("world"),), "has no name of its own"),
        (("<frame name='f'><pose relative_to='g'/></frame><frame name='g'><pose relative_to='f'/>"
          "</frame>",), "is relative to itself"),
        (("<frame name='f'><pose relative_to='nobody'/></frame>",), "'nobody' is no frame"),
        ((link("b", "1 2 3"),), "expected 6 numbers"),
        ((link("b", '<pose rotation_format="quat_xyzw">0 0 0 0 0 0 0</pose>'),), "quaternion is"),
        ((link("b", "", '<inertial auto="true"/>'),), "inertia of its shapes is not computed"),
        ((link("b", "", "<inertial><mass>-1</mass></inertial>"),), "must not be negative"),
        ((joint("j", "revolute", "world", "a",
                axis("0 1 0", '<mimic joint="z"><multiplier>1</multiplier></mimic>')),),
         "joint 'z' is no other joint"),
    ],
)  # fmt: skip
def test_faults_name_the_element(imported, elements, message):
    text = faults_of(imported, link("a"), *elements)
    assert message in text
    assert "model.sdf:" in text


def test_a_version_that_is_none(imported):
    assert "its version is 'new'" in faults_of(imported, link("a"), version="new")


def test_deep_chains_of_frames_are_a_message(imported):
    frames = [f"<frame name='f{k}'><pose relative_to='f{k + 1}'/></frame>" for k in range(3000)]
    text = faults_of(imported, link("a", '<pose relative_to="f0"/>'), *frames)
    assert "too deeply" in text


def test_what_has_no_counterpart_is_listed(imported):
    sensor = "<sensor name='s' type='imu'/><gravity>false</gravity>"
    shape = (
        "<collision name='c'><geometry><sphere><radius>1</radius></sphere></geometry></collision>"
    )
    limit = "<limit><lower>-1</lower><effort>3</effort><velocity>-1</velocity></limit>"
    text = "\n".join(
        lost(
            imported(
                link("a", "", ROD + sensor + shape), "<plugin name='p' filename='x.so'/>",
                joint("j", "revolute", "world", "a", axis("0 1 0", limit)),
                joint("k", "fixed", "world", "a"),
                '<model name="still"><static>true</static>' + link("s")
                + joint("x", "fixed", "world", "s") + "</model>",
                link("b"), joint("l", "revolute", "a", "b", axis("0 1 0", limit)),
            )
        )
    )  # fmt: skip
    for words in (
        "msahl has no such element", "gravity acts on all links", "shapes are not made contacts",
        "its effort: nothing bounds", "a limit on one side", "its model is static",
    ):  # fmt: skip
        assert words in text, words


def test_the_deck_of_a_loop_is_written_and_read_back(tmp_path):
    found = import_file(FOUR_BAR)
    path = tmp_path / "four_bar.xml"
    path.write_bytes(found.source.data)
    again = msahl.load(path).run(**SECONDS)
    assert places(again, "Rocker") == pytest.approx(places(run(found), "Rocker"), **CLOSE)
