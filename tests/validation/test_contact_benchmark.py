"""The scenes with contact of the benchmarks: their true motions, their layout, what is stored."""

import math

import numpy as np
import pytest

from benchmarks.contact import creep, truth
from benchmarks.contact.codes import KEPT, codes
from benchmarks.contact.layout import Ball, Plane, damping_ratio, pairs
from benchmarks.contact.page import MACHINE, PAGE, PICTURE, reaches, verdicts, write_page
from benchmarks.contact.scenes import ABOUT, SCENES, scene
from benchmarks.curves import Curve, Point
from benchmarks.mechanisms.store import Refused, load, save
from benchmarks.precision_asked import Found
from benchmarks.reference import Known
from msahl.check import check

ROUND_OFF = 1e-14


def test_every_scene_is_described_and_sound():
    assert set(SCENES) == set(ABOUT)
    assert set(truth.CLOSED) < set(SCENES)
    for name in SCENES:
        assert check(scene(name).model) == []


def test_the_true_motions_start_where_the_bodies_are():
    for name, (_, motion) in truth.CLOSED.items():
        (body,) = scene(name).model.bodies
        np.testing.assert_allclose(motion(np.array([0.0, 0.1]))[0], body.position, atol=ROUND_OFF)


def test_the_ball_touches_the_floor_at_the_published_times():
    """Impacts and rest of decks/contact/bouncing_ball.xml, whose digits are 1e-14 s."""
    impacts = np.array([0.451523640985731, 1.1739614665629, 1.75191172702464])
    z = truth.bounces(impacts)[:, 2] - truth.RADIUS
    np.testing.assert_allclose(z, 0.0, atol=1e-12)
    assert truth.bounces(np.array([4.06, 4.0638]))[:, 2].tolist()[1] == truth.RADIUS
    # The second rebound reaches e^4 of the height, half way between two impacts.
    middle = np.array([impacts[1:].mean()])
    assert truth.bounces(middle)[0, 2] - truth.RADIUS == pytest.approx(0.8**4, rel=1e-12)


def test_the_block_stands_upright_at_the_published_times():
    impacts = np.array([0.312308575112622, 0.820592229082601, 1.25187674446184])
    x = truth.rocks(np.append(impacts, 1.4))[:-1]
    # The rate is about 1 rad/s: the times' 1e-12 s are 1e-13 m of its mass centre.
    np.testing.assert_allclose(x[:, 2], truth.HALF[1], atol=1e-11)


def test_contacts_are_spheres_on_planes_or_on_each_other():
    (sphere,) = pairs(scene("slip to roll").model)
    assert isinstance(sphere.other, Plane)
    assert (sphere.ball.radius, sphere.friction, sphere.mass) == (0.1, 0.2, 1.0)
    balls = pairs(scene("Newton's cradle").model)
    assert all(isinstance(pair.other, Ball) and pair.mass == pytest.approx(0.5) for pair in balls)
    # An impulse on a corner of the box rotates it, too: 1/m + y^2/Ixx + x^2/Iyy.
    corners = pairs(scene("box on a slope").model)
    assert [1.0 / pair.mass for pair in corners] == pytest.approx([1.0 + 1.5 + 2.4] * 4)


@pytest.mark.parametrize("restitution", [0.3, 0.8, 0.99])
def test_a_damped_spring_that_does_not_pull_rebounds_as_asked(restitution):
    """By the motion itself: x = e^(-ct) sin(wt)/w until the force 2 c x' + x has become zero."""
    c = damping_ratio(restitution)
    w = math.sqrt(1.0 - c * c)
    t = np.linspace(0.0, math.pi / w, 2_000_001)[1:]
    speed = np.exp(-c * t) * (np.cos(w * t) - c / w * np.sin(w * t))
    force = np.exp(-c * t) * np.sin(w * t) / w + 2.0 * c * speed
    left = -speed[np.flatnonzero(force <= 0.0)[0]]
    # The time step of 1.6e-6 times the acceleration, which is about 1.
    assert left == pytest.approx(restitution, abs=5e-6)
    assert (damping_ratio(0.0), damping_ratio(1.0)) == (1.0, 0.0)


@pytest.fixture
def found():
    """The slope by two codes of msahl: errors h^4 and h^2 of runs whose seconds go as 1/h."""
    problem = scene("box on a slope")
    made = Found(problem, Known(np.zeros(0), "closed form", 1e-15))
    orders = {"msahl gauss2": 4, "msahl preserving": 2}
    for code in codes(problem):
        if not isinstance(code, Refused) and code.name in orders:
            curve = Curve(problem, code, stopped="enough")
            for rung in range(3, 9):
                h = 0.1 / (rung + 1) ** 2
                error = h ** orders[code.name]
                curve.points[rung] = Point(rung, error, [1e-3 / h], round(1 / h), 30)
            made.curves.append(curve)
    return made


def test_what_is_stored_becomes_a_page(found, tmp_path):
    save(found, [Refused("other", "no friction")], tmp_path, KEPT)
    creep.save([creep.Creep("other", 0.01, 4e-6)], tmp_path)
    (again,) = load([found.problem], tmp_path, KEPT)
    assert [curve.points for curve in again.curves] == [curve.points for curve in found.curves]
    write_page([again], ["a machine"], tmp_path)
    page = (tmp_path / PAGE).read_text()
    assert "- a machine" in page
    assert "other: no friction." in page
    assert "| other | 0.01 | 4 |" in page
    assert (tmp_path / PICTURE).stat().st_size > 1000
    assert (tmp_path / MACHINE).exists()


def test_msahl_is_alone_where_no_other_program_comes_so_far(found):
    assert reaches(found, "msahl", 1e-6)
    assert not reaches(found, "mujoco", 1e-3)
    (alone,) = verdicts([found])
    assert (alone.measured, alone.met) == ("alone", True)


def test_creep_is_the_speed_after_the_middle_of_the_motion(found):
    """msahl's box does not move after it has stopped: machine epsilons of its 0.17 m over 5 s."""
    found_creep = creep.creep_of(Curve(found.problem, found.curves[0].code, {0: Point(0, 1e-9)}))
    assert found_creep is not None
    assert found_creep.speed < 1e-16
