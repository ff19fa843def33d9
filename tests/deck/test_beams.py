"""Beams of a deck become records of a beam and of its nodes; faults have their line."""

import re

import numpy as np
import pytest

from msahl.algebra.rotation import matrix
from msahl.check import check
from msahl.deck import DeckError, read_deck
from msahl.deck.source import ParsedDeck, Source
from tests.support.models import ROOT

ELASTIC = ROOT / "decks/elastic"
ROUND_OFF = 1e-14

BEAM = """<beam{attributes}><name>Rod</name>{mesh}
<centreLine>{line}</centreLine>{more}
<section>{section}</section>
{material}{start}</beam>"""
LINE = "<straight><end><x>2</x></end></straight>"
SECTION = "<circle><radius>0.1</radius></circle>"
MATERIAL = """<material><youngsModulus>2e11</youngsModulus><poissonsRatio>0.3</poissonsRatio>
<density>7800</density></material>"""
STIFF = "<stiffnesses>{}<mass>1</mass><inertia><x>1</x></inertia></stiffnesses>"
DECK = """<data>{parameters}<system><bodies><ground><name>G</name></ground>
{beam}</bodies>
<joints>{joints}</joints>
<loads>{loads}</loads>
<markers>{markers}</markers>
<groups>{groups}</groups></system>
<simulation><deltaT>0.1</deltaT><tFinal>1</tFinal></simulation></data>"""


def text(
    parameters="", joints="", loads="", markers="", groups="", attributes="",
    mesh="<elements>4</elements>", line=LINE, more="", section=SECTION, material=MATERIAL, start="",
):  # fmt: skip
    """A deck with one beam."""
    beam = BEAM.format(
        attributes=attributes,
        mesh=mesh,
        line=line,
        more=more,
        section=section,
        material=material,
        start=start,
    )
    return DECK.format(
        parameters=parameters,
        beam=beam,
        joints=joints,
        loads=loads,
        markers=markers,
        groups=groups,
    )


@pytest.fixture
def read(tmp_path):
    def read_model(settings=(), **parts):
        path = tmp_path / "deck.xml"
        path.write_text(text(**parts))
        return read_deck(path, thorough=True, settings=settings)

    return read_model


@pytest.fixture
def faults(read):
    def messages(**parts):
        with pytest.raises(DeckError) as caught:
            read(**parts)
        return str(caught.value)

    return messages


def test_a_beam_has_nodes_that_are_bodies(read):
    model = read()
    (beam,) = model.beams
    assert beam.nodes == tuple(f"Rod.{k}" for k in range(1, 14))  # 4 elements of degree 3
    assert tuple(body.name for body in model.bodies) == beam.nodes
    assert beam.lengths == (0.5,) * 4
    assert sum(body.mass for body in model.bodies) == pytest.approx(7800 * np.pi * 0.02)
    assert [body.position[0] for body in model.bodies] == pytest.approx(beam.stations)
    # d_1 is x, d_2 y, d_3 z
    assert model.bodies[5].orientation == (0.0, 0.0, 0.0)
    EI = 2e11 * np.pi * 1e-4 / 4
    assert beam.compliance[0][4][4] == pytest.approx(1 / EI)
    assert check(model) == []


def test_theory_and_damping(read):
    (beam,) = read(
        attributes=' theory="eulerBernoulli"', more="<dampingTime units='ms'>2</dampingTime>"
    ).beams
    C = np.array(beam.compliance)
    assert not C[:, 1:3].any()
    assert C[:, 0, 0].all()
    assert beam.damping == (0.002, 0.0, 0.0, 0.002, 0.002, 0.002)


PLACES = "".join(
    f"<marker><name>M{k}</name><body{place}>{name}</body></marker>"
    for k, (place, name) in enumerate(
        [
            (' node="first"', "Rod"),
            (' node="last"', "Rod"),
            (' node="5"', "Rod"),
            ("", "Rod.7"),
            ("", "Rod.last"),
            (' station="0.25"', "Rod"),
            (' station="{1/3}"', "Rod"),
        ]
    )
)


def test_places_on_a_beam(read):
    model = read(markers=PLACES)
    assert model.beams[0].lengths == pytest.approx((0.5, 1 / 6, 2 / 3, 2 / 3))
    at = {body.name: body.position[0] for body in model.bodies}
    bodies = [marker.body for marker in model.markers]
    assert bodies[:5] == ["Rod.1", "Rod.13", "Rod.5", "Rod.7", "Rod.13"]
    assert [at[body] for body in bodies[5:]] == pytest.approx([0.5, 2.0 / 3.0])


def test_an_axis_and_a_follower_load_on_a_node(read):
    arc = "<arc><centre><y>2</y></centre><axis><z>1</z></axis><angle units='deg'>90</angle></arc>"
    joint = """<revolute><name>H</name><parent><name>G</name><position><x>2</x><y>2</y></position>
        </parent><child><name node="last">Rod</name><axis><x>1</x></axis></child></revolute>"""
    load = """<concentrated><name>F</name><body node="last">Rod</body>
        <force basis="Rod"><xForce>3</xForce></force></concentrated>"""
    model = read(line=arc, joints=joint, loads=load)
    assert model.loads[0].force_basis == "Rod.13"
    # d_1 at the end of a quarter of a circle is y
    assert np.array(model.joints[0].parent_axes)[2] == pytest.approx([0, 1, 0], abs=ROUND_OFF)
    R = np.array(matrix(model.bodies[-1].orientation))
    assert R[:, 0] == pytest.approx([0, 1, 0], abs=ROUND_OFF)
    assert model.bodies[-1].position == pytest.approx((2, 2, 0), abs=ROUND_OFF)


def test_loads_per_length_and_per_mass(read):
    dead = """<distributed><name>Q</name><body>Rod</body><startStation>0.5</startStation>
        <direction><z>-1</z></direction><startLoad>30</startLoad><endLoad>90</endLoad></distributed>"""
    loads = read(loads=dead).loads
    assert {load.force_basis for load in loads} == {"G"}
    assert [load.name for load in loads] == [f"Q.{k}" for k in range(7, 14)]
    assert sum(load.force[2] for load in loads) == pytest.approx(-60.0)
    follower = dead.replace("<direction>", '<direction basis="Rod">')
    assert all(load.force_basis == load.body for load in read(loads=follower).loads)
    model = read(
        loads="<bodyForce><name>A</name><body>Rod</body><acceleration><a1>2</a1></acceleration>"
        "</bodyForce>",
        groups="<group><name>All of it</name><body>Rod</body></group>",
    )
    mass = sum(body.mass for body in model.bodies)
    assert sum(load.force[0] for load in model.loads) == pytest.approx(2 * mass)
    assert model.groups[0].bodies == model.beams[0].nodes


def test_a_beam_begins_as_a_rigid_body(read):
    start = """<initialConditions><position basis="G"><y>1</y></position>
        <orientation><eulerRotation><phi units="deg">90</phi><u3>1</u3></eulerRotation>
        </orientation>
        <velocity basis="G"><v3>5</v3></velocity>
        <angularVelocity basis="G"><omega1>2</omega1></angularVelocity></initialConditions>"""
    model = read(start=start)
    for body, s in zip(model.bodies, model.beams[0].stations, strict=True):
        assert body.position == pytest.approx((0, 1 + s, 0), abs=ROUND_OFF)
        R = np.array(matrix(body.orientation))
        assert R @ body.velocity == pytest.approx([0, 0, 5 + 2 * s], abs=ROUND_OFF)
        assert R @ body.angular_velocity == pytest.approx([2, 0, 0], abs=ROUND_OFF)


def test_stiffnesses_given_one_by_one_or_as_a_matrix(read):
    mass = "<mass>3</mass><inertia><x>0.2</x></inertia>"
    diagonal = (8e6, 2e6, 3e6, 4e3, 5e3, 6e3)
    tags = ("EA", "GA2", "GA3", "GJ", "EI2", "EI3")
    single = "".join(f"<{t}>{k}</{t}>" for t, k in zip(tags, diagonal, strict=True))
    rows = " ".join(" ".join(map(str, row)) for row in np.diag(diagonal).tolist())
    upper = " ".join(str(np.diag(diagonal)[i, j]) for i, j in zip(*np.triu_indices(6), strict=True))
    found = [
        read(section=f"<stiffnesses>{given}{mass}</stiffnesses>", material="").beams
        for given in (single, f"<matrix>{rows}</matrix>", f"<matrix>{upper}</matrix>")
    ]
    assert found[0] == found[1] == found[2]
    assert np.array(found[0][0].compliance[0]) == pytest.approx(np.diag(1 / np.array(diagonal)))


def test_a_taper_is_linear(read):
    ends = [f"<rectangle><width>0.1</width><height>{h}</height></rectangle>" for h in (0.2, 0.1)]
    model = read(section=ends[0], more=f"<endSection>{ends[1]}</endSection>")
    C = np.array(model.beams[0].compliance)[:, 4, 4]
    s = np.array([0.5 * (1 + x) for x in np.polynomial.legendre.leggauss(3)[0]]) / 4
    height = 0.2 - 0.1 * s
    assert 1 / C[:3] == pytest.approx(2e11 * 0.1 * height**3 / 12)
    assert sum(b.mass for b in model.bodies) == pytest.approx(7800 * 0.1 * 0.15 * 2)


def test_settings_change_numbers_of_a_beam(read):
    model = read(
        settings=["Rod.elements=2", "Rod.degree=5", "Rod.radius=200 mm"],
        mesh="<elements>4</elements><degree>3</degree>",
    )
    assert len(model.bodies) == 11
    assert model.beam_shapes[0].start[0][0] == pytest.approx(0.2)
    model = read(parameters="<parameters><parameter name='n'>6</parameter></parameters>",
                 mesh="<elements>{n/2}</elements><degree>1</degree>")  # fmt: skip
    assert len(model.bodies) == 4


def test_parts_have_prefixes(tmp_path):
    part = re.sub(r"<simulation>.*</simulation>", "", text(markers=PLACES), flags=re.S)
    part = part.replace("data>", "part>").replace("<ground><name>G</name></ground>", "")
    (tmp_path / "rod.xml").write_text(part)
    deck = tmp_path / "deck.xml"
    deck.write_text("""<data><includes><include href="rod.xml" prefix="A."/>
        <include href="rod.xml" prefix="B."/></includes><system/>
        <simulation><deltaT>0.1</deltaT><tFinal>1</tFinal></simulation></data>""")
    model = read_deck(deck)
    assert [beam.name for beam in model.beams] == ["A.Rod", "B.Rod"]
    assert [marker.body for marker in model.markers[:5]] == [
        "A.Rod.1", "A.Rod.13", "A.Rod.5", "A.Rod.7", "A.Rod.13"]  # fmt: skip


def test_reading_leaves_the_deck_as_it_is(tmp_path):
    source = Source.of(text(markers=PLACES.replace("{1/3}", "0.3")))
    deck = ParsedDeck(source)
    before = deck.digest()
    assert deck.model() == deck.model() == source.model()
    assert deck.digest() == before
    assert source.text({}) == source.data
    written = source.text({}, ["Rod.elements=5"])
    assert b'node="first"' in written
    assert Source.of(written).model() == source.model(["Rod.elements=5"])


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"mesh": "<elements>2.5</elements>"}, r"Rod', elements: it is 2.5; give an integer"),
        ({"mesh": "<degree>9</degree>"}, "degree: it is 9; give an integer from 1 to 8"),
        ({"material": ""}, "<material> is missing"),
        (
            {"material": MATERIAL.replace(">0.3<", ">0.7<")},
            "Poisson's ratio is 0.7; it must be above -1, and at most 0.5",
        ),
        (
            {"markers": '<marker><name>M</name><body node="0">Rod</body></marker>'},
            "node='0' is no node; give first, last or a number from 1",
        ),
        (
            {"line": "<spline><point/></spline>"},
            "too few <point> in <spline>: 1; give 2 or more",
        ),
        (
            {
                "loads": "<distributed><name>F</name><body>Rod</body><endStation>1.2</endStation>"
                "<direction><x>1</x></direction><startLoad>1</startLoad></distributed>"
            },
            "endStation: '1.2' is not a number from 0 to 1",
        ),
        (
            {"material": MATERIAL.replace("<poissonsRatio>0.3</poissonsRatio>", "")},
            "neither <poissonsRatio> nor <shearModulus>",
        ),
        ({"section": "<circle><radius>0</radius></circle>"}, "a size is not greater than zero"),
        (
            {"section": "<tube><radius>1</radius><thickness>2</thickness></tube>"},
            "thickness: the wall is thicker",
        ),
        ({"line": "<straight><end/></straight>"}, "<start> and <end> are one point"),
        ({"more": "<reference><x>1</x></reference>"}, "reference: the reference is parallel"),
        (
            {"markers": "<marker><name>M</name><body>Rod</body></marker>"},
            r"'Rod' is a beam; say where on it: node=\"first\"",
        ),
        (
            {"markers": '<marker><name>M</name><body node="99">Rod</body></marker>'},
            "beam 'Rod' has no node 99; its nodes are 1 to 13",
        ),
        (
            {"markers": '<marker><name>M</name><body node="1">G</body></marker>'},
            "'G' is no beam and has no nodes; delete node",
        ),
        (
            {"markers": '<marker><name>M</name><body node="2" station="0.5">Rod</body></marker>'},
            "the place on the beam is given twice",
        ),
        (
            {"markers": "<marker><name>Rod.3</name><body>G</body></marker>"},
            "the name is that of a node of the beam 'Rod'",
        ),
        (
            {
                "loads": "<concentrated><name>F</name><body node='1'>Rod</body>"
                "<force basis='Rod.2'/><moment basis='Ro'/></concentrated>"
            },
            "basis 'Ro' is not a body",
        ),
        (
            {
                "section": STIFF.format("<EA>1</EA>"),
                "material": "",
            },
            "theory timoshenko needs <GA2>, <GA3>, <GJ>, <EI2>, <EI3> greater than zero",
        ),
        (
            {
                "section": STIFF.format("<matrix>1 2 3</matrix>"),
                "material": "",
            },
            "it has 3 numbers; give 36",
        ),
        (
            {
                "loads": "<distributed><name>F</name><body>Rod</body><start><x>1</x></start>"
                "<direction><x>1</x></direction><startLoad>1</startLoad></distributed>"
            },
            "start: 'Rod' is a beam; give <startStation>",
        ),
        (
            {"section": "<circle><radius>1e-90</radius></circle>"},
            "too small to compute with|is not a finite number|impossible",
        ),
    ],
)
def test_faults_have_place_and_remedy(faults, parts, message):
    found = faults(**parts)
    assert re.search(message, found), found
    assert re.search(r"deck\.xml:\d+: ", found)
    assert found.count("\n") == 0, found


@pytest.mark.parametrize("path", sorted(ELASTIC.glob("*.xml")), ids=lambda path: path.stem)
def test_decks_of_beams_are_sound(path):
    model = read_deck(path, thorough=True)
    assert model.beams or model.elastic_bodies
    assert check(model) == []


def test_a_beam_may_begin_deformed(read, faults):
    plain = read()
    rows = [
        (*b.position[:2], 0.01 * k, *b.orientation, 1.0, 2.0, 3.0, 0.1 * k, 0.0, 0.0)
        for k, b in enumerate(plain.bodies)
    ]
    numbers = " ".join(str(number) for row in rows for number in row)
    model = read(more=f"<nodes>{numbers}</nodes>")
    assert model.beams == plain.beams  # the unstressed beam is the same
    assert [body.position[2] for body in model.bodies] == [row[2] for row in rows]
    assert model.bodies[3].velocity == (1.0, 2.0, 3.0)
    assert model.bodies[3].angular_velocity == pytest.approx((0.3, 0.0, 0.0))
    assert "13 nodes need 12 each" in faults(more="<nodes>1 2 3</nodes>")
