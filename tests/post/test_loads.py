"""Loads of bodies for finite elements: in balance, at joints those of reactions.csv, as cards."""

import csv
import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

import msahl
from msahl.algebra.rotation_arrays import rotations
from msahl.cli import export
from msahl.cli.main import main
from msahl.post.loads.body_cards import FIRST_NODE
from msahl.post.loads.export import FORMATS, instants_of, texts
from msahl.post.loads.wrenches import INERTIA, REACTION, left_over
from msahl.results.info import ResultError
from msahl.results.read import read_run
from tests.support.models import ROOT

ROUND_OFF = 1e-12
"""Of sums of a few loads, relative to the largest; 1e-15 was seen."""
DIGITS = 1e-8
"""Of loads in ten digits, whose moments have arms up to a metre; 1e-10 was seen."""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """An arm with dampers, a gear between slides and products of inertia, in free fall."""
    start = {"pose": {"elbow": 0.5, "left": 0.01}, "rates": {"shoulder": 2.0, "elbow": -3.0}}
    model, _ = msahl.import_file(ROOT / "examples" / "arm.urdf", contacts="none", **start)
    folder = tmp_path_factory.mktemp("arm") / "run"
    model.run(scheme="gauss5", dt=5e-3, t_final=0.05, error="off").write(folder)
    return read_run(folder)


@pytest.fixture(scope="module")
def arm_instants(arm):
    return instants_of(arm, everything=True)


def test_the_loads_of_every_body_are_in_balance(arm, arm_instants):
    for instant in arm_instants:
        for body in arm.model.bodies:
            own = [load for load in instant.loads if load.body == body.name]
            largest = max(np.abs([load.force, load.moment]).max() for load in own)
            left = left_over(instant.loads, body.name, np.array(body.r_BG))
            assert max(left) <= ROUND_OFF * largest


def test_reactions_are_those_of_the_run_on_both_bodies(arm, arm_instants):
    row = 3
    for joint in arm.model.joints:
        table = arm.reactions.iloc[row]
        F = np.array([table[f"{joint.name}.F{c}"] for c in "xyz"])
        M = np.array([table[f"{joint.name}.M{c}"] for c in "xyz"])
        for load in arm_instants[row].loads:
            if (load.element, load.kind) != (joint.name, REACTION):
                continue
            sign = 1.0 if load.body == joint.child else -1.0
            P = arm.states.iloc[row][[f"{load.body}.P{k}" for k in (1, 2, 3)]].to_numpy(float)
            R = rotations(P)
            # Those of the run are not refined: the shaft of 1e-10 kg between the slides leaves
            # 1e-10 of the largest acceleration; 2e-9 was seen.
            assert R @ load.force == pytest.approx(sign * F, abs=1e-8)
            assert R @ load.moment == pytest.approx(sign * M, abs=1e-8)
    named = {load.element for load in arm_instants[row].loads if load.kind == REACTION}
    assert {joint.name for joint in arm.model.joints} <= named


WHEEL = """<mujoco><option gravity="0 0 0"/><worldbody><body name="arm">
  <inertial pos="0.5 0 0" mass="2" diaginertia="0.1 0.1 0.1"/><joint name="hinge"/>
</body></worldbody></mujoco>"""


def test_a_rotating_body_is_held_by_the_centripetal_force(tmp_path):
    (tmp_path / "wheel.xml").write_text(WHEEL)
    model, _ = msahl.import_file(tmp_path / "wheel.xml", rates={"hinge": 3.0})
    model.run(scheme="gauss3", dt=0.01, t_final=0.1, error="off").write(tmp_path / "run")
    (instant,) = instants_of(read_run(tmp_path / "run"), [0.05])
    assert instant.time == pytest.approx(0.05)
    forces = {load.kind: load.force for load in instant.loads}
    assert forces[REACTION] == pytest.approx([-2.0 * 9.0 * 0.5, 0.0, 0.0], abs=1e-12)
    assert forces[INERTIA] == pytest.approx([9.0, 0.0, 0.0], abs=1e-12)
    assert instant.motions["arm"].spin == pytest.approx([0.0, 0.0, 3.0])


MOI = "<moi><Ixx>1</Ixx><Iyy>1</Iyy><Izz>1</Izz></moi>"
DRUM = f"""<data><unitSystem>SI</unitSystem><system>
  <bodies><ground><name>Floor</name></ground>
    <rigidBody><name>Tub</name><mass>3</mass>{MOI}</rigidBody>
    <rigidBody><name>Drum</name><mass>2</mass>{MOI}</rigidBody></bodies>
  <joints><revolute><name>Bearing</name>
    <parent><name>Tub</name><axis><z>1</z></axis></parent>
    <child><name>Drum</name></child></revolute></joints>
  <loads>
    <springDamper><name>Spring</name>
      <parent><name>Floor</name><position><x>2</x><y>1</y></position></parent>
      <child><name>Tub</name><position><x>2</x></position></child>
      <stiffness>50</stiffness><damping>0</damping><freeLength>0.5</freeLength></springDamper>
    <actuator><name>Motor</name><joint>Bearing</joint><coordinate>angle</coordinate>
      <expression>5</expression></actuator>
  </loads></system>
  <simulation><deltaT>0.01</deltaT><tFinal>0.1</tFinal></simulation></data>"""


def test_a_torque_acts_equally_on_both_bodies_whatever_else_acts_on_one(tmp_path):
    """The length by which equations are scaled is that of the spring's arm on one body alone."""
    msahl.load(DRUM.encode()).run(scheme="gauss3", error="off").write(tmp_path / "run")
    (instant,) = instants_of(read_run(tmp_path / "run"), [0.1])
    moments = {load.body: load.moment for load in instant.loads if load.element == "Motor"}
    assert moments["Drum"] == pytest.approx([0.0, 0.0, 5.0], abs=1e-14)  # round-off
    assert moments["Tub"] == pytest.approx([0.0, 0.0, -5.0], abs=1e-14)


def points(body):
    """Six equal masses with the mass, mass centre and inertia of a body: (6, 3) [m]."""
    second = 0.5 * np.trace(body.inertia) * np.eye(3) - np.array(body.inertia)
    s, axes = np.linalg.eigh(second)
    d = np.sqrt(3.0 * s / body.mass)
    return np.array(body.r_BG) + np.concatenate([axes.T * d[:, None], -axes.T * d[:, None]])


def total(body, loads, field):
    """Sum of forces and moments about B: of (point, force, moment), and of an acceleration field
    at the masses of the body."""
    r = points(body)
    f = body.mass / 6.0 * np.array([field(p) for p in r])
    forces = np.array([F for _, F, _ in loads])
    moments = [M + np.cross(p, F) for p, F, M in loads]
    return np.abs([f.sum(0) + forces.sum(0), np.cross(r, f).sum(0) + np.sum(moments, 0)]).max()


def read_nastran(text):
    """Cards with their fields, by the columns of large fields."""
    cards = []
    for line in text.splitlines():
        if line.startswith("$"):
            continue
        fields = [line.ljust(72)[k : k + 16].strip() for k in range(8, 72, 16)]
        if line[0] == "*":
            cards[-1][1].extend(fields)
        else:
            cards.append((line[:8].strip().rstrip("*"), fields))
    return cards


def test_cards_of_nastran_are_in_balance_on_the_masses_of_the_body(arm, arm_instants):
    files = texts(arm, arm_instants[3:4], ["nastran"])
    for k, body in enumerate(arm.model.bodies, start=1):
        (text,) = (t for name, t in files.items() if name.startswith(f"{k}_"))
        cards = read_nastran(text)
        grid = {f[0]: np.array(f[2:5], float) for name, f in cards if name == "GRID"}
        (sets,) = (f[2:] for name, f in cards if name == "LOAD")
        loads, fields = [], []
        for name, f in cards:
            if name in ("FORCE", "MOMENT"):
                vector = float(f[3]) * np.array(f[4:7], float)
                pair = (vector, np.zeros(3)) if name == "FORCE" else (np.zeros(3), vector)
                loads.append((grid[f[1]], *pair))
            elif name == "GRAV":
                g = float(f[2]) * np.array(f[3:6], float)
                fields.append(lambda p, g=g: g)
            elif name == "RFORCE":
                axis, c = np.array(f[4:7], float), grid[f[1]]
                w = math.tau * float(f[3]) * axis
                alpha = math.tau * float(f[8]) * axis
                fields.append(
                    lambda p, w=w, c=c: -np.cross(w, np.cross(w, p - c))  # outwards
                )
                fields.append(lambda p, a=alpha, c=c: np.cross(a, p - c))
            if name not in ("GRID", "LOAD"):
                assert f[0] in sets[1::2]
        largest = max(np.abs(vector).max() for _, *pair in loads for vector in pair)
        left = total(body, loads, lambda p: sum(field(p) for field in fields))  # noqa: B023
        assert left < DIGITS * largest


def test_cards_of_abaqus_are_in_balance_on_the_masses_of_the_body(arm, arm_instants):
    files = texts(arm, arm_instants[3:4], ["abaqus"])
    for k, body in enumerate(arm.model.bodies, start=1):
        (text,) = (t for name, t in files.items() if name.startswith(f"{k}_"))
        block, nodes, loads, fields = "", {}, [], []
        for line in text.splitlines():
            if line.startswith("*"):
                block = line.partition(",")[0] if not line.startswith("**") else block
                continue
            words = line.split(", ")
            if block == "*NODE":
                nodes[words[0]] = np.array(words[1:], float)
            elif block == "*CLOAD":
                components = np.zeros(6)
                components[int(words[1]) - 1] = float(words[2])
                loads.append((nodes[words[0]], components[:3], components[3:]))
            elif words[1] == "GRAV":
                g = float(words[2]) * np.array(words[3:], float)
                fields.append(lambda p, g=g: g)
            else:
                c, axis = np.array(words[3:], float).reshape(2, 3)
                w = math.sqrt(float(words[2])) * axis
                fields.append(lambda p, w=w, c=c: -np.cross(w, np.cross(w, p - c)))
        assert nodes[str(FIRST_NODE)] == pytest.approx(body.r_BG)
        largest = max(np.abs(vector).max() for _, *pair in loads for vector in pair)
        left = total(body, loads, lambda p: sum(field(p) for field in fields))  # noqa: B023
        assert left < DIGITS * largest


def test_the_command_writes_tables_and_cards(arm, tmp_path):
    words = ["export", "loads", str(arm.folder), "-o", str(tmp_path / "out"), "--at", "0.02"]
    result = CliRunner().invoke(main, [*words, "--cards", "nastran", "--cards", "abaqus"])
    assert result.exit_code == 0, result.output
    assert "loads at 0.02 s" in result.stderr
    with (tmp_path / "out" / "loads.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert {row["kind"] for row in rows} == {"reaction", "load", "gravity", "inertia"}
    assert {row["time [s]"] for row in rows} == {"0.02"}
    assert len(list((tmp_path / "out").glob("*.bdf"))) == len(arm.model.bodies)
    assert tuple(FORMATS) == export.FORMATS


def test_extreme_instants_are_those_of_the_largest_reactions(arm):
    instants = instants_of(arm)
    columns = [f"elbow.F{c}" for c in "xyz"]
    row = np.linalg.norm(arm.reactions[columns].to_numpy(), axis=1).argmax()
    assert arm.time[row] in [instant.time for instant in instants]
    assert len(instants) < len(arm.time)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--at", "7"], "the run has no output time near 7 s: it is from 0 to 0.05 s"),
        (["--at", "0.01", "--all"], "--at and --all exclude each other"),
    ],
)
def test_faults_of_the_command_are_messages(arm, words, message):
    result = CliRunner().invoke(main, ["export", "loads", str(arm.folder), *words])
    assert result.exit_code == 2
    assert message in result.stderr
    result = CliRunner().invoke(main, ["export", "loads", "nowhere"])
    assert result.exit_code == 2
    assert "Traceback" not in result.output


def test_models_with_contacts_are_refused(arm):
    records = msahl.load(ROOT / "decks" / "contact" / "buffers.xml").records
    with pytest.raises(ResultError, match="without contacts; this one has some"):
        instants_of(replace(arm, model=records))
