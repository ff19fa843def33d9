"""Boxes against boxes: gaps, impacts of faces and edges, stacks, and how decks say them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.check import check
from msahl.check.box_gaps import distance, separation
from msahl.check.directions import frame
from msahl.contact.response import gaps
from msahl.deck import read_deck
from msahl.deck.write_model import write_deck
from msahl.model import BoxContact, BoxesContact, CapsuleContact, PlaneContact
from msahl.model.box_parts import parts_of
from msahl.system.build import build_system
from msahl.system.contacts import contacts_of, set_closed
from msahl.system.state import build_state
from msahl.system.work_arrays import new_work_arrays
from tests.contact.models import DOWN, run_events, times_of
from tests.contact.test_decks import DECKS, faults_of
from tests.contact.test_friction_on_bodies import momenta
from tests.support.models import GROUND, body, build_model, deck

ZERO, UP = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
R = 0.01
INERTIA = (0.01, 0.012, 0.013)
CROSSED = (DECKS / "crossed_boxes.xml").read_text()


def pair(position, orientation=ZERO, law=None, base=(0.2, 0.15, 0.1), **start):
    """A box of 1 kg above a fixed one."""
    box = body("Box", 1.0, INERTIA, position, orientation=orientation, **start)
    sizes = (base, (0.1, 0.1, 0.1), R, R)
    contact = BoxesContact("Touch", GROUND.name, "Box", ZERO, ZERO, *sizes, **(law or {}))
    return build_model([box], gravity=DOWN, contacts=(contact,))


def yawed(angle):
    return from_axis_angle(UP, angle)


def random_rotation(random):
    axis = random.normal(size=3)
    return from_axis_angle(tuple(axis / np.linalg.norm(axis)), random.uniform(0.0, 3.0))


def random_box(random, p=None):
    rows = np.array(matrix(p or random_rotation(random))).T
    return random.uniform(-0.5, 0.5, 3), rows, random.uniform(0.05, 0.3, 3)


def independent_distance(one, two):
    """The distance of two boxes, as the least squares of a point of each: a convex problem."""
    A = np.hstack([two[1].T, -one[1].T])
    bound = np.concatenate([two[2], one[2]])
    found = lsq_linear(A, one[0] - two[0], (-bound, bound), method="bvls", tol=1e-15)
    return np.linalg.norm(A @ found.x - one[0] + two[0])


@pytest.mark.slow
def test_the_least_of_all_parts_is_the_distance_of_the_boxes():
    random, cases, crossing = np.random.default_rng(3), 0, 0
    for _ in range(400):
        one, two = random_box(random), random_box(random)
        if separation(one, two) <= 1e-3:
            continue
        wanted = independent_distance(one, two)
        # The quadratic problem is solved to the root of round-off of its square.
        assert distance(one, two) == pytest.approx(wanted, abs=2e-8)
        cases += 1
        corners = min(of_corners(one, two), of_corners(two, one))
        crossing += corners > wanted + 1e-6
    assert cases > 150
    assert crossing > 20  # only edges that cross see these


def of_corners(box, other):
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    places = (other[0] + signs * other[2] @ other[1] - box[0]) @ box[1].T
    return np.linalg.norm(np.maximum(np.abs(places) - box[2], 0.0), axis=1).min()


def test_gaps_of_a_system_are_those_of_its_boxes():
    """The gaps of the equations of motion, of a capsule on a box as well."""
    random = np.random.default_rng(5)
    for axes in (np.eye(3), np.array(frame((0.6, 0.0, 0.8)))):
        orientations = [random_rotation(random) for _ in range(2)]
        one, two = (random_box(random, p) for p in orientations)
        two = (one[0] + 1.5 * two[0] / np.linalg.norm(two[0]), two[1], two[2])
        half = tuple(two[2]) if axes[0, 0] == 1.0 else (0.0, 0.0, 0.2)
        bodies = [
            body(name, 1.0, INERTIA, tuple(box[0]), orientation=p)
            for name, box, p in zip("AB", (one, two), orientations, strict=True)
        ]
        given = (tuple(one[2]), half, R, 2.0 * R)
        own = tuple(tuple(row) for row in axes.tolist())
        contact = BoxesContact("Touch", "A", "B", ZERO, ZERO, *given, axes=own)
        model = build_model(bodies, contacts=(contact,))
        system = build_system(model)
        state = build_state(model, system)
        contacts = contacts_of(model, system, state)
        _, gap, _ = gaps(system, contacts, state, new_work_arrays(system, state))
        other = (two[0], axes @ two[1], np.array(half))
        assert gap.min() == pytest.approx(distance(one, other) - 3.0 * R, abs=1e-13)


def test_parts_are_corners_and_edges():
    (contact,) = pair((0.0, 0.0, 0.5)).contacts
    parts = [*parts_of(contact)]
    assert len(parts) == len({part.name for part in parts}) == 8 + 8 + 144
    capsule = replace(contact, half=(0.0, 0.0, 0.1))
    assert len([*parts_of(capsule)]) == 2 + 8 + 12


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4.0])
@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
def test_a_box_that_falls_flat_rebounds_as_a_ball_does(angle, scheme):
    """Face on face, at corners, at corners and crossings, and at eight crossings."""
    half = (0.1, 0.1, 0.1)
    model = pair((0.0, 0.0, 0.42), yawed(angle), {"restitution": 0.5}, half)
    report, sink, events = run_events(model, scheme, 0.01, 0.5)
    fall = np.sqrt(2.0 * 0.2 / 9.81)
    # Times of impacts carry the round-off of the gap by the speed there.
    impacts = np.unique(times_of(events, "impact").round(9))
    assert impacts == pytest.approx(fall * np.array([1.0, 2.0]), abs=1e-9)
    assert events[0][3:5] == pytest.approx([-9.81 * fall, 0.5 * 9.81 * fall], abs=1e-11)
    assert sink.table("states")[-1, 4:6] == pytest.approx([0.0, 0.0], abs=1e-10)
    assert report.extremes["energyErrorMax"] < 1e-12


def test_a_bar_falls_edge_on_edge():
    report, sink, events = run_events(deck("crossed_boxes"), "gauss2")
    (impact,) = events
    assert impact[2] == "Hit.edge6.edge1"
    # Digits of the deck's numbers.
    assert impact[0] == pytest.approx(0.319275428407, abs=1e-12)
    assert impact[5] == pytest.approx(2.765410635622, abs=1e-11)
    assert report.contacts["energyLost"] == pytest.approx(2.165380099417, abs=1e-11)
    last = sink.table("states")[-1, 13:]
    assert last[:3] == pytest.approx([0.2, 0.0, 0.170568623195], abs=1e-11)
    A = np.array(matrix(tuple(last[3:6])))
    pitched = np.array(matrix(from_axis_angle((0.0, 1.0, 0.0), 0.780092913824)))
    tilted = np.array(matrix(from_axis_angle((1.0, 0.0, 0.0), np.pi / 4.0)))
    assert pytest.approx(pitched @ tilted, abs=2e-8) == A  # by steps of 0.1 rad


STARTS = {
    "edge on edge": (from_axis_angle((1.0, 0.0, 0.0), 0.7), (0.02, 0.03, 0.5)),
    "corner on face": (from_axis_angle((0.6, 0.8, 0.0), 0.9), (0.02, 0.03, 0.5)),
    "face on corner": (yawed(0.3), (0.02, 0.03, 0.5)),
}


def colliding(case):
    """Two free boxes, one of which spins and comes down at 2 m/s."""
    orientation, position = STARTS[case]
    other = {"edge on edge": (0.0, 1.0, 0.0), "face on corner": (0.8, -0.6, 0.0)}.get(case)
    other = from_axis_angle(other, 0.7) if other else ZERO
    law = {"restitution": 0.6, "friction": 0.3}
    contact = BoxesContact("Touch", "A", "B", ZERO, ZERO, *(2 * [(0.2, 0.15, 0.1)]), R, R, **law)
    moving = {"velocity": (0.3, -0.2, -2.0), "angular_velocity": (0.4, -0.3, 0.5)}
    bodies = [
        body("A", 2.0, INERTIA, ZERO, orientation=other),
        body("B", 1.0, INERTIA, position, orientation=orientation, **moving),
    ]
    return build_model(bodies, contacts=(contact,))


@pytest.mark.sampled
@pytest.mark.parametrize("case", STARTS)
@pytest.mark.parametrize(("scheme", "allowed"), [("gauss3", 1e-9), ("preserving", 1e-13)])
def test_free_impacts_with_friction_keep_both_momenta(case, scheme, allowed):
    model = colliding(case)
    report, sink, events = run_events(model, scheme, 0.01, 0.3)
    assert events[0][1] == "impact"
    assert events[0][9] > 0.005  # lost to friction
    states = sink.table("states")
    before, after = momenta(states[0], model.bodies), momenta(states[-1], model.bodies)
    assert after == pytest.approx(before, abs=allowed)
    assert report.extremes["energyErrorMax"] < 1e-9


def in_other_words(model, rotation=ZERO, names=("A", "B"), backwards=False, swapped=False):
    """The model of ``colliding`` rotated, with other names, bodies in another order, and the other
    one as the parent.
    """
    R, bodies = np.array(matrix(rotation)), []
    for given, name in zip(model.bodies, names, strict=True):
        place, orientation = R @ given.position, compose(rotation, given.orientation)
        # Velocities are in the axes of the bodies.
        found = replace(given, name=name, position=tuple(place.tolist()), orientation=orientation)
        bodies.append(found)
    ends = names[::-1] if swapped else names
    contact = replace(model.contacts[0], parent=ends[0], child=ends[1])
    return replace(model, bodies=(*bodies[:: -1 if backwards else 1],), contacts=(contact,))


OTHERS = {
    "rotated": {"rotation": from_axis_angle((0.48, 0.6, 0.64), 1.1)},
    "renamed": {"names": ("Z", "Y")},
    "permuted": {"backwards": True},
    "swapped": {"swapped": True},
}


def end_of(model, rotation=ZERO, backwards=False):
    """Places, rotated back, axes and velocities of both boxes at the end; times of impacts."""
    _, sink, events = run_events(model, "gauss3", 0.01, 0.3)
    states = sink.table("states")[-1, 1:].reshape(2, 4, 3)[:: -1 if backwards else 1]
    back = np.array(matrix(rotation)).T
    axes = [back @ matrix(tuple(state[1])) for state in states]
    found = [states[:, 0] @ back.T, states[:, 2], states[:, 3], *axes]
    return np.vstack(found), times_of(events, "impact")


@pytest.mark.sampled
@pytest.mark.parametrize("case", STARTS)
@pytest.mark.parametrize("how", OTHERS)
def test_boxes_in_other_words_move_in_the_same_way(case, how):
    model, words = colliding(case), OTHERS[how]
    given, times = end_of(model)
    only = {key: value for key, value in words.items() if key not in ("names", "swapped")}
    found, others = end_of(in_other_words(model, **words), **only)
    assert times.size > 0
    assert others == pytest.approx(times, abs=1e-12)
    # An impact multiplies the round-off of places by the speeds over the sizes, some 100 times.
    assert found == pytest.approx(given, abs=1e-11)


def test_a_box_sticks_on_a_slope_of_another_one():
    """At 10 degrees, where the friction of 0.5 holds it, for 100 s."""
    model = pair((0.0, 0.0, 0.22), yawed(0.3), {"friction": 0.5})
    slope = np.radians(10.0)
    model = replace(model, gravity=(9.81 * np.sin(slope), 0.0, -9.81 * np.cos(slope)))
    report, sink, _ = run_events(model, "gauss2", 1.0, 100.0)
    states = sink.table("states")
    assert report.time == 100.0
    assert np.abs(states[:, 1:4] - states[0, 1:4]).max() < 1e-12


def test_boxes_that_overlap_are_refused_with_their_depth():
    (fault,) = check(pair((0.0, 0.0, 0.21), yawed(0.3)))
    assert "it overlaps by 0.01 m" in fault.message
    (fault,) = check(pair((0.0, 0.0, 0.1)))  # deeper than the rounding
    assert "it overlaps by 0.12 m" in fault.message


FAULTS = {
    "sharp": ('<radius units="mm">10', '<radius units="mm">0', "parentRadius is"),
    "both": ("<childBox>", "<length>1</length><childBox>", "the child is a box; delete it"),
    "soft": ("<restitution>", "<stiffness>1e4</stiffness><restitution>", "two boxes is rigid"),
    "flat": ("<x>0.8</x><y>0.1</y><z>0.1</z>", "", "the child has no size"),
}


@pytest.mark.parametrize("case", FAULTS)
def test_faults(tmp_path, case):
    old, new, words = FAULTS[case]
    text = CROSSED.replace('<parentRadius units="mm">10', '<parentRadius units="mm">0')
    text = text if case == "sharp" else CROSSED
    assert words in faults_of(tmp_path, text, old, new)


def written(tmp_path, model):
    path = tmp_path / "written.xml"
    path.write_bytes(write_deck(model))
    return read_deck(path)


def test_a_written_deck_is_read_to_equal_records(tmp_path):
    model = deck("crossed_boxes")
    assert written(tmp_path, model).contacts == model.contacts
    contact = replace(model.contacts[0], half=(0.0, 0.0, 0.2), axes=frame((0.0, 1.0, 0.0)))
    capsule = replace(model, contacts=(contact,))
    assert written(tmp_path, capsule).contacts == capsule.contacts


SET = """<contactSet><name>All</name>
  <box><name>Bar</name><x>0.8</x><y>0.1</y><z>0.1</z><radius>0.01</radius></box>
  <box><name>Beam</name><x>0.2</x><y>1</y><z>0.2</z><radius>0.01</radius></box>
  <capsule><name>Earth</name><position><z>-1</z></position><axis><x>1</x></axis>
    <radius>0.1</radius><length>1</length></capsule>
  <sphere><name>Earth</name><position><z>2</z></position><radius>0.1</radius></sphere>
  <plane><name>Earth</name><position><z>-5</z></position><normal><z>1</z></normal></plane>
  <restitution>0.5</restitution></contactSet>"""


def test_boxes_in_a_set_touch_all_other_members(tmp_path):
    start, end = CROSSED.index("<boxContact>"), CROSSED.index("</contacts>")
    path = tmp_path / "deck.xml"
    path.write_text(CROSSED[:start] + SET + CROSSED[end:])
    found = {contact.name: contact for contact in read_deck(path).contacts}
    kinds = {name: type(contact) for name, contact in found.items()}
    planes = [name for name, kind in kinds.items() if kind is PlaneContact]
    corners = [f"All.Earth.3.{one}.{k}" for one in ("Bar", "Beam") for k in range(1, 9)]
    assert sorted(planes) == sorted(corners)
    assert {name: kind for name, kind in kinds.items() if kind is not PlaneContact} == {
        "All.Bar.Beam": BoxesContact,
        "All.Bar.Earth.1": BoxContact,
        "All.Beam.Earth.1": BoxContact,
        "All.Bar.Earth.2": BoxesContact,
        "All.Beam.Earth.2": BoxesContact,
    }
    assert found["All.Bar.Earth.2"].half == (0.0, 0.0, 0.5)
    sides = [*parts_of(found["All.Bar.Beam"])]
    assert {type(part) for part in sides} == {BoxContact, CapsuleContact}


@pytest.mark.slow
def test_the_stack_of_the_deck_stops_and_stays():
    report, sink, events = run_events(deck("stack_of_boxes"), "gauss2")
    # Digits of the deck's numbers.
    assert times_of(events, "sticks")[-4:] == pytest.approx([0.135915732246] * 4, abs=1e-12)
    last = sink.table("states")[-1, 1:].reshape(3, 12)
    # Positions are those of the start but for round-off.
    assert last[:, 0] == pytest.approx([0.0, 0.0, 0.027183146449], abs=1e-12)
    assert last[:, 2] == pytest.approx([0.1, 0.3, 0.5], abs=1e-14)
    assert report.contacts["energyLost"] == pytest.approx(0.08, abs=1e-13)
    assert sum(name.startswith("Rest.edge") for name in report.contacts["closed"]) == 8


@pytest.mark.slow
def test_a_stack_at_rest_does_not_creep():
    model = deck("stack_of_boxes")
    still = replace(model.bodies[2], velocity=ZERO)
    model = replace(model, bodies=(*model.bodies[:2], still))
    report, sink, _ = run_events(model, "gauss2", 1.0, 100.0)
    states = sink.table("states")
    assert report.time == 100.0
    assert np.abs(states[-1, 1:] - states[0, 1:]).max() < 1e-12


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "least"), [("gauss2", 3.9), ("gauss3", 5.8)])
def test_the_order_holds_through_impacts_of_edges(scheme, least):
    """Free boxes that spin: the first impacts of an edge on an edge, in 0.25 s."""
    ends, steps = [], (0.05, 0.025, 0.003125)
    for dt in steps:
        _, sink, events = run_events(colliding("edge on edge"), scheme, dt, 0.25)
        assert events[0][2].startswith("Touch.edge")
        ends.append(sink.table("states")[-1, 1:])
    errors = [np.abs(found - ends[-1]).max() for found in ends[:-1]]
    assert errors[1] > 1e-12  # above round-off
    assert np.log2(errors[0] / errors[1]) > least


def test_open_contacts_are_not_evaluated():
    model = deck("stack_of_boxes")
    system = build_system(model)
    contacts = contacts_of(model, system, build_state(model, system))
    coords, rows = system.scalar.coordinates, system.scalar.equations
    assert coords.idle.all()
    which = np.arange(contacts.row.size) < 2
    set_closed(system, contacts, which, np.zeros(coords.kind.size))
    group = system.forces.sliding
    used = [*rows.coordinate[contacts.row[:2], 0], *group.along[:2].reshape(-1)]
    assert np.flatnonzero(~coords.idle).tolist() == sorted(used)
