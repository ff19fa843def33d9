"""Pins against planar curves: closed forms of plane geometry and of motions along a curve."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from msahl.deck import read_deck
from msahl.deck.write_model import write_deck
from msahl.model import Curve, CurvePart, PinContact
from msahl.post.scene import build_scene
from msahl.run.verdict import PASS
from msahl.system.build import build_system
from tests.contact.models import DOWN, run_events
from tests.contact.test_decks import DECKS, faults_of
from tests.elements.test_curves import SQUARE, arc, circle, line
from tests.support.models import GROUND, body, build_model, deck

CAM = (DECKS / "cam_lift_off.xml").read_text()
LOW, LENGTH, G = 0.01, 0.05, 9.81
"""Eccentricity of the cam, distance of the centres, gravity."""
UPRIGHT = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))
"""The plane of x and z, with z up."""
R, ANGLE, BEFORE, PIN = 1.0, 0.6, 0.5, 0.1
"""Of the valley: radius, slope, way down to the arc; and radius of the pin."""


def cam(tmp_path, speed):
    """The deck at another speed of the cam."""
    path = tmp_path / "cam.xml"
    text = CAM
    for tag in ("<omega3>", '<c1 units="rad">'):
        text = text.replace(f"{tag}30<", f"{tag}{speed!r}<")
    path.write_text(text)
    return read_deck(path)


def on_curve(curve, position, mass=1.0, moment=0.01, velocity=(0.0, 0.0, 0.0), **others):
    """A pin before or on a curve of the ground in the plane of x and z."""
    pin = PinContact("Pin", GROUND.name, "Pin", (0.0,) * 3, (0.0,) * 3, curve, axes=UPRIGHT)
    bodies = [body("Pin", mass, moment, position, velocity=velocity)]
    return build_model(bodies, gravity=DOWN, contacts=(replace(pin, **others),))


def valley(**others):
    """A pin at rest on a slope, which goes on by an arc and up another slope."""
    c, s = math.cos(ANGLE), math.sin(ANGLE)
    ends = [(R * s, R - R * c), (-R * s, R - R * c)]
    right = (ends[0][0] + 3.0 * c, ends[0][1] + 3.0 * s)
    left = (-right[0], right[1])
    curve = Curve(right, (line(*ends[0]), arc((0.0, 0.0), ends[1]), line(*left)))
    x, z = ends[1][0] - BEFORE * c + PIN * s, ends[1][1] + BEFORE * s + PIN * c
    return on_curve(curve, (x, 0.0, z), radius=PIN, **others)


def times_down():
    """Time down to the arc, and from there to the lowest point."""
    first = math.sqrt(2.0 * BEFORE / (G * math.sin(ANGLE)))
    length = R - PIN
    start = [-ANGLE, G * math.sin(ANGLE) * first / length]

    def bottom(t, y):
        return y[0]

    bottom.terminal = True
    found = solve_ivp(
        lambda t, y: (y[1], -G / length * math.sin(y[0])),
        *((0.0, 5.0), start),
        method="DOP853",
        rtol=1e-13,
        atol=1e-14,
        events=bottom,
    )
    return first, float(found.t_events[0][0])


def test_a_follower_lifts_off_and_falls_back(tmp_path):
    _, sink, events = run_events(deck("cam_lift_off"), "gauss3")
    assert [event[1] for event in events] == ["closes", "opens", "impact", "closes"]
    assert [event[0] for event in events[1:3]] == pytest.approx(
        [0.0928564554378281, 0.141227629285967], abs=1e-13
    )
    assert events[2][3] == pytest.approx(-0.05788197622365081, rel=1e-12)
    angle = math.pi + 6.0
    lift = LOW * math.cos(angle) + math.sqrt(LENGTH**2 - (LOW * math.sin(angle)) ** 2)
    assert sink.table("states")[-1, 14] == pytest.approx(lift, abs=1e-15)


def test_the_speed_of_lift_off(tmp_path):
    limit = math.sqrt(G / (LOW + LOW**2 / LENGTH))
    kinds = {}
    for factor in (1.0 - 1e-6, 1.0 + 1e-4):
        _, _, events = run_events(cam(tmp_path, factor * limit), "gauss3")
        kinds[factor > 1.0] = [event[1] for event in events]
    assert kinds[False] == ["closes"]
    assert kinds[True][:2] == ["closes", "opens"]


def test_a_geneva_wheel_moves_by_quarters():
    """Angles and rates while the pin drives are those of plane geometry."""
    report, sink, _ = run_events(deck("geneva_wheel"), "gauss3")
    table = sink.table("joints")
    a, play = 0.1 * math.sqrt(0.5), 1e-4
    for t, row in ((0.1, 40), (0.2, 80), (0.3, 120)):
        angle = math.radians(-72.0) + 2.0 * math.pi * t
        x, y = 0.1 - a * math.cos(angle), a * math.sin(angle)
        wheel = math.atan2(-y, x) + math.asin(play / math.hypot(x, y))
        assert table[row, 0] == pytest.approx(t)
        # The joint counts from the wheel's start at 45 degrees.
        assert table[row, 3] == pytest.approx(wheel, abs=1e-12)
    assert table[80, 4] == pytest.approx(-2.0 * math.pi / (math.sqrt(2.0) - 1.0), rel=1e-11)
    for row, quarters in ((400, 1), (800, 2)):
        after = math.degrees(table[row, 3]) - 45.0 + 90.0 * quarters
        assert abs(after) < math.degrees(play / a)
    assert report.extremes["energyErrorMax"] < 1e-9


@pytest.mark.slow
def test_a_ratchet_stops_where_its_pawl_is_in_balance():
    _, sink, _ = run_events(deck("ratchet"), "gauss3")
    x, y = sink.table("joints")[-1, [1, 3]]
    force, weight, play = 0.2, 0.1 * G, 0.002
    size, root = math.hypot(force, weight), 0.004 * math.tan(math.pi / 4 + math.atan(0.4) / 2)
    balance = (-(0.02 - 0.004 + play * force / size), root - play * weight / size)
    # What is left of the oscillations of the last root after 3 s.
    assert (x, y) == pytest.approx(balance, abs=1e-6)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-8])
def test_auto_passes_the_corners_of_a_ratchet(tolerance):
    """At corners force and curvature jump: pairs end there, and those after them are as long as
    before. It took up to 800 steps, and none at 1e-6.
    """
    model = deck("ratchet")
    given = replace(model.simulation, output_interval=0.075)
    report, _, events = run_events(
        replace(model, simulation=given), "auto", 0.075, tolerance=tolerance
    )
    assert report.verdict["word"] == PASS
    assert report.steps < 200
    impacts = [event[0] for event in events if event[1] == "impact"]
    # Times of the deck, to the digits given there, or what an error of the rack's place makes.
    assert impacts == pytest.approx([0.0645505, 0.1334212], abs=6e-8 + 10.0 * tolerance)


@pytest.mark.parametrize(("scheme", "steps", "order"), [("gauss2", 80, 4.0), ("gauss3", 20, 6.0)])
def test_the_order_holds_where_the_curvature_jumps(scheme, steps, order):
    """Down a slope, through an arc, up, and back to the lowest point: through four jumps."""
    first, second = times_down()
    end = 3.0 * (first + second)
    errors = []
    for count in (steps, 2 * steps):
        _, sink, _ = run_events(valley(), scheme, end / count, end)
        errors.append(abs(sink.table("states")[-1, 1]))
    assert errors[0] < 1e-6
    assert math.log2(errors[0] / errors[1]) > order - 0.3


@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_a_pin_slides_or_rolls_through_a_valley(friction):
    """One that rolls takes sqrt(1 + J/(m r^2)) times as long."""
    moment = 0.006
    share = 1.0 + moment / PIN**2 if friction else 1.0
    end = math.sqrt(share) * sum(times_down())
    model = valley(friction=friction, moment=moment)
    report, sink, _ = run_events(model, "gauss3", end / 60, end)
    last, speed = sink.table("states")[-1], math.sqrt(2.0 * G * _drop() / share)
    assert last[1] == pytest.approx(0.0, abs=1e-8)
    assert last[3] == pytest.approx(PIN, abs=1e-8)
    assert math.hypot(last[7], last[9]) == pytest.approx(speed, rel=1e-8)
    # It rolls without slip: about y.
    assert last[11] == pytest.approx(speed / PIN if friction else 0.0, rel=1e-8)
    assert report.extremes["energyErrorMax"] < 1e-9


def _drop():
    """From the start to the lowest point."""
    return BEFORE * math.sin(ANGLE) + (R - PIN) * (1.0 - math.cos(ANGLE))


def test_a_point_slides_down_a_slope_with_friction():
    slope = Curve((1.0, 0.75), (line(-1.0, -0.75),))
    model = on_curve(slope, (0.0, 0.0, 0.0), friction=0.3)
    _, sink, _ = run_events(model, "gauss2", 0.05, 1.0)
    way = 0.5 * G * (0.6 - 0.3 * 0.8)
    last = sink.table("states")[-1]
    assert last[[1, 3]] == pytest.approx((-0.8 * way, -0.6 * way), rel=1e-12)
    _, sink, _ = run_events(on_curve(slope, (0.0, 0.0, 0.0), friction=0.8), "gauss2", 0.05, 1.0)
    assert np.abs(sink.table("states")[-1, 1:4]).max() < 1e-15


def test_a_pin_bounces_off_a_corner():
    """Its velocity is reflected at the line from the corner to its centre."""
    offset = 0.06
    model = on_curve(SQUARE, (1.0 + offset, 0.0, 2.0), radius=0.1, restitution=1.0)
    _, sink, events = run_events(model, "gauss2", 0.01, 0.5)
    up = math.sqrt(0.1**2 - offset**2)
    t = math.sqrt(2.0 * (1.0 - up) / G)
    assert events[0][0] == pytest.approx(t, abs=1e-13)
    n = np.array([offset, up]) / 0.1
    v = np.array([0.0, -G * t])
    after = v - 2.0 * (v @ n) * n
    assert events[0][3] == pytest.approx(v @ n, rel=1e-12)
    assert sink.table("states")[-1, [7, 9]] == pytest.approx(
        after - (0.0, G * (0.5 - t)), rel=1e-12, abs=1e-13
    )


def test_a_pin_in_a_slot_touches_both_sides():
    """Thrown across a slot it returns from side to side at constant speed."""
    slot = Curve(
        (0.5, 0.1),
        (
            line(0.5, -0.1),
            arc((0.4, -0.2), (0.3, -0.1)),
            line(0.3, 0.1),
            arc((0.4, 0.2), (0.5, 0.1)),
        ),
        closed=True,
    )
    pin = on_curve(slot, (0.4, 0.0, 0.0), radius=0.08, restitution=1.0, velocity=(0.5, 0.0, 0.0))
    _, _, events = run_events(replace(pin, gravity=(0.0, 0.0, 0.0)), "gauss2", 0.03, 0.5)
    assert [event[0] for event in events] == pytest.approx(
        [0.04, 0.12, 0.2, 0.28, 0.36, 0.44], abs=1e-13
    )
    assert [event[3] for event in events] == pytest.approx([-0.5] * 6, rel=1e-13)


def test_energy_is_preserved_over_jumps_of_the_curvature():
    report, _, _ = run_events(valley(), "preserving", 0.02, 2.0)
    assert report.extremes["energyErrorMax"] < 1e-12


def test_a_compliant_contact_is_near_the_rigid_one():
    from msahl.model import Compliance

    first, second = times_down()
    errors = []
    for stiffness in (1e4, 1e5):
        model = valley(compliance=Compliance(stiffness), restitution=1.0)
        end = first + second
        _, sink, _ = run_events(model, "gauss3", end / 400, end)
        errors.append(abs(sink.table("states")[-1, 1]))
    assert errors[1] < 0.2 * errors[0] < 1e-3


SPLINE = Curve(
    (1.0, 0.0),
    (CurvePart("spline", ((0.0, 0.3), (-1.0, 0.0))), line(-1.0, -1.0), line(1.0, -1.0)),
    closed=True,
)


@pytest.mark.parametrize("name", ["cam_lift_off", "geneva_wheel", "ratchet"])
def test_a_written_deck_is_read_to_equal_records(tmp_path, name):
    model = deck(name)
    path = tmp_path / "written.xml"
    path.write_bytes(write_deck(model))
    assert read_deck(path).contacts == model.contacts


def test_a_written_spline_is_read_to_an_equal_record(tmp_path):
    model = on_curve(SPLINE, (0.0, 0.0, 2.0), radius=0.1, friction=0.2)
    path = tmp_path / "written.xml"
    path.write_bytes(write_deck(model))
    (read,), (given,) = read_deck(path).contacts, model.contacts
    assert read.curve == given.curve
    assert np.abs(np.subtract(read.axes, given.axes)).max() < 1e-15


START = '<point><x units="mm">40</x><y units="mm">-10</y></point>'
FAULTS = {
    "hollow": (
        f"{START}\n          <arc>",
        f'{START}<point><x units="mm">45</x><y units="mm">-10</y></point>\n          <arc>',
        "is hollow, where the pin touches both sides",
    ),
    "point": (
        '<radius units="mm">10</radius>\n      </pin',
        "</pin",
        "has no direction for a point",
    ),
    "overlap": ('<y units="mm">40</y>', '<y units="mm">39</y>', "overlaps by 0.001 m"),
    "twice": (START, START + START, "given twice in a row"),
    "friction": ("</pinContact>", "<friction>-1</friction></pinContact>", "friction"),
    "closed": ('closed="true"', 'closed="yes"', "closed='yes'; expected one of true, false"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_faults(tmp_path, case):
    old, new, words = FAULTS[case]
    text = CAM
    if case == "point":  # with corners
        text = text.replace(
            '<x units="mm">0</x><y units="mm">-50</y>', '<x units="mm">0</x><y units="mm">-30</y>'
        )
    assert words in faults_of(tmp_path, text, old, new)


def test_a_pin_must_fit_the_hollows(tmp_path):
    tight = on_curve(circle(0.2, sign=-1.0), (0.0, 0.0, 0.0), radius=0.3)
    from msahl.check import check

    assert "does not fit the hollow of radius 0.2 m" in str(check(tight))


def test_scenes_without_curves_have_none():
    assert build_system(deck("trough")).scalar.coordinates.curves is None
    assert build_system(deck("cam_lift_off")).scalar.coordinates.curves is not None


def test_pictures_show_the_curve_and_the_pin():
    scene = build_scene(deck("geneva_wheel"))
    driver, wheel = scene["bodies"]
    assert [s["size"][0] for s in driver["shapes"] if s["kind"] == "disc"] == [0.005]
    rods = [s for s in wheel["shapes"] if s["kind"] == "rod"]
    length = sum(s["size"][1] for s in rods)
    m, half, middle = math.sqrt(0.005 - 0.0051**2), 0.0051, 0.027
    slots = 4.0 * (2.0 * (m - middle) + math.pi * half)
    rims = 4.0 * math.sqrt(0.005) * (0.5 * math.pi - 2.0 * math.asin(half / math.sqrt(0.005)))
    # Chords that bend by a tenth are shorter than arcs by 4e-4, and links of joints are rods.
    assert length == pytest.approx(slots + rims, rel=1e-3)
