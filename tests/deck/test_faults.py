"""Every fault of a deck is reported: file, line, what, and what would be right; all at once."""

import os
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace

import pytest
from lxml import etree

from msahl.deck import DeckError, check_simulation, read_deck
from msahl.deck.diagnosis import add_faults
from msahl.deck.faults import Faults
from msahl.deck.parse import MAX_BYTES, parse
from msahl.deck.schema import built, schema_bytes
from msahl.model import Simulation
from msahl.system.names import reaction_columns, state_columns, work_columns

DECK = """\
<data>
  <system>
    <gravity><g3 units="m/sec^2">9.80665</g3></gravity>
    <bodies>
      <ground><name>Base</name></ground>
      <rigidBody>
        <name>Bob</name>
        <mass units="kg">2.0</mass>
        <rGB><x>0</x></rGB>
        <moi><Ixx>0.1</Ixx><Iyy>0.1</Iyy><Izz>0.1</Izz></moi>
        <initialConditions>
          <position basis="Bob"><z units="m">5.0</z></position>
          <orientation>
            <eulerRotation><phi units="deg">45</phi><u2>1</u2></eulerRotation>
          </orientation>
        </initialConditions>
      </rigidBody>
    </bodies>
    <joints>
      <spherical>
        <name>Pivot</name>
        <parent><name>Base</name></parent>
        <child>
          <name>Bob</name>
          <position><z>-5.0</z></position>
        </child>
      </spherical>
    </joints>
    <loads>
      <concentrated>
        <name>Push</name>
        <body>Bob</body>
        <force><xForce>1</xForce></force>
      </concentrated>
    </loads>
  </system>
  <simulation>
    <title>t</title>
    <deltaT>0.01</deltaT>
    <tFinal>1</tFinal>
  </simulation>
</data>
"""


def faults_of(path: Path) -> list[str]:
    with pytest.raises(DeckError) as caught:
        read_deck(path)
    assert str(caught.value) == "\n".join(map(str, caught.value.faults))
    return [str(fault).removeprefix(f"{path}") for fault in caught.value.faults]


def changed(tmp_path: Path, *changes: tuple[str, str]) -> Path:
    deck = DECK
    for old, new in changes:
        assert deck.count(old) == 1, old
        deck = deck.replace(old, new)
    path = tmp_path / "deck.xml"
    path.write_text(deck, encoding="utf-8")
    return path


def test_the_template_is_good(tmp_path):
    assert read_deck(changed(tmp_path)).bodies[0].name == "Bob"


MOI = "<Ixx>0.1</Ixx><Iyy>0.1</Iyy><Izz>0.1</Izz>"

SCHEMA_FAULTS = {
    "unknown element": (
        ('<mass units="kg">2.0</mass>', '<mass units="kg">2.0</mass><colour>red</colour>'),
        ":8: body 'Bob', colour: unknown element <colour> in <rigidBody>; expected one of <name>",
    ),
    "misspelt element": (
        ("<g3 units", "<gz>1</gz><g3 units"),
        ":3: system/gravity/gz: unknown element <gz> in <gravity>; did you mean <g3>? expected",
    ),
    "missing element": (
        ('<mass units="kg">2.0</mass>', ""),
        ":6: body 'Bob': <mass> is missing; add it to <rigidBody>",
    ),
    "repeated element": (
        ("<title>t</title>", "<title>t</title><title>u</title>"),
        ":38: simulation/title: <title> is given twice in <simulation>; keep one",
    ),
    "unknown joint": (
        ("<joints>", "<joints>\n<sphericle/>"),
        ":20: joint 1: unknown element <sphericle> in <joints>; did you mean <spherical>?",
    ),
    "empty bodies": (
        (DECK[DECK.index("<bodies>") : DECK.index("</bodies>")], "<bodies>"),
        ":4: system/bodies: <bodies> is empty; add one of <ground>, <rigidBody>",
    ),
    "unknown unit": (
        ('"kg">2', '"stone">2'),
        ":8: body 'Bob', mass: unknown unit 'stone'; expected one of kg, g, slug, lbm",
    ),
    "unit of another quantity": (
        ('<z units="m">', '<z units="m/s">'),
        ":12: body 'Bob', initialConditions/position/z: unknown unit 'm/s'; expected one of m, mm",
    ),
    "unknown unit system": (
        ("<data>", "<data><unitSystem>imperial</unitSystem>"),
        ":1: unitSystem: unknown value 'imperial'; expected one of SI, US",
    ),
    "moi about nowhere": (
        ("<moi>", '<moi about="C">'),
        ":10: body 'Bob', moi: unknown value about='C'; expected one of G, B",
    ),
    "unknown attribute": (
        ("<moi>", '<moi abuot="B">'),
        ":10: body 'Bob', moi: unknown attribute abuot; did you mean about? expected about",
    ),
    "not a number": (
        (">2.0<", ">two<"),
        ":8: body 'Bob', mass: 'two' is not a finite number such as 2, -0.5 or 1.5e-3",
    ),
    "NaN": ((">2.0<", ">NaN<"), ":8: body 'Bob', mass: 'NaN' is not a finite number"),
    "INF": ((">9.80665<", ">-INF<"), ":3: system/gravity/g3: '-INF' is not a finite number"),
    "no number": ((">0.01<", "><"), ":39: simulation/deltaT: '' is not a finite number"),
    "empty name": (
        ("<name>Pivot</name>", "<name> </name>"),
        ":21: joint 1, name: the name is empty; give a name",
    ),
    "empty basis": (
        ('basis="Bob"', 'basis=" "'),
        ":12: body 'Bob', initialConditions/position: attribute basis is empty; give a name",
    ),
    "attribute where none is": (
        ("<rGB>", '<rGB basis="Bob">'),
        ":9: body 'Bob', rGB: unknown attribute basis; none is expected here",
    ),
    "element in a number": (
        (">2.0<", "><b/>2.0<"),
        ":8: body 'Bob', mass/b: <b> does not belong in <mass>, which holds a value",
    ),
    "unknown scheme": (
        ("<simulation>", '<simulation scheme="magic">'),
        "simulation: unknown value scheme='magic'",
    ),
    "too much damping": (
        ("<simulation>", '<simulation damping="1.5">'),
        "simulation: damping='1.5' is not a number from 0 to 1",
    ),
    "damping in words": (
        ("<simulation>", '<simulation damping="much">'),
        "simulation: damping='much' is not a number from 0 to 1",
    ),
    "accuracy without end": (
        ("<deltaT>", "<verdict><accuracy>INF</accuracy></verdict><deltaT>"),
        "simulation/verdict/accuracy: 'INF' is not a finite number",
    ),
    "stray text": (
        ("<joints>", "<joints>and"),
        ":19: system/joints: stray text 'and'; <joints> holds one of <rigid>, <revolute>,",
    ),
}

MEANING_FAULTS = {
    "accuracy of zero": (
        ("<deltaT>", "<verdict><accuracy>0</accuracy></verdict><deltaT>"),
        ":39: simulation/verdict/accuracy: the limit is 0; it must be greater than",
    ),
    "duplicate name": (
        ("<name>Base</name></ground>", "<name>Bob</name></ground>"),
        ":7: body 'Bob', name: the name is taken by line 5; choose another",
    ),
    "unprintable name": (
        ("<name>Pivot</name>", "<name>Pi\u200bvot,</name>"),
        ":21: joint 'Pi\\u200bvot,', name: a name must not contain , \\u200b (names head",
    ),
    "missing child": (
        ("<name>Bob</name>\n          <p", "<name>Bib</name>\n          <p"),
        ":24: joint 'Pivot': child 'Bib' is not a body of this model (bodies: Base, Bob)",
    ),
    "missing basis": (
        ('basis="Bob"', 'basis="Rob"'),
        ":12: body 'Bob', initialConditions/position: basis 'Rob' is not a body of this model",
    ),
    "missing load body": (
        ("<body>Bob<", "<body>Bab<"),
        ":32: load 'Push': body 'Bab' is not a body of this model",
    ),
    "loaded ground": (
        ("<body>Bob<", "<body>Base<"),
        ":32: load 'Push': 'Base' is a ground and never moves; name a rigid body",
    ),
    "load of nothing": (
        ("<force><xForce>1</xForce></force>", ""),
        ":30: load 'Push': it has neither <force> nor <moment>; add one",
    ),
    "joint to itself": (
        ("<parent><name>Base<", "<parent><name>Bob<"),
        ":20: joint 'Pivot': parent and child are both 'Bob'",
    ),
    "joint of grounds": (
        (
            "</ground>",
            "</ground><ground><name>Wall</name></ground>",
        ),
        ("<name>Bob</name>\n          <p", "<name>Wall</name>\n          <p"),
        ":20: joint 'Pivot': 'Base' and 'Wall' are both grounds; name a body that moves",
    ),
    "points apart": (
        (">-5.0<", ">-4.0<"),
        ":20: joint 'Pivot': its points are 1 m apart at t = 0: (0, 0, 0) m on parent 'Base' "
        "but (0.707106781, 0, 0.707106781) m on child 'Bob'",
    ),
    "negative mass": (
        (">2.0<", ">-2.0<"),
        ":8: body 'Bob', mass: the mass is -2 kg; it must be greater than zero",
    ),
    "impossible inertia": (
        (MOI, "<Ixx>0.1</Ixx><Iyy>0.1</Iyy><Izz>0.3</Izz>"),
        ":10: body 'Bob', moi: principal moments about G 0.1, 0.1, 0.3 kg-m^2: none may exceed",
    ),
    "indefinite inertia": (
        (MOI, MOI + "<Ixy>-0.2</Ixy>"),
        ":10: body 'Bob', moi: principal moments about G -0.1, 0.1, 0.3 kg-m^2: all must be",
    ),
    "zero inertia": (
        (MOI, "<Ixx>0</Ixx><Iyy>0</Iyy><Izz>0</Izz>"),
        "all must be greater than zero; give a small one in place of zero",
    ),
    "inertia about B less than its part of G": (
        ("<moi>", '<moi about="B">'),
        ("<rGB><x>0<", "<rGB><x>1<"),
        ":10: body 'Bob', moi: principal moments about G -1.9, -1.9, 0.1",
    ),
    "zero axis": (
        ("<u2>1<", "<u2>0<"),
        ":14: body 'Bob', initialConditions/orientation/eulerRotation: the axis (u1, u2, u3) is",
    ),
    "too large": (
        (">2.0<", ">2e400<"),
        ":8: body 'Bob', mass: 2e400 is too large; numbers go up to 1e+100 in SI",
    ),
    "too large in SI": (
        ('<z units="m">5.0<', '<z units="km">1e99<'),
        ":12: body 'Bob', initialConditions/position/z: 1e99 is too large; numbers go up to",
    ),
    "too small": (
        (">2.0<", ">2e-320<"),
        ":8: body 'Bob', mass: 2e-320 is too small; numbers go down to 1e-100 in SI, or are 0",
    ),
    "a name of space that is none in XML": (
        ("<name>Pivot<", "<name>\u3000<"),
        ":21: joint '\\u3000', name: a name must not contain \\u3000",
    ),
    "deltaT zero": ((">0.01<", ">0<"), ":39: simulation/deltaT: it is 0 s; it must be greater"),
    "deltaT too long": (
        (">0.01<", ">2<"),
        ":39: simulation/deltaT: the step 2 s is longer than the run of 1 s",
    ),
    "too many steps": (
        (">0.01<", ">1e-10<"),
        ":39: simulation/deltaT: 1e+10 steps of 1e-10 s to 1 s are more than 1e+09",
    ),
}


FAULTS = SCHEMA_FAULTS | MEANING_FAULTS


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_is_reported_where_it_is(tmp_path, case):
    *changes, expected = FAULTS[case]
    found = faults_of(changed(tmp_path, *changes))
    assert sum(expected in fault for fault in found) == 1, found
    # A slip brings no second fault with it, but for what it truly breaks elsewhere: without its
    # ground the joint has no parent and the load no basis, without bodies nothing resolves.
    if case not in ("duplicate name", "empty bodies"):
        assert len(found) == 1, found


@pytest.mark.parametrize("case", SCHEMA_FAULTS)
def test_all_readers_of_the_schema_agree(tmp_path, case):
    path = changed(tmp_path, *SCHEMA_FAULTS[case][:-1])
    root = parse(path.read_bytes(), Faults("deck"))
    assert not etree.XMLSchema(etree.fromstring(schema_bytes())).validate(root.getroottree())
    assert not built(schema_bytes()).is_valid(root)
    faults = Faults("deck")
    add_faults(root, built(schema_bytes()).elements["data"], faults)
    assert not faults.sound(root)


@pytest.mark.parametrize(
    "wrong",
    [
        (">2.0<", ">2.0\u3000<"),
        ('"kg">', '"kg\x85">'),
        ("<simulation>", "<simulation degree='\N{FULLWIDTH DIGIT THREE}'>"),
    ],
)
def test_what_only_python_takes_for_a_space_or_a_digit_is_reported(tmp_path, wrong):
    (fault,) = faults_of(changed(tmp_path, wrong))
    assert "not valid" not in fault  # in our words, not in those of libxml2


def test_xmlschema_validates_what_libxml2_accepts_up_to_a_size(tmp_path, monkeypatch):
    def errors(root):
        return [SimpleNamespace(elem=root.find("simulation"), reason="wrong")]

    monkeypatch.setattr(built(schema_bytes()), "iter_errors", errors)
    path = changed(tmp_path)
    assert read_deck(path).bodies
    size = len(list(parse(path.read_bytes(), Faults("deck")).iter()))
    monkeypatch.setattr("msahl.deck.schema.MANY", size)
    with pytest.raises(DeckError, match="simulation: not valid: wrong"):
        read_deck(path, thorough=True)
    monkeypatch.setattr("msahl.deck.schema.MANY", size - 1)
    assert read_deck(path, thorough=True).bodies


@pytest.mark.parametrize("attribute", ["type='number'", "nil='true'", "type='foo'"])
def test_no_attribute_bends_the_schema(tmp_path, attribute):
    xsi = "xmlns:xsi='http://www.w3.org/2001/XMLSchema-instance'"
    path = changed(tmp_path, ("<mass ", f"<mass {xsi} xsi:{attribute} "))
    word = attribute.split("=")[0]
    assert faults_of(path) == [
        f":8: body 'Bob', mass: xsi:{word} has no meaning in a deck; delete it"
    ]


def test_a_load_without_basis_needs_a_ground(tmp_path):
    joints = DECK[DECK.index("<joints>") : DECK.index("</joints>")]
    path = changed(tmp_path, ("<ground><name>Base</name></ground>", ""), (joints, "<joints>"))
    assert faults_of(path) == [
        ":24: load 'Push', force: without basis it is in a ground's axes, but the deck has no "
        "ground; add either"
    ]


def test_a_deck_needs_something_that_moves(tmp_path):
    body = DECK[DECK.index("<rigidBody>") : DECK.index("</rigidBody>")] + "</rigidBody>"
    found = faults_of(changed(tmp_path, (body, "")))
    wanted = "add a <rigidBody>, <beam> or <elasticBody>"
    assert f":4: system/bodies: nothing here moves; {wanted}" in found


def test_all_faults_at_once_in_the_order_of_lines(tmp_path):
    found = faults_of(
        changed(
            tmp_path,
            (">0.01<", ">-1<"),
            ("<u2>1<", "<u2>0<"),
            ('"kg">2.0', '"kg">0'),
            ("<g3 units", "<g5/><g3 units"),
            (MOI, "<Ixx>0.1</Ixx><Iyy>0.1</Iyy><Izz>0.3</Izz>"),
            ("<body>Bob<", "<body>Bab<"),
        )
    )
    lines = [int(fault.split(":")[1]) for fault in found]
    assert lines == [3, 8, 10, 14, 32, 39]


def test_a_record_with_a_schema_fault_is_still_known_by_name(tmp_path):
    found = faults_of(changed(tmp_path, (">2.0<", ">two<"), (">-5.0<", ">-4.0<")))
    assert [fault.split(":")[1] for fault in found] == ["8"]  # Bob is not judged, nor missed


DRIVEN = (
    "</joints>",
    "<revolute><name>Hinge</name><parent><name>Base</name><axis><z>1</z></axis></parent>"
    "<child><name>Arm</name></child></revolute></joints>"
    "<motions><jointMotion><name>Motor</name><joint>Hinge</joint><coordinate>angle</coordinate>"
    "<law><constant>0</constant></law></jointMotion></motions>",
)
ARM = (
    "</bodies>",
    "<rigidBody><name>Arm</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>"
    "</rigidBody></bodies>",
)


@pytest.mark.parametrize(
    "slip",
    [
        ("<rGB><x>0</x></rGB>", "<rGB><x>o</x></rGB>"),  # in another record
        ("<deltaT>0.01</deltaT>", ""),
        ("<gravity>", "<gravity><g4/>"),
        ("<name>Push</name>", "<nmae>Push</nmae>"),  # in the same one
        ("<xForce>1<", "<xForce>one<"),
        ("<force>", '<foo/><force basis="Bob">'),
    ],
)
def test_misspelt_references_are_reported_beside_faults_of_the_schema(tmp_path, slip):
    there = changed(tmp_path, ARM, DRIVEN, slip)
    own = faults_of(there)
    assert own
    assert "of this model" not in "".join(own)
    text = there.read_text()
    for right, wrong in (
        ("<body>Bob<", "<body>Bub<"),
        ("<parent><name>Base<", "<parent><name>Bose<"),
        ("<joint>Hinge<", "<joint>Hunge<"),
        ('<position basis="Bob">', '<position basis="Bib">'),
    ):
        text = text.replace(right, wrong)
    there.write_text(text)
    told = "\n".join(faults_of(there))
    assert told.count("of this model") == 5  # both joints have the ground for a parent
    for phrase in ("body 'Bub'", "parent 'Bose'", "joint 'Hunge'", "basis 'Bib'"):
        assert phrase in told
    assert all(fault.split(": ", 1)[1] in told for fault in own)


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("<name>Arm</name><mass>", "<nmae>Arm</nmae><mass>", 2),  # unknown, and <name> is missing
        ("<name>Arm</name><mass>", "<mass>", 1),
        ("<name>Hinge</name>", "", 1),
        ("<name>Hinge</name>", "<name/>", 1),
        ("<revolute>", "<revolut>", 1),
        ("<joints>", "<jionts>", 1),
        ("<bodies>", "<boodies>", 2),  # unknown, and <bodies> is missing
        ("<ground><name>Base</name>", "<ground><naem>Base</naem>", 2),
        ("<ground><name>Base</name></ground>", "<Ground><name>Base</name></Ground>", 1),
    ],
)
def test_a_reference_to_an_element_with_a_fault_of_its_own_is_not_misspelt(
    tmp_path, right, wrong, told
):
    path = changed(tmp_path, ARM, DRIVEN)
    text = path.read_text()
    assert text.count(right) == 1
    path.write_text(text.replace(right, wrong).replace(f"</{right[1:]}", f"</{wrong[1:]}"))
    found = faults_of(path)
    assert len(found) == told, found


def test_more_unknown_names_than_nameless_bodies_are_reported(tmp_path):
    slips = (("<name>Arm</name><mass>", "<mass>"), ("<body>Bob<", "<body>Bub<"))
    told = "\n".join(faults_of(changed(tmp_path, ARM, DRIVEN, *slips)))
    assert "body 'Bub' is not a body" in told  # one of Arm and Bub is the nameless one, not both


@pytest.mark.parametrize(
    ("first", "second"),
    [("Motor", "Push"), ("Hinge", "Push"), ("Pivot", "Push"), ("Motor", "Hinge")],
)
def test_what_names_columns_of_reactions_and_work_has_one_name_each(tmp_path, first, second):
    path = changed(tmp_path, ARM, DRIVEN)
    text = path.read_text().replace(f"<name>{second}<", f"<name>{first}<")
    path.write_text(text)
    told = faults_of(path)
    assert any("the name is taken by line" in fault for fault in told)


@pytest.mark.parametrize("name", ["Push", "Pivot", "Motor"])
def test_no_column_is_taken_for_the_schemes_own(tmp_path, name):
    path = changed(tmp_path, ARM, DRIVEN)
    path.write_text(path.read_text().replace(f"<name>{name}<", "<name>scheme<"))
    (fault,) = faults_of(path)
    assert "the name is that of the scheme's own column" in fault


def test_no_two_columns_of_a_deck_are_the_same(tmp_path):
    # A body may have the name of a joint: no quantity of one is a quantity of the other.
    path = changed(tmp_path, ARM, DRIVEN, ("<name>Pivot<", "<name>Bob<"))
    model = read_deck(path)
    columns = [*state_columns(model), *reaction_columns(model)[1:], *work_columns(model)[1:]]
    assert len(columns) == len(set(columns))


BOMB = """<!-- a -->
<!DOCTYPE data [<!ENTITY a "aaaaaaaaaa">
""" + "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">\n' for a, b in pairwise("abcdefghijkl"))
FILES = {
    "entity bomb": (BOMB + "]><data>&l;</data>", ":2: a document type declaration"),
    "external entity": (
        '<!DOCTYPE data [<!ENTITY x SYSTEM "file:///etc/passwd">]><data>&x;</data>',
        ":1: a document type declaration (<!DOCTYPE ...>, <!ENTITY ...>) is not accepted in a deck",
    ),
    "external DTD": (
        '<!DOCTYPE data SYSTEM "http://localhost:9/x.dtd"><data/>',
        ":1: a document type declaration",
    ),
    "broken": (DECK.replace("</rGB>", ""), ":17: not well-formed XML: Opening and ending tag"),
    "cut off": (DECK[:400], ":13: not well-formed XML: "),
    "zero bytes": ("", ": the file is empty; 'msahl new' writes a deck to start from"),
    "blank": (" \n", ": the file is empty"),
    "text": ("hello", ":1: not well-formed XML: Start tag expected, '<' not found"),
    "another root": ("<deck/>", ":1: the root element is <deck>; a deck's is <data>"),
    "another namespace": ("<data xmlns='urn:a'/>", ":1: the root element is <{urn:a}data>"),
    "deep": ("<data>" * 1000, ":1: not well-formed XML: "),
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_that_is_no_deck_is_reported_in_one_line(tmp_path, case):
    text, expected = FILES[case]
    path = tmp_path / "deck.xml"
    path.write_text(text)
    (fault,) = faults_of(path)
    assert fault.startswith(expected), fault


@pytest.mark.parametrize("case", ["entity bomb", "external entity", "external DTD"])
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "cp037"])
def test_no_encoding_hides_a_declaration(tmp_path, case, encoding):
    path = tmp_path / "deck.xml"
    prolog = f"<?xml version='1.0' encoding='{encoding}'?>"
    path.write_bytes((prolog + FILES[case][0]).encode(encoding))
    (fault,) = faults_of(path)
    assert "document type declaration" in fault or "not well-formed" in fault


def test_garbage_is_no_deck(tmp_path):
    path = tmp_path / "deck.xml"
    for data in (bytes(range(256)) * 40, b"\x00" * 100, b"\xff\xfe", b"<data>\x00</data>"):
        path.write_bytes(data)
        (fault,) = faults_of(path)
        assert "not well-formed XML: " in fault


def test_a_file_that_cannot_be_read(tmp_path):
    assert faults_of(tmp_path) == [": cannot be read: Is a directory; give the path of a deck"]
    (fault,) = faults_of(tmp_path / "none.xml")
    assert fault == ": cannot be read: No such file or directory; give the path of a deck"
    (fault,) = faults_of(Path("a\0b"))
    assert "cannot be read" in fault


def test_a_file_too_large_is_not_read(tmp_path):
    path = tmp_path / "deck.xml"
    with path.open("wb") as stream:
        stream.write(b"<data>")
        os.truncate(stream.fileno(), MAX_BYTES + 1)
    assert faults_of(path) == [": larger than 256 MiB, the largest deck accepted"]


def test_check_simulation_reports_what_an_override_breaks():
    assert check_simulation(Simulation("", 0.1, 1.0)) == []
    assert check_simulation(Simulation("", -1.0, float("inf"))) == [
        "deltaT: it is -1 s; it must be greater than zero, 1e-100 to 1e+100 s",
        "tFinal: it is inf s; it must be greater than zero, 1e-100 to 1e+100 s",
    ]
    assert check_simulation(Simulation("", float("nan"), 1.0))[0].startswith("deltaT: it is nan s")
