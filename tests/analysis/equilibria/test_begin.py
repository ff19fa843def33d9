"""Models that begin at another configuration, and runs that start at an equilibrium."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from msahl.analysis.equilibria.begin import model_at, model_there
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.search import displaced, find
from msahl.analysis.equilibria.stability import stability
from msahl.analysis.equilibria.tables import state_row
from msahl.analysis.linearised.point import Point, complete
from msahl.analysis.modes.solution import modes
from msahl.deck import Source
from msahl.deck.write_model import write_deck
from msahl.model import ConcentratedLoad
from msahl.model.settings import OFF
from msahl.model.signals import TIME, reached, tree_of
from msahl.run.joint_table import JointTable
from tests.support.models import DECKS, simulate

REST = np.zeros(3)
VARIED = (
    *("quarter_car", "robot", "satellite", "suspension", "bushing", "bushing_loop", "us_units"),
    *("torsional_spring", "slide_spring", "spring_table", "cam_follower", "cam_valve", "gear"),
    *("parallel_cylinders", "point_slider", "edge_slider", "knife_edge", "rolling_disk", "planar"),
    *("point_on_line", "crossed_cylinders", "universal", "screw", "bricard", "actuator_pid"),
)
"""Decks that have every kind of element which counts from t = 0, and quick ones of others."""
RUN = ("us_units", "torsional_spring", "bushing_loop", "bricard", "actuator_pid", "satellite")
"""Decks whose runs are quick."""
LARGEST = 40
"""Bodies of the decks that are tried; larger ones have the same elements."""


def decks(quick):
    """All decks without contacts, of which those that are not ``quick`` are slow tests."""
    known = [path for path in DECKS if path.parent.name != "contact"]
    marks = {path: () if path.stem in quick else pytest.mark.slow for path in known}
    return [pytest.param(path, id=path.stem, marks=marks[path]) for path in known]


def read(path, text=None):
    """The model of a deck where a search begins."""
    source = Source(path, text) if text else Source.of_file(path)
    return search_start(source.model(()))


def at_rest(point: Point) -> Point:
    """The point with no velocity, and the accelerations there."""
    own = ("v", "w", "a", "alpha", "force", "reaction")
    state = point.state._replace(**{k: np.zeros_like(getattr(point.state, k)) for k in own})
    return complete(point.model, point.system, state, point.unknowns)


def coordinates(point):
    """Values of the coordinates of joints."""
    if not any(joint for joint in point.model.joints):
        return np.zeros(0)
    row = np.concatenate([[0.0], state_row(point)])
    return JointTable(point.model, 1).rows({"states": row[None]})[0]


def require_same(path, start, there):
    """The model that begins at a point is the same: the same accelerations there, and the same
    coordinates of joints, but for full revolutions. A deck says so to the last digit.
    """
    moved = model_there(start, there)
    assert Source(path, write_deck(moved)).model(()) == moved
    again = at_rest(search_start(moved))
    size = max(np.abs(there.state.x).max(), 1.0)
    assert again.state.x == pytest.approx(there.state.x, abs=1e-11 * size)
    for one, other in ((there.state.a, again.state.a), (there.state.alpha, again.state.alpha)):
        # Closed to round-off times stiffness over mass, which is large in the extreme decks.
        assert other == pytest.approx(one, rel=1e-8, abs=1e-8 * max(np.abs(one).max(), 1.0))
    revolution = 2.0 * np.pi
    change = coordinates(again) - coordinates(there)
    assert np.abs(change - revolution * np.round(change / revolution)).max(initial=0.0) <= 1e-9


@pytest.mark.parametrize("path", decks(VARIED))
def test_a_deck_written_elsewhere_is_the_same_model(path):
    start = read(path)
    if len(start.model.bodies) > LARGEST:
        pytest.skip("more bodies")
    there = at_rest(displaced(start, REST, np.random.default_rng(1)))
    require_same(path, start, there)


@pytest.mark.slow
def test_vectors_in_axes_of_other_bodies_keep_their_meaning():
    path = Path("hostile.xml")
    start = read(path, HOSTILE)
    for seed in range(3):
        there = at_rest(displaced(start, REST, np.random.default_rng(seed)))
        assert np.abs(there.state.x - start.state.x).max() > 0.1
        require_same(path, start, there)


@pytest.mark.slow
@pytest.mark.parametrize("path", decks(RUN))
def test_a_run_from_an_equilibrium_stays(path):
    """Of decks whose equilibrium is stable and which nothing moves but forces of the motion."""
    start = read(path)
    laws = [load.law for load in start.model.loads if isinstance(load, ConcentratedLoad)]
    trees = [tree for signal in start.model.signals if (tree := tree_of(signal))]
    trees += [tree for load in start.model.loads if (tree := getattr(load, "expression", None))]
    changing = any(laws) or start.model.motions or TIME in reached(trees, {})
    changing = changing or any(event.states or event.impulses for event in start.model.events)
    if len(start.model.bodies) > LARGEST or changing:
        pytest.skip("more bodies, or laws of time")
    solution = find(start, REST)
    if solution is None or not stability(solution.place.point).startswith("stable"):
        pytest.skip("no stable equilibrium")
    model = model_at(start, solution)
    dt = max(model.simulation.dt, 1e-3)
    x = simulate(model, dt=dt, t_final=1.0, scheme="preserving", error=OFF).states[:, 1:]
    size = max(np.abs(solution.place.point.state.x).max(), 1.0)
    # Residuals of 1e-9 of the forces displace soft models by about as much.
    moved = (x[-1] - x[0]).reshape(-1, 12)[:, :6]
    assert np.abs(moved).max() <= 1e-7 * size


def test_an_unstable_equilibrium_is_left_at_its_rate():
    """Without lateral stiffness of its tyres, springs under pressure, the car rotates about z."""
    (path,) = (path for path in DECKS if path.stem == "suspension")
    start = read(path)
    solution = find(start, REST)
    found = modes(solution.place.point)
    k = int(np.argmax(found.value.real))
    rate = float(found.value[k].real)
    assert rate == pytest.approx(8.89878, rel=1e-5)
    model = model_at(start, solution)
    velocity = 1e-8 * rate * found.shape[k].real
    bodies = tuple(
        replace(body, velocity=tuple(v[:3].tolist()), angular_velocity=tuple(v[3:].tolist()))
        for body, v in zip(model.bodies, velocity, strict=True)
    )
    run = simulate(replace(model, bodies=bodies), dt=0.01, t_final=1.2, scheme="gauss3", error=OFF)
    yaw = np.abs(run.of("orientation", 0)[:, 2])
    # From 0.8 s on exp(-rate t) is 7e-7 of exp(rate t).
    assert np.log(yaw[120] / yaw[80]) / 0.4 == pytest.approx(rate, rel=1e-6)


def test_a_steady_rotation_is_written_with_its_velocities():
    """The governor at 8 rad/s: its balls and its speed stay where they are."""
    (path,) = (path for path in DECKS if path.stem == "flyball_governor")
    start = read(path)
    solution = find(start, np.array([0.0, 0.0, 8.0]))
    # The rotation itself has no stiffness.
    text = "stable, all motions but those without stiffness are damped"
    assert stability(solution.place.point) == text
    model = model_at(start, solution)
    run = simulate(model, dt=0.01, t_final=1.0, scheme="gauss3", error=OFF)
    for ball in (1, 2):
        heights, spin = run.of("position", ball)[:, 2], run.of("spin", ball)
        # Balanced to 1e-9 of forces of 1 kN.
        assert np.ptp(heights) <= 1e-8
        assert np.linalg.norm(spin, axis=1) == pytest.approx(8.0, abs=1e-7)


HOSTILE = b"""<data>
<unitSystem>US</unitSystem>
<parameters><parameter name="k" units="lbf/ft">30</parameter>
  <parameter name="T" units="sec">1</parameter></parameters>
<system>
<gravity><g3>-32</g3></gravity>
<bodies>
  <ground><name>G</name></ground>
  <rigidBody><name>A</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>2</Iyy><Izz>2</Izz></moi>
    <initialConditions><orientation><eulerRotation><phi units="deg">40</phi><u1>1</u1><u3>2</u3>
    </eulerRotation></orientation></initialConditions></rigidBody>
  <rigidBody><name>B</name><mass>1</mass><rGB><x>0.1</x></rGB>
    <moi><Ixx>1</Ixx><Iyy>2</Iyy><Izz>2</Izz></moi>
    <initialConditions><position basis="G"><z>-2</z></position><orientation><eulerRotation>
    <phi units="deg">-70</phi><u2>1</u2></eulerRotation></orientation></initialConditions>
  </rigidBody>
  <rigidBody><name>C</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>2</Iyy><Izz>2</Izz></moi>
    <initialConditions><position basis="G"><x>1</x><z>-2</z></position><orientation>
    <eulerRotation><phi units="deg">25</phi><u1>1</u1><u2>1</u2></eulerRotation></orientation>
    </initialConditions></rigidBody>
  <rigidBody><name>Cam</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>2</Iyy><Izz>2</Izz></moi>
    <initialConditions><position><x>9</x></position></initialConditions></rigidBody>
  <rigidBody><name>Valve</name><mass>1</mass><moi><Ixx>1</Ixx><Iyy>2</Iyy><Izz>2</Izz></moi>
    <initialConditions><position><x>9</x><z>0.2</z></position></initialConditions></rigidBody>
</bodies>
<joints>
  <revolute><name>H</name><parent><name>G</name><axis basis="B"><x>1</x><z>2</z></axis></parent>
    <child><name>A</name><reference basis="C"><y>1</y></reference></child></revolute>
  <revolute><name>K</name><parent><name>A</name><position basis="G"><z>-1</z></position></parent>
    <child><name>B</name><position basis="G"><z>1</z></position>
    <axis basis="G"><y>1</y></axis></child></revolute>
  <revolute><name>Shaft</name><parent><name>G</name><position><x>9</x></position><axis><y>1</y></axis>
    <reference><z>1</z><x>0.3</x></reference></parent><child><name>Cam</name></child></revolute>
  <prismatic><name>Guide</name><parent><name>G</name><position><x>9</x></position>
    <axis><z>1</z></axis></parent><child><name>Valve</name></child></prismatic>
  <camFollower><name>Lift</name><first>Shaft</first><second>Guide</second><profile>
    <point><x units="in">2</x></point><point><y units="in">1.5</y></point>
    <point><x units="in">-1</x></point><point><y units="in">-1.2</y></point></profile>
    <follower>flat</follower></camFollower>
</joints>
<motions><pointMotion><name>Line</name><body>C</body><position basis="B"><x>0.4</x></position>
  <direction basis="C"><x>1</x><z>1</z></direction><law><constant>0</constant></law></pointMotion>
</motions>
<signals><state name="s" initial="0.2" units="1">{(sin(H.angle) - s)/T}</state></signals>
<loads>
  <bushing><name>M</name><parent><name>B</name><position basis="G"><x>0.2</x></position>
    <axis basis="C"><y>1</y><z>1</z></axis><reference><x>1</x></reference></parent>
    <child><name>C</name><position basis="G"><x>-0.8</x></position></child>
    <stiffness><x>30</x><y>20</y><z>10</z></stiffness>
    <angularStiffness><x>3</x><y>2</y><z>1</z></angularStiffness></bushing>
  <springDamper><name>S</name><parent><name>G</name></parent>
    <child><name>C</name><position basis="B"><x>1</x></position></child>
    <stiffness>{k}</stiffness></springDamper>
  <torsionalSpringDamper><name>T</name><joint>H</joint><table>
    <entry><angle units="deg">-90</angle><moment>-8</moment></entry>
    <entry><angle units="deg">90</angle><moment>9</moment></entry></table></torsionalSpringDamper>
  <torsionalSpringDamper><name>U</name><joint>K</joint><stiffness>4</stiffness>
    <freeAngle units="deg">10</freeAngle></torsionalSpringDamper>
  <concentrated><name>F</name><body>B</body><position basis="C"><x>1</x></position>
    <force basis="A"><xForce>3</xForce></force><law><expression>{1 + s}</expression></law>
    </concentrated>
</loads>
</system>
<simulation><deltaT>0.001</deltaT><tFinal>1</tFinal></simulation>
</data>"""
"""Vectors in axes of other bodies, and every element that counts from t = 0, in US units."""
