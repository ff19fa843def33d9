"""Parts: names with their prefix, parameters handed in, bounds, files that are not accepted."""

import os

import pytest

from msahl.deck import DeckError, deck_digest, read_deck
from msahl.deck.includes import MOST_DEEP
from tests.support.effective import effective_deck

PART = """<part>
  <parameters>
    <parameter name="side" units="m">1</parameter>
    <parameter name="half">{side/2}</parameter>
  </parameters>
  <system>
    <bodies>
      <rigidBody>
        <name>Wheel</name>
        <mass>2</mass>
        <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
        <initialConditions><position basis="Base"><x>{half}</x></position></initialConditions>
      </rigidBody>
    </bodies>
    <joints>
      <revolute>
        <name>Axle</name>
        <parent><name>Base</name><position basis="Wheel"><x>{half}</x></position>
          <axis basis="Wheel"><y>1</y></axis></parent>
        <child><name>Wheel</name></child>
      </revolute>
    </joints>
    <motions>
      <jointMotion>
        <name>Motor</name><joint>Axle</joint><coordinate>angle</coordinate>
        <law><polynomial><c1>{side/half}</c1></polynomial></law>
      </jointMotion>
    </motions>
  </system>
</part>
"""
DECK = """<data>
  <!-- two wheels -->
  <parameters><parameter name="track" units="cm">150</parameter></parameters>
  <includes>
{includes}
  </includes>
  <system>
    <bodies><ground><name>Base</name></ground>{bodies}</bodies>
  </system>
  <simulation><deltaT>0.01</deltaT><tFinal>0.1</tFinal></simulation>
</data>
"""
LEFT = '    <include href="wheel.xml" prefix="L."><set name="side">{track}</set></include>'
RIGHT = '    <include href="wheel.xml" prefix="R."><set name="side" units="mm">-600</set></include>'


@pytest.fixture
def path(tmp_path):
    (tmp_path / "wheel.xml").write_text(PART)
    path = tmp_path / "deck.xml"
    path.write_text(deck())
    return path


def deck(*includes, bodies=""):
    return DECK.format(includes="\n".join(includes or (LEFT, RIGHT)), bodies=bodies)


def faults_of(path):
    with pytest.raises(DeckError) as error:
        read_deck(path)
    return [str(fault).removeprefix(f"{path.parent}/") for fault in error.value.faults]


def test_one_file_is_used_twice(path):
    model = read_deck(path)
    assert [body.name for body in model.bodies] == ["L.Wheel", "R.Wheel"]
    assert [body.position[0] for body in model.bodies] == [0.75, -0.3]
    assert [joint.child for joint in model.joints] == ["L.Wheel", "R.Wheel"]
    assert [joint.parent for joint in model.joints] == ["Base", "Base"]
    assert [motion.joint for motion in model.motions] == ["L.Axle", "R.Axle"]


def test_the_deck_that_ran_contains_the_parts(path, tmp_path):
    model, text = read_deck(path), effective_deck(path)
    copy = tmp_path / "copy.xml"
    copy.write_bytes(text)
    (tmp_path / "wheel.xml").write_text(PART.replace("<mass>2", "<mass>3"))
    assert read_deck(copy) == model
    assert effective_deck(copy) == text
    assert b"<!-- two wheels -->" in text
    assert b"<x>0.75</x><!-- {L.half} -->" in text
    assert b'<parameter name="L.half" units="m">0.75<!-- {L.side/2} --></parameter>' in text
    assert deck_digest(effective_deck(path)) != deck_digest(text)


def test_parameters_of_parts_can_be_set(path):
    model = read_deck(path, settings=["L.side=2", "R.Wheel.mass=5", "track=7 m"])
    assert [body.position[0] for body in model.bodies] == [1.0, -0.3]
    assert [body.mass for body in model.bodies] == [2.0, 5.0]


def test_parts_of_parts(path, tmp_path):
    (tmp_path / "axle").mkdir()
    (tmp_path / "axle" / "wheel.xml").write_text(PART)
    axle = f"""<part><parameters><parameter name="track" units="m">1</parameter></parameters>
    <includes>{LEFT}{RIGHT}</includes><system><loads><springDamper><name>Spring</name>
    <parent><name>L.Wheel</name></parent><child><name>R.Wheel</name></child>
    <stiffness>{{L.half/track}}</stiffness></springDamper></loads></system></part>"""
    (tmp_path / "axle" / "axle.xml").write_text(axle)
    path.write_text(deck('<include href="axle/axle.xml" prefix="Front-"/>'))
    model = read_deck(path)
    assert [body.name for body in model.bodies] == ["Front-L.Wheel", "Front-R.Wheel"]
    (spring,) = model.loads
    assert (spring.name, spring.parent, spring.stiffness) == ("Front-Spring", "Front-L.Wheel", 0.5)
    assert read_deck(path, settings=["Front-track=4 m"]).bodies[0].position[0] == 2.0
    path.write_bytes(effective_deck(path))
    assert read_deck(path) == model


def test_a_part_without_prefix(path):
    path.write_text(deck('    <include href="wheel.xml"/>'))
    assert read_deck(path).bodies[0].name == "Wheel"


def test_faults_in_a_part_have_its_file_and_line(path, tmp_path):
    part = tmp_path / "wheel.xml"
    part.write_text(PART.replace("{side/2}", "{side/2 + zz}"))
    assert faults_of(path)[0].startswith(
        "wheel.xml:4: parameter 'L.half': in {L.side/2 + zz}: unknown name 'zz'"
    )
    part.write_text(PART.replace("<mass>2", "<mass>-2"))
    assert faults_of(path)[0].startswith("wheel.xml:10: body 'L.Wheel', mass: ")
    part.write_text(PART.replace("<mass>2", "<mass>two").replace("</part>", "<x/></part>"))
    assert [line.partition(": ")[0] for line in dict.fromkeys(faults_of(path))] == [
        "wheel.xml:10",
        "wheel.xml:30",
    ]
    part.write_text(PART[:200])
    assert any(line.startswith("wheel.xml:") and "well-formed" in line for line in faults_of(path))


def test_names_that_are_taken_say_in_which_file(path):
    path.write_text(deck(LEFT, LEFT.replace("wheel", "./wheel")))
    found = faults_of(path)
    assert any("the name is taken by line 9 of" in line for line in found)


def test_faults_of_set_values_have_the_line_of_the_include(path):
    path.write_text(deck(LEFT.replace("{track}", "{trak}"), RIGHT))
    (found,) = faults_of(path)
    assert found.startswith("deck.xml:5: parameter 'L.side': in {trak}")


@pytest.mark.parametrize(
    ("include", "message"),
    [
        ('href="../wheel.xml"', "'../wheel.xml' is not accepted; name a file beside this one"),
        ('href="sub/../wheel.xml"', "is not accepted"),
        ('href="/etc/passwd"', "is not accepted"),
        ('href="http://localhost:9/wheel.xml"', "is not accepted"),
        ('href="file:///etc/passwd"', "is not accepted"),
        ('href="C:wheel.xml"', "is not accepted"),
        (r'href="sub\wheel.xml"', "is not accepted"),
        ('href="no.xml"', "cannot be read: No such file"),
        ('href="."', "is no file"),
        ('href="pipe.xml"', "is no file"),
        ('href="away.xml"', "leads out of the folder"),
        ('href="loop.xml"', "cannot be read"),
        ('href="deck.xml"', "a file includes itself: deck.xml -> deck.xml"),
        ('href="wheel.xml" prefix="a,b"', "the prefix must be printable"),
        ('prefix="a"', "attribute href is missing"),
        ('href="wheel.xml"><set name="sid">1</set', "'sid' is no parameter; did you mean side"),
        ('href="wheel.xml"><set name="side">1</set><set name="side">1</set', "is set twice"),
        ('href="wheel.xml"><set name="side" units="kg">1</set', "the parameter is given in m"),
        ('href="wheel.xml"><set name="side">{1 + }</set', "ends too early"),
        ('href="other.xml"', "the root element is <data> (that of a deck); a part's is <part>"),
        ('href="us.xml"', "the deck that includes it has the unitSystem SI"),
        ('href="heavy.xml"', "gravity acts on all parts; move it to the deck"),
    ],
)
def test_includes_that_are_not_accepted(path, tmp_path, include, message):
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "away.xml").symlink_to("/etc/passwd")
    (tmp_path / "loop.xml").symlink_to("loop.xml")
    (tmp_path / "other.xml").write_text("<data><system/></data>")
    (tmp_path / "us.xml").write_text("<part><unitSystem>US</unitSystem><system/></part>")
    (tmp_path / "heavy.xml").write_text("<part><system><gravity/></system></part>")
    path.write_text(deck(f"<include {include}></include>"))
    assert any(message in line for line in faults_of(path))


def test_circles_depth_and_number_are_bounded(path, tmp_path):
    def part(*names):
        uses = "".join(f'<include href="{n}.xml" prefix="{k}"/>' for k, n in enumerate(names))
        return f"<part><includes>{uses}</includes><system/></part>"

    (tmp_path / "a.xml").write_text(part("b"))
    (tmp_path / "b.xml").write_text(part("a"))
    path.write_text(deck('<include href="a.xml"/>'))
    assert "a file includes itself: deck.xml -> a.xml -> b.xml -> a.xml" in faults_of(path)[0]
    for depth in range(MOST_DEEP + 1):
        (tmp_path / f"d{depth}.xml").write_text(part(f"d{depth + 1}"))
    path.write_text(deck('<include href="d0.xml"/>'))
    assert "more than 8 parts inside one another" in faults_of(path)[0]
    for depth in range(5):  # 10^5 parts
        (tmp_path / f"w{depth}.xml").write_text(part(*[f"w{depth + 1}"] * 10))
    (tmp_path / "w5.xml").write_text("<part><system/></part>")
    path.write_text(deck('<include href="w0.xml"/>'))
    assert "more than 1000 parts" in faults_of(path)[0]


@pytest.mark.parametrize(("prefix", "remedy"), [("", "a prefix"), ("L.", "another prefix")])
def test_a_part_used_twice_needs_two_prefixes(path, prefix, remedy):
    include = f'<include href="wheel.xml" prefix="{prefix}"/>'
    path.write_text(deck(include, include))
    (fault,) = faults_of(path)
    message = f"includes/include: 'wheel.xml' is included twice; give this one {remedy}"
    assert fault == f"deck.xml:6: {message}"


def test_an_include_need_not_contain_anything(path):
    """That of a deck with a fault elsewhere is not called empty."""
    path.write_text(deck('<include href="wheel.xml" prefix="L."/>').replace("tFinal", "tEnd"))
    assert not [fault for fault in faults_of(path) if "empty" in str(fault)]
    assert faults_of(path)


def test_a_symlink_within_the_folder_is_accepted(path, tmp_path):
    (tmp_path / "link.xml").symlink_to("wheel.xml")
    path.write_text(deck('<include href="link.xml" prefix="A"/>'))
    assert read_deck(path).bodies[0].name == "AWheel"


MOTOR = PART.replace(
    "    <motions>",
    """    <markers>
      <marker><name>Hub</name><body>Wheel</body></marker>
      <distance><name>Span</name><from>Hub</from><to>Far</to></distance>
    </markers>
    <groups><group><name>All</name><body>Wheel</body></group></groups>
    <signals>
      <signal name="speed" units="rad/s">{Axle.angleRate*half/side + 0*k*Hub.vx}</signal>
      <state name="i" initial="{half/side}" units="A">{slow(speed) - r*i + 0*t}</state>
      <table name="slow" units="A/s"><x units="rad/s">0 1</x><values>0 1</values></table>
    </signals>
    <loads>
      <actuator><name>Motor</name><joint>Axle</joint><coordinate>angle</coordinate>
        <expression units="N-m">where(Axle.angle &lt; pi, k*i, outside)</expression></actuator>
    </loads>
    <motions>""",
).replace("</parameters>", '<parameter name="r">2</parameter></parameters>')
MOTOR = MOTOR[: MOTOR.index("<motions>")] + MOTOR[MOTOR.index("</motions>") + len("</motions>") :]


def test_expressions_of_the_motion_in_parts(path, tmp_path):
    """Names that the part defines get the prefix, in laws as well; k and outside are the deck's."""
    (tmp_path / "wheel.xml").write_text(MOTOR)
    text = deck(LEFT.replace("L.", "L-1."), RIGHT).replace(
        "</parameters>", '<parameter name="k" units="N-m/A">3</parameter></parameters>'
    )
    signal = '<signals><signal name="outside">2*L-1 + R.i</signal></signals></system>'
    marker = "<markers><marker><name>Far</name><body>Base</body></marker></markers>"
    path.write_text(text.replace("</system>", marker + signal.replace("L-1", "'L-1.i'")))
    model = read_deck(path)
    assert [signal.name for signal in model.signals] == [
        "outside",
        *("L-1.speed", "L-1.i", "L-1.slow"),
        *("R.speed", "R.i", "R.slow"),
    ]
    assert [load.joint for load in model.loads] == ["L-1.Axle", "R.Axle"]
    assert "Name(text='L-1.Axle.angleRate'" in repr(model.signals[1])
    assert "Name(text='L-1.Hub.vx'" in repr(model.signals[1])
    assert [marker.body for marker in model.markers] == ["Base", "L-1.Wheel", "R.Wheel"]
    assert [group.bodies for group in model.groups] == [("L-1.Wheel",), ("R.Wheel",)]
    assert "Name(text='L-1.i'" in repr(model.loads[0])
    assert model.signals[2].initial == 0.5
    text = effective_deck(path)
    path.write_bytes(text)
    assert read_deck(path) == model
    assert effective_deck(path) == text
