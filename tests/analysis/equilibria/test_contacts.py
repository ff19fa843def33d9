"""Equilibria with contacts, and modes about them, that are known in closed form."""

import math
from dataclasses import replace

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation import from_axis_angle
from msahl.analysis.equilibria.at import point_at
from msahl.analysis.equilibria.begin import started
from msahl.analysis.equilibria.equilibrium import search_start
from msahl.analysis.equilibria.equilibrium_lines import lines
from msahl.analysis.equilibria.search import all_equilibria, find
from msahl.analysis.equilibria.slipping import slipping
from msahl.analysis.equilibria.stability import stability
from msahl.analysis.equilibria.tables import tables
from msahl.analysis.linearised.contact_lines import NOT_UNIQUE, RANGE
from msahl.analysis.modes.mode_lines import report
from msahl.analysis.modes.solution import modes
from msahl.cli.main import main
from msahl.deck import Source, read_deck
from msahl.model import Joint, JointLimit, PlaneContact
from msahl.model.settings import EQUILIBRIUM
from msahl.start.velocities import StartError
from tests.contact.models import DOWN, ball, box, run_events
from tests.support.models import GROUND, ROOT, body, build_model, deck

REST = np.zeros(3)
G = 9.81
ABOUT_Y = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


def equilibrium(model):
    """The point of the equilibrium to which a model leads."""
    found = find(search_start(model), REST)
    assert found is not None
    return found.place.point


def plane(name, normal, radius=0.0, **others):
    return PlaneContact(name, GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3, normal, radius, **others)


def test_a_ball_in_a_groove_presses_on_both_sides():
    a, b, r, m = math.radians(30.0), math.radians(50.0), 0.1, 2.0
    sides = (
        plane("Left", (math.sin(a), 0.0, math.cos(a)), r),
        plane("Right", (-math.sin(b), 0.0, math.cos(b)), r),
    )
    bodies = [body("Ball", m, 0.01, (0.3, 0.2, 0.9))]
    point = equilibrium(build_model(bodies, gravity=DOWN, contacts=sides))
    # Forces by the sine rule; the centre is where both planes, moved by r, meet.
    known = m * G * np.array([math.sin(b), math.sin(a)]) / math.sin(a + b)
    assert point.touching.force == pytest.approx(known, rel=1e-13)  # round-off
    x = r * (math.cos(b) - math.cos(a)) / math.sin(a + b)
    z = r * (math.sin(a) + math.sin(b)) / math.sin(a + b)
    assert point.state.x[0] == pytest.approx([x, 0.2, z], abs=1e-13)


def rod_with_limit(lower):
    """A rod of 1 kg and 1 m on a hinge at the origin, with a lower limit of its angle."""
    start = from_axis_angle((0.0, 1.0, 0.0), math.radians(-30.0))
    arm = np.array([0.5 * math.cos(math.radians(30.0)), 0.0, 0.5 * math.sin(math.radians(30.0))])
    rod = body("Rod", 1.0, (1e-3, 1.0 / 12.0, 1.0 / 12.0), tuple(arm.tolist()), orientation=start)
    ends = ((0.0,) * 3, (-0.5, 0.0, 0.0), ABOUT_Y, ABOUT_Y)
    hinge = Joint("Hinge", "revolute", GROUND.name, "Rod", *ends)
    limit = JointLimit("Stop", "Hinge", "angle", upper=lower)
    return build_model([rod], [hinge], gravity=DOWN, contacts=(limit,))


def test_a_rod_leans_on_the_limit_of_its_joint():
    angle = math.radians(20.0)  # below the horizontal, about y
    point = equilibrium(rod_with_limit(angle))
    assert point.state.x[0, 2] == pytest.approx(-0.5 * math.sin(angle), abs=1e-13)
    assert point.touching.force == pytest.approx([0.5 * G * math.cos(angle)], rel=1e-12)
    assert stability(point) == "stable, nothing can move"
    columns, rows = tables([find(search_start(rod_with_limit(angle)), REST)])["reactions"]
    load = rows[0, columns.index("Stop.load")]
    assert abs(load) == pytest.approx(0.5 * G * math.cos(angle), rel=1e-12)


def test_a_rod_hangs_freely_where_its_limit_is_beyond():
    point = equilibrium(rod_with_limit(math.radians(100.0)))
    assert point.state.x[0] == pytest.approx([0.0, 0.0, -0.5], abs=1e-12)
    assert not point.touching.touches.any()


def at_rest_on_slope(static):
    given = deck("box_on_slope")
    bodies = tuple(replace(one, velocity=(0.0, 0.0, 0.0)) for one in given.bodies)
    corners = tuple(replace(one, static_friction=static) for one in given.contacts)
    return replace(given, bodies=bodies, contacts=corners)


def test_a_block_holds_on_a_slope_within_the_cone():
    start = search_start(at_rest_on_slope(0.37))  # tan 20 degrees = 0.36397
    found = find(start, REST)
    point = found.place.point
    # Three corners can hold it as well as four: what presses sticks.
    assert point.touching.sticks[point.touching.force > 1e-9].all()
    assert point.touching.sticks.sum() >= 3
    assert np.abs(point.state.a).max() <= 1e-14 * G * 10.0  # round-off of redundant forces
    x, z = G * math.sin(math.radians(20.0)), G * math.cos(math.radians(20.0))
    assert point.touching.force.sum() == pytest.approx(z, rel=1e-12)
    # The cone, to the accuracy of Newton's method.
    assert (point.touching.friction <= 0.37 * point.touching.force + 1e-11).all()
    assert point.touching.friction.sum() >= x * (1.0 - 1e-12)  # all of it is across
    said = lines(start, [found])
    assert f"  {RANGE}" in said
    assert f"  {NOT_UNIQUE}" in said


def point_on_slope(static):
    """A point that cannot rotate on a slope of 20 degrees."""
    a = math.radians(20.0)
    slope = plane("Slope", (math.sin(a), 0.0, math.cos(a)), friction=0.3, static_friction=static)
    guide = Joint("Guide", "planar", GROUND.name, "Ball", (0.0,) * 3, (0.0,) * 3, *2 * (ABOUT_Y,))
    bodies = [body("Ball", 1.0, 0.01, (0.0, 0.0, 0.0))]
    hold = JointLimit("Upright", "Guide", "angle", lower=0.0)
    level = JointLimit("Level", "Guide", "angle", upper=0.0)
    contacts = (slope, hold, level)
    return build_model(bodies, [guide], gravity=DOWN, contacts=contacts)


@pytest.mark.slow
def test_a_point_slides_where_friction_is_too_small():
    start = search_start(point_on_slope(0.36))
    assert find(start, REST) is None
    # It takes tan(20 degrees)/0.36 = 1.0110 times the friction.
    assert "the contacts Slope slide" in slipping(start)
    assert "it takes 1.011 times their friction" in slipping(start)
    model = point_on_slope(0.36)
    with pytest.raises(StartError, match="times their friction to hold them"):
        started(replace(model, simulation=replace(model.simulation, start=EQUILIBRIUM)))
    point = equilibrium(point_on_slope(0.37))
    assert point.touching.friction[0] == pytest.approx(G * math.sin(math.radians(20.0)), rel=1e-12)


def test_a_ball_cannot_be_held_by_friction_on_a_slope():
    a = math.radians(10.0)
    slope = plane("Slope", (math.sin(a), 0.0, math.cos(a)), 0.1, friction=0.5)
    place = (0.1 * math.sin(a), 0.0, 0.1 * math.cos(a))
    start = search_start(
        build_model([body("Ball", 1.0, 0.004, place)], gravity=DOWN, contacts=(slope,))
    )
    assert find(start, REST) is None
    assert slipping(start) == ""  # it rolls, and sticks


def test_a_box_falls_flat_and_shares_its_weight_in_many_ways():
    start = search_start(box((0.0, 0.0, 0.4), tilt=0.3))
    found = find(start, REST)
    point = found.place.point
    assert point.state.x[0, 2] == pytest.approx(0.1, abs=1e-13)
    assert point.touching.closed.all()
    assert not point.touching.unique
    assert point.touching.force.sum() == pytest.approx(G, rel=1e-12)
    assert point.touching.force.min() >= 0.0
    # Three motions in the plane have no stiffness; nothing grows.
    assert found.flat == 3
    assert not stability(point).startswith("unstable")


def test_contacts_touch_without_a_force():
    """A ball beside a wall rests on the floor."""
    contacts = (plane("Floor", (0.0, 0.0, 1.0), 0.1), plane("Wall", (1.0, 0.0, 0.0), 0.1))
    bodies = [body("Ball", 1.0, 0.01, (0.1, 0.0, 0.1))]
    point = equilibrium(build_model(bodies, gravity=DOWN, contacts=contacts))
    assert point.touching.touches.tolist() == [True, True]
    assert point.touching.closed.tolist() == [True, False]


def test_random_starts_find_no_ball_at_a_ceiling():
    point = search_start(deck("trough"))
    found = all_equilibria(point, REST, 4)
    heights = {round(float(s.place.point.state.x[0, 2]), 9) for s in found}
    assert heights == {-0.9}  # at the top of the hollow cylinder it would have to be pulled


@pytest.mark.parametrize("load", [0.01, 0.0031, 0.0029, -0.01])
def test_a_beam_leans_on_a_stop(tmp_path, load):
    text = (ROOT / "decks/elastic/cantilever.xml").read_text()
    stop = """<contacts><planeContact><name>Stop</name><parent><name>Base</name>
        <position><z>0.001</z></position><normal><z>-1</z></normal></parent>
        <child><name node="last">Bar</name></child></planeContact></contacts>"""
    path = tmp_path / "deck.xml"
    path.write_text(text.replace("</joints>", f"</joints>{stop}"))
    settings = (f"load={load}",)
    model = Source(path, path.read_bytes()).model(settings)
    point = equilibrium(model)
    # Propped at the tip: R = F - 3 EI d/L^3, to (d/L)^2 of it.
    known = max(load - 3e-3, 0.0)
    assert point.touching.force == pytest.approx([known], rel=1e-4, abs=1e-15)
    assert bool(point.touching.closed[0]) == (load > 3e-3)
    tip = float(point.state.x[-2, 2])
    assert tip == pytest.approx(min(load / 3.0, 1e-3), rel=1e-4)


def test_modes_of_a_propped_beam(tmp_path):
    text = (ROOT / "decks/elastic/cantilever.xml").read_text()
    stop = """<contacts><planeContact><name>Stop</name><parent><name>Base</name>
        <position><z>0.001</z></position><normal><z>-1</z></normal></parent>
        <child><name node="last">Bar</name></child></planeContact></contacts>"""
    path = tmp_path / "deck.xml"
    path.write_text(text.replace("</joints>", f"</joints>{stop}"))
    point = point_at(read_deck(path), EQUILIBRIUM)
    found = modes(point, number=1)
    # tan b = tanh b, b = 3.926602; rotary inertia takes 1e-5 of it, the preload 1e-3 x 7/EI less.
    assert found.frequency[0] == pytest.approx(3.926602**2 / (2.0 * math.pi), rel=3e-5)
    assert any("closed contacts are constraints" in line for line in report(point, found))


def test_modes_of_a_ball_in_a_trough():
    point = point_at(deck("trough"), EQUILIBRIUM)
    found = modes(point)
    # A pendulum of 0.9 m that does not rotate.
    assert found.frequency[found.zeros :] == pytest.approx([math.sqrt(G / 0.9) / (2.0 * math.pi)])
    assert found.degrees_of_freedom == 5
    assert found.redundant == 0


def test_modes_after_an_impact_know_what_is_closed():
    given = deck("trough")
    point = point_at(given, 0.5)
    angle = math.asin(float(point.state.x[0, 0]) / 0.9)
    assert point.touching.closed.tolist() == [True]
    # N = m (g cos + v^2/r), with v^2 = 2 g r (cos - 1/2) from rest at 60 degrees.
    cosine = math.cos(angle)
    assert point.touching.force == pytest.approx([G * (3.0 * cosine - 1.0)], rel=1e-6)  # of the run


def test_sticking_contacts_are_constraints_of_slips():
    slides = modes(point_at(deck("sliding_sphere"), 0.2))
    rolls = modes(point_at(deck("sliding_sphere"), 2.0))
    assert (slides.degrees_of_freedom, rolls.degrees_of_freedom) == (5, 3)
    assert any("contacts slide" in warning for warning in slides.warnings)
    assert not any("contacts slide" in warning for warning in rolls.warnings)
    at_rest = modes(point_at(deck("box_on_slope"), 0.8))
    assert at_rest.degrees_of_freedom == 0


def test_modes_before_an_impact_are_refused():
    model = ball(0.5, height=0.0, velocity=(0.0, 0.0, -1.0))
    with pytest.raises(StartError, match="'Floor' is about to have an impact at 1 "):
        point_at(model, 0.0)


def test_a_run_begins_at_an_equilibrium_with_contacts():
    model = deck("trough")
    model = replace(model, simulation=replace(model.simulation, start=EQUILIBRIUM))
    there = started(model)
    assert there.bodies[0].position == pytest.approx((0.0, 0.0, -0.9), abs=1e-13)
    outcome, sink, events = run_events(there, "gauss2", dt=0.05, t_final=0.5)
    assert outcome.status == "completed"
    assert len(events) == 1  # it closes at t = 0
    assert sink.table("states")[-1, 1:4] == pytest.approx([0.0, 0.1, -0.9], abs=1e-12)


def test_released_contacts_do_not_press():
    model = replace(ball(0.5, height=0.0), released=("Floor",))
    assert find(search_start(model), REST) is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--rotation", "0", "0", "1"], "steady rotations do not know"),
        (["--load-path", "1"], "may open and close along the path"),
    ],
)
def test_commands_say_what_they_do_not_know(options, said):
    path = str(ROOT / "decks/contact/trough.xml")
    done = CliRunner().invoke(main, ["equilibrium", path, *options])
    assert done.exit_code != 0
    assert said in done.output
