"""Decks become the model they describe: values, units, axes; and nothing but the deck is opened."""

import dataclasses
import math
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lxml import etree

from msahl.algebra.rotation import from_axis_angle, matrix
from msahl.algebra.vector import ZERO, transpose
from msahl.deck import deck_digest, read_deck
from msahl.deck.schema import schema_bytes
from msahl.deck.units import DEFAULTS, UNITS, to_si
from msahl.model import ConcentratedLoad, Ground, Joint, Model, RigidBody, Simulation
from tests.support.effective import effective_deck

ROOT = Path(__file__).parents[2]
DECKS = sorted(ROOT.glob("decks/*/*.xml"))
ROUND_OFF = 4 * sys.float_info.epsilon  # a few operations on numbers of order one
XSI = "http://www.w3.org/2001/XMLSchema-instance"


def build_model(
    bodies: str = "", rest: str = "", simulation: str = "", root: str = "<data>"
) -> str:
    return f"""{root}<system><bodies><ground><name>Earth</name></ground>
      <rigidBody><name>A</name><mass>2</mass>
      <moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>
      <initialConditions><orientation><eulerRotation><phi units="deg">90</phi><u3>1</u3>
      </eulerRotation></orientation></initialConditions></rigidBody>{bodies}</bodies>{rest}</system>
      <simulation>{simulation or "<deltaT>0.1</deltaT><tFinal>1</tFinal>"}</simulation></data>"""


def body(inner: str, name: str = "B", mass: str = "3") -> str:
    return f"<rigidBody><name>{name}</name><mass>{mass}</mass>{inner}</rigidBody>"


MOI = "<moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>"


@pytest.fixture
def read(tmp_path):
    def read_text(text: str) -> Model:
        path = tmp_path / "deck.xml"
        path.write_text(text)
        return read_deck(path)

    return read_text


@pytest.mark.parametrize("path", DECKS, ids=lambda path: path.stem)
def test_every_deck_reads_and_says_what_to_expect(path):
    assert read_deck(path).bodies
    assert re.search(r"<!--.*Expect.*-->", path.read_text(), re.DOTALL)


def test_a_deck_becomes_its_model():
    phi = math.pi / 4
    assert read_deck(ROOT / "decks/thesis/single_pendulum_45.xml") == Model(
        gravity=(0.0, 0.0, 9.80665),
        grounds=(Ground("Base"),),
        bodies=(
            RigidBody(
                name="PendulumBob",
                mass=2.0,
                r_BG=ZERO,
                inertia=((0.008, 0.0, 0.0), (0.0, 0.008, 0.0), (0.0, 0.0, 0.008)),
                position=tuple(
                    5.0 * row[2] for row in matrix(from_axis_angle((0.0, 1.0, 0.0), phi))
                ),
                orientation=(0.0, 4 * math.tan(phi / 4), 0.0),
                velocity=ZERO,
                angular_velocity=ZERO,
            ),
        ),
        joints=(
            Joint(
                name="Pivot",
                kind="spherical",
                parent="Base",
                child="PendulumBob",
                parent_point=ZERO,
                child_point=(0.0, 0.0, -5.0),
                # The frame is the inertial axes, at 45 degrees about y to the bob's.
                child_axes=transpose(matrix(from_axis_angle((0.0, 1.0, 0.0), -phi))),
            ),
        ),
        loads=(),
        simulation=Simulation("SphericalPendulum", 0.002, 10.0),
        unit_system="SI",
    )


def test_the_thesis_decks_have_their_bodies_and_joints():
    triple = read_deck(ROOT / "decks/thesis/triple_pendulum_89.xml")
    assert [b.name for b in triple.bodies] == ["PendulumBob", "2ndBall", "3rdBall"]
    assert [(j.parent, j.child) for j in triple.joints] == [
        ("Base", "PendulumBob"),
        ("PendulumBob", "2ndBall"),
        ("2ndBall", "3rdBall"),
    ]
    (top,) = read_deck(ROOT / "decks/thesis/top_1.xml").bodies
    assert top.angular_velocity == (0.0, 0.9888, 7.5167)
    assert (top.inertia[0][0], top.inertia[2][2]) == (0.4, 0.75)


def test_loads_keep_the_axes_they_are_given_in():
    pull, thruster, spin = read_deck(ROOT / "decks/basics/loads.xml").loads
    assert pull == ConcentratedLoad("Pull", "Probe", ZERO, (1.0, 0.0, 0.5), "Space", ZERO, "Space")
    assert (thruster.point, thruster.force_basis) == ((0.0, 0.0, -0.3), "Probe")
    assert (spin.moment, spin.moment_basis) == ((0.0, 0.0, 0.1), "Probe")


def test_numbers_in_their_own_axes_pass_bit_for_bit(read):
    numbers = (0.1, 0.2, 0.3)
    v, w, p = (
        "".join(f"<{tag}>{x}</{tag}>" for tag, x in zip(tags.split(), numbers, strict=True))
        for tags in ("v1 v2 v3", "omega1 omega2 omega3", "x y z")
    )
    start = (
        "<orientation><eulerRotation><phi>1</phi><u1>1</u1><u2>2</u2></eulerRotation></orientation>"
        f"<position basis='Earth'>{p}</position><velocity>{v}</velocity>"
        f"<angularVelocity basis='B'>{w}</angularVelocity>"
    )
    b = read(build_model(body(f"{MOI}<initialConditions>{start}</initialConditions>"))).bodies[1]
    assert b.position == b.velocity == b.angular_velocity == numbers


def test_a_basis_may_be_any_body_even_a_later_one(read):
    start = "<position basis='{0}'><x>1</x></position><velocity basis='{0}'><v2>2</v2></velocity>"
    first = body(f"{MOI}<initialConditions>{start.format('C')}</initialConditions>")
    rotated = "<orientation><eulerRotation><phi units='deg'>90</phi><u1>1</u1></eulerRotation>"
    later = body(
        f"{MOI}<initialConditions>{rotated}</orientation>{start.format('A')}</initialConditions>",
        "C",
    )
    _, b, c = read(build_model(first + later)).bodies
    # C is rotated by 90 deg about x: its y axis is the inertial z axis; B is not rotated.
    assert b.position == (1.0, 0.0, 0.0)
    assert b.velocity == pytest.approx((0.0, 0.0, 2.0), abs=ROUND_OFF)
    # A is rotated by 90 deg about z: its x axis is the inertial y, its y axis the inertial -x.
    assert c.position == pytest.approx((0.0, 1.0, 0.0), abs=ROUND_OFF)
    assert c.velocity == pytest.approx((-2.0, 0.0, 0.0), abs=ROUND_OFF)


def test_joint_points_are_rotated_into_their_bodies_axes(read):
    ends = (
        "<parent><name>Earth</name><position basis='A'><x>1</x></position></parent>"
        "<child><name>A</name><position basis='Earth'><y>1</y></position></child>"
    )
    joint = f"<joints><spherical><name>J</name>{ends}</spherical></joints>"
    (j,) = read(build_model(rest=joint)).joints
    assert j.parent_point == pytest.approx((0.0, 1.0, 0.0), abs=ROUND_OFF)
    assert j.child_point == pytest.approx((1.0, 0.0, 0.0), abs=ROUND_OFF)


def test_inertia_about_b_is_moved_to_the_mass_centre():
    (slab,) = read_deck(ROOT / "decks/basics/offset_body.xml").bodies
    expected = [[0.215, 0.02, 0.03], [0.02, 0.25, -0.015], [0.03, -0.015, 0.175]]
    assert np.array(slab.inertia) == pytest.approx(np.array(expected), abs=ROUND_OFF)


@pytest.mark.parametrize("moments", [(1, 1, 2), (0.3, 0.1, 0.2), (1, 1e-9, 1)])
def test_flat_and_thin_bodies_are_possible_however_they_are_rotated(read, moments):
    R = np.array(matrix((0.4, -1.1, 2.0)))
    J = R @ np.diag(moments) @ R.T
    entries = {"xx": (0, 0), "yy": (1, 1), "zz": (2, 2), "xy": (0, 1), "xz": (0, 2), "yz": (1, 2)}
    moi = "".join(f"<I{tag}>{float(J[at])!r}</I{tag}>" for tag, at in entries.items())
    assert read(build_model(body(f"<moi>{moi}</moi>"))).bodies[1].inertia[1][2] == J[1, 2]


def test_what_is_omitted_is_zero(read):
    model = read(build_model(body(MOI)))
    b = model.bodies[1]
    assert b.r_BG == b.position == b.orientation == b.velocity == b.angular_velocity == ZERO
    assert model.gravity == ZERO
    assert (model.joints, model.loads, model.simulation.title) == ((), (), "")


def test_white_space_and_comments_do_not_count(read):
    text = "<name>\n  Two <!-- or more --> words </name><mass>\n 3<!-- kg --> </mass>"
    model = read(build_model(f"<rigidBody>{text}{MOI}</rigidBody>"))
    assert (model.bodies[1].name, model.bodies[1].mass) == ("Two words", 3.0)


def test_the_schema_and_the_table_list_the_same_units():
    ns = {"xs": "http://www.w3.org/2001/XMLSchema"}
    schema = etree.fromstring(schema_bytes())
    for quantity, factors in UNITS.items():
        path = f"xs:simpleType[@name='{quantity}Units']//xs:enumeration/@value"
        assert schema.xpath(path, namespaces=ns) == list(factors)
    assert all(DEFAULTS[s].keys() == UNITS.keys() for s in DEFAULTS)
    assert all(DEFAULTS[s][q] in UNITS[q] for s in DEFAULTS for q in UNITS)
    assert all(UNITS[q][unit] == 1 for q, unit in DEFAULTS["SI"].items())


@pytest.mark.parametrize(
    ("value", "unit", "quantity", "si"),
    [
        (9.0, "mm", "length", 0.009),
        (12.0, "in", "length", 0.3048),
        (45.0, "deg", "angle", math.pi / 4),
        (60.0, "rpm", "angularVelocity", 2 * math.pi),
        (1.0, "lbf", "force", 4.4482216152605),
        (1.0, "slug", "mass", 14.593902937206364),  # NIST SP 811: 1.459390 E+01
        (1.0, "slug-ft^2", "inertia", 1.3558179483314004),  # SP 811: 1.355818
        (1.0, "lbf-in", "moment", 0.1129848290276167),  # SP 811: 1.129848 E-01
        (1.0, "lbm-in^2", "inertia", 2.926396534292e-4),  # SP 811: 2.926397 E-04
        (1.5, "min", "time", 90.0),
        (1.0, "ft/s^2", "acceleration", 0.3048),
    ],
)
def test_units_convert_exactly(value, unit, quantity, si):
    # The reference is a decimal of 13 digits or more, or one rounding of an exact number.
    assert to_si(value, unit, quantity) == pytest.approx(si, rel=1e-13)


def test_the_us_deck_is_the_si_deck():
    us = read_deck(ROOT / "decks/basics/us_units.xml")
    si = read_deck(ROOT / "decks/thesis/single_pendulum_45.xml")
    assert us.unit_system == "US"
    for a, b in ((us.bodies[0], si.bodies[0]), (us.joints[0], si.joints[0])):
        for x, y in zip(dataclasses.astuple(a), dataclasses.astuple(b), strict=True):
            if isinstance(x, str) or x is None:
                assert x == y
            else:  # the deck's numbers are doubles of the quotients: two roundings each
                assert np.array(x) == pytest.approx(np.array(y), rel=ROUND_OFF)
    assert us.gravity == pytest.approx(si.gravity, rel=ROUND_OFF)


def test_times_have_units_too(read):
    times = "<deltaT units='ms'>5</deltaT><tFinal units='min'>0.5</tFinal>"
    assert read(build_model(simulation=times)).simulation == Simulation("", 0.005, 30.0)


@pytest.mark.parametrize("hint", ["noNamespaceSchemaLocation", "schemaLocation"])
def test_a_schema_that_the_deck_names_is_never_opened(read, tmp_path, monkeypatch, hint):
    pipe = tmp_path / "other.xsd"
    os.mkfifo(pipe)  # whoever opens it to read waits for ever
    monkeypatch.setattr("socket.socket", None)
    value = str(pipe) if hint.startswith("no") else f"urn:other {pipe}"
    for location in (value, value.replace(str(pipe), "http://localhost:9/other.xsd")):
        root = f"<data xmlns:xsi='{XSI}' xsi:{hint}='{location}'>"
        assert read(build_model(root=root)).bodies


def test_reading_a_good_deck_loads_no_heavy_package():
    code = (
        "import sys; from msahl.deck import read_deck; read_deck(sys.argv[1]);"
        "print(*{'numba', 'scipy', 'pandas', 'matplotlib', 'xmlschema'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", code, str(DECKS[0])]
    env = {**os.environ, "PYTHONPATH": str(ROOT)}
    assert (
        subprocess.run(command, capture_output=True, text=True, check=True, env=env).stdout == "\n"
    )


def test_the_deck_as_it_ran(tmp_path):
    path = ROOT / "decks/thesis/top_2.xml"
    same = effective_deck(path)
    assert same == path.read_bytes()
    copy = tmp_path / "deck.xml"
    copy.write_bytes(effective_deck(path, {"deltaT": 0.1, "tFinal": 1 / 3}))
    before, after = read_deck(path), read_deck(copy)
    assert after.simulation == Simulation(before.simulation.title, 0.1, 1 / 3)
    assert dataclasses.replace(after, simulation=before.simulation) == before
    assert b"Heavy top" in copy.read_bytes()
    assert deck_digest(b"") == "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"
