"""The mechanisms of the benchmarks: their layout for other programs, and what is stored of them."""

import numpy as np
import pytest

from benchmarks.curves import Curve, Point
from benchmarks.mechanisms import store
from benchmarks.mechanisms.gears import gear_train
from benchmarks.mechanisms.layout import layout
from benchmarks.mechanisms.net import GRAVITY, MASS, net, swing
from benchmarks.mechanisms.page import MACHINE, PAGE, PICTURE, verdicts, write_page
from benchmarks.mechanisms.problems import ABOUT, DECKS, MODELS
from benchmarks.mechanisms.robot import FRICTION, SPIN, robot
from benchmarks.mechanisms.store import Refused
from benchmarks.mechanisms.suspension import suspension
from benchmarks.precision_asked import Found
from benchmarks.problems import Problem
from benchmarks.reference import Known
from msahl.check import check
from msahl.deck import read_deck

BUILT = {"robot": robot, "suspension": suspension, "gear train": gear_train, "net": net}


def closings(model):
    return sorted(hinge.name for hinge in layout(model).closing)


@pytest.mark.parametrize("name", BUILT)
def test_a_model_without_a_deck_is_as_sound_as_one_with_a_deck(name):
    assert check(BUILT[name]()) == []


def test_every_mechanism_is_described():
    assert set(MODELS) == set(ABOUT)
    assert len(MODELS) == 9


def test_joints_beyond_a_spanning_tree_close_the_loops():
    assert closings(robot()) == closings(gear_train()) == []
    # A ball joint is cheaper to close than a hinge, and any but a joint on the ground.
    assert closings(read_deck(DECKS / "spatial_slider_crank.xml")) == ["Ball"]
    assert closings(read_deck(DECKS / "four_bar.xml")) == ["Rocker pin"]
    assert closings(suspension()) == ["Tie ball", "Upper ball"]
    squeezer = layout(read_deck(DECKS / "andrews_squeezer.xml"))
    assert (len(squeezer.tree), len(squeezer.closing)) == (7, 3)


@pytest.mark.parametrize("meshes", [2, 10])
def test_a_net_has_a_loop_for_each_mesh(meshes):
    given = layout(net(meshes))
    assert len(given.closing) == meshes**2
    assert len(given.tree) == len(given.masses) == meshes * (2 * meshes + 1)
    np.testing.assert_array_equal(given.normal, [0.0, 1.0, 0.0])


def test_the_motion_of_a_net_is_that_of_its_levels():
    """It starts where the bodies are; falling freely at first, as all angles are equal."""
    t = np.array([0.0, 1e-3, 2e-3])
    x = swing(t, meshes=3)
    masses = layout(net(3)).masses.values()
    np.testing.assert_allclose(x[0], [mass.x for mass in masses], atol=1e-15)
    # From rest the work of gravity, of the second order in t, becomes kinetic energy.
    v = (x[2] - x[0]) / 2e-3
    kinetic = 0.5 * MASS * np.sum(v**2)
    work = MASS * np.sum((x[1] - x[0]) @ GRAVITY)
    # Without the rotation of the rods (1/12 of the first level's 1/3, less of others): below 5 %.
    assert kinetic == pytest.approx(work, rel=0.05)


def test_branches_lead_outward_from_the_ground():
    known = {""}
    for hinge in layout(suspension()).tree:
        assert hinge.inner in known
        known.add(hinge.outer)
    assert len(known) == 6


def test_only_hinges_along_one_direction_make_a_plane():
    assert layout(robot()).normal is None
    assert layout(read_deck(DECKS / "bricard.xml")).normal is None
    # Gravity acts along the plane of the gears, not across it.
    np.testing.assert_array_equal(layout(gear_train()).normal, [0.0, 0.0, 1.0])


def test_rates_are_those_of_the_outer_body_against_the_inner_one():
    given = layout(robot())
    assert [hinge.damping for hinge in given.tree] == list(FRICTION)
    # All links rotate with the column, so only its joint moves.
    rates = [given.rates(hinge)[0] for hinge in given.tree]
    np.testing.assert_allclose(rates, [SPIN[2], 0.0, 0.0, 0.0, 0.0, 0.0], atol=1e-15)


def test_a_mass_centre_is_found_from_the_reference_point():
    model = read_deck(DECKS / "andrews_squeezer.xml")
    K1 = layout(model).masses["K1"]
    beta, ra = -0.0617138900142764, 0.00092
    # Machine epsilons of a millimetre.
    np.testing.assert_allclose(K1.x, [ra * np.cos(beta), ra * np.sin(beta), 0.0], atol=1e-18)


@pytest.fixture
def found():
    """The gear train by two codes: errors h^6 and h^2 of runs whose seconds go as 1/h."""
    problem = Problem("gear train", gear_train(), (), 1.0, 1.0, 0.1, 10)
    made = Found(problem, Known(np.zeros(0), "two routes", 1e-12))
    for code in store.codes(problem):
        orders = {"msahl gauss3": 6, "msahl preserving": 2}
        if not isinstance(code, Refused) and code.name in orders:
            curve = Curve(problem, code, stopped="enough")
            for rung in range(3, 9):
                h = 0.1 / (rung + 1)
                error = h ** orders[code.name]
                curve.points[rung] = Point(rung, error, [1e-3 / h, 2e-3 / h], round(1 / h), 30)
            made.curves.append(curve)
    return made


def test_what_is_stored_is_read_again(found, tmp_path):
    store.save(found, [Refused("other", "no gears")], tmp_path)
    (again,) = store.load([found.problem], tmp_path)
    assert again.known.words, again.known.apart == ("two routes", 1e-12)
    assert [curve.points for curve in again.curves] == [curve.points for curve in found.curves]
    assert again.curves[0].stopped == "enough"
    assert store.refusals(found.problem, tmp_path)["other"] == "no gears"


def test_measuring_one_mechanism_again_keeps_the_others(found, tmp_path):
    store.save(found, [], tmp_path)
    other = Found(Problem("net", net(2), (), 1.0, 1.0, 0.1, 10), found.known, found.curves[:1])
    store.save(other, [], tmp_path)
    store.save(found, [], tmp_path)
    again = store.load([found.problem, other.problem], tmp_path)
    assert [len(one.curves) for one in again] == [2, 1]


def test_the_page_says_who_is_faster(found, tmp_path):
    store.save(found, [Refused("other", "no gears")], tmp_path)
    write_page(store.load([found.problem], tmp_path), ["a machine"], tmp_path)
    page = (tmp_path / PAGE).read_text()
    assert "- a machine" in page
    assert "other: no gears." in page
    assert (tmp_path / PICTURE).stat().st_size > 1000
    assert (tmp_path / MACHINE).exists()
    assert "not measured" in verdicts([found])[0].measured
