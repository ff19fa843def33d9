"""Completely prescribed motions against closed forms, runs, and positions in higher precision."""

from dataclasses import replace
from decimal import Decimal, localcontext

import numpy as np
import pytest

from msahl.algebra.functions import Law
from msahl.algebra.rotation import matrix
from msahl.analysis.kinematics import solution as kinematics
from msahl.analysis.kinematics.solution import follow, output_times, prepare
from msahl.analysis.kinematics.tables import integrals
from msahl.analysis.kinematics.verdict import report_of
from msahl.deck import DeckError, ParsedDeck, Source, read_deck
from msahl.model import JointMotion, Options, PointMotion
from msahl.model.settings import OFF, YES
from msahl.run.loop import run
from msahl.run.tables import MemorySink, tables_of_model
from msahl.start.velocities import StartError
from tests.support.models import ROOT, deck

MECHANISMS = ROOT / "decks" / "mechanisms"
R, L = 0.1, 0.25
"""Crank and rod of decks/mechanisms/slider_crank.xml [m]."""


class Computed:
    """A motion with its tables."""

    def __init__(self, model, times=None):
        simulation = replace(model.simulation, accelerations=YES, reactions="instantaneous")
        self.model, sink = replace(model, simulation=simulation), MemorySink()
        times = output_times(model) if times is None else times
        self.motion = follow(prepare(self.model), times, sink)
        self.columns = tables_of_model(self.model)
        self.tables = {name: sink.table(name) for name in self.columns}
        self.end = times[-1]

    def __getitem__(self, column):
        for name, head in self.columns.items():
            if column in head:
                return self.tables[name][:, head.index(column)]
        raise KeyError(column)


def slider_crank(settings=(), law=None, joint="Guide"):
    """The deck with other numbers; with a ``law`` it moves the slider, not the crank."""
    model = read_deck(MECHANISMS / "slider_crank.xml", settings=settings)
    if law is None:
        return model
    coordinate = "slide" if joint == "Guide" else "angle"
    return replace(model, motions=(JointMotion("Pusher", joint, coordinate, law),))


def test_slider_crank_is_that_of_the_closed_form():
    found = Computed(slider_crank(), np.linspace(0.0, 0.6, 21))
    phi, w = np.pi / 6.0 + 10.0 * found["time"], 10.0
    c, s = R * np.cos(phi), R * np.sin(phi)
    b = np.sqrt(L**2 - s**2)
    x = c + b
    v = -w * s - w * s * c / b
    a = -(w**2) * c - w**2 * (c**2 - s**2) / b - w**2 * s**2 * c**2 / b**3
    # Lengths of 0.1 m, and condition numbers up to 16: round-off of some machine epsilons.
    assert np.abs(found["Slider.x"] - x).max() <= 1e-14
    assert np.abs(found["Slider.vx"] - v).max() <= 1e-12
    assert np.abs(found["Slider.ax"] - a).max() <= 1e-12
    assert np.abs(found["Pivot.angle"] - phi).max() <= 1e-13
    assert np.abs(found["Pivot.angleRate"] - w).max() <= 1e-12
    assert found.motion.redundant == 3
    assert found.motion.complete
    # A prediction of second order is corrected by some 1e-4 m, and corrections fall a thousandfold.
    assert found.motion.iterations <= 5 * found.motion.steps


def test_four_bar_is_freudensteins():
    found = Computed(deck("four_bar_by_angle"), np.linspace(0.0, 1.0, 21))
    a, b, c, d = 0.3, 0.9, 0.8, 1.0  # crank, coupler, rocker, ground
    phi, w = np.pi / 3.0 + 2.0 * np.pi * found["time"], 2.0 * np.pi
    # The diagonal e from the crank's pin to the rocker's pivot, and its angles there.
    px, pz = a * np.cos(phi), a * np.sin(phi)
    e = np.hypot(d - px, pz)
    psi = np.arctan2(pz, px - d) - np.arccos((e**2 + c**2 - b**2) / (2.0 * e * c))
    theta = np.arctan2(c * np.sin(psi) - pz, d + c * np.cos(psi) - px)
    psi_dot = w * a * np.sin(phi - theta) / (c * np.sin(psi - theta))
    theta_dot = w * a * np.sin(phi - psi) / (b * np.sin(psi - theta))
    psi_second = (
        a * w**2 * np.cos(phi - theta) + b * theta_dot**2 - c * psi_dot**2 * np.cos(psi - theta)
    ) / (c * np.sin(psi - theta))
    angle = -np.unwrap(psi)  # about y
    assert np.abs(np.unwrap(found["Rocker pivot.angle"]) - angle).max() <= 1e-12
    assert np.abs(found["Rocker pivot.angleRate"] + psi_dot).max() <= 1e-12
    # Accelerations up to 40 rad/s^2, known to the condition number 15 times machine epsilon.
    assert np.abs(found["Rocker pivot.angleAcceleration"] + psi_second).max() <= 1e-11


@pytest.mark.slow
def test_spatial_slider_crank_moved_at_its_crank():
    model = deck("spatial_slider_crank")
    law = Law("polynomial", (0.0, 6.0))
    model = replace(model, motions=(JointMotion("Motor", "Crank pivot", "angle", law),))
    found = Computed(model, np.linspace(0.0, 1.0, 11))
    phi, w = 6.0 * found["time"], 6.0
    y, z = 0.1 - 0.08 * np.sin(phi), 0.12 + 0.08 * np.cos(phi)
    y1, z1 = -0.08 * w * np.cos(phi), -0.08 * w * np.sin(phi)
    y2, z2 = 0.08 * w**2 * np.sin(phi), -0.08 * w**2 * np.cos(phi)
    x = np.sqrt(0.09 - y**2 - z**2)
    v = -(y * y1 + z * z1) / x
    a = -(y1**2 + y * y2 + z1**2 + z * z2 + v**2) / x
    assert np.abs(found["Slider.x"] - x).max() <= 1e-13
    assert np.abs(found["Slider.vx"] - v).max() <= 1e-12
    assert np.abs(found["Slider.ax"] - a).max() <= 1e-11


@pytest.mark.slow
def test_stewart_platform_has_the_given_leg_lengths():
    """The inverse geometry of the platform found: the distances of its joints are the laws."""
    found = Computed(deck("stewart"), np.linspace(0.0, 0.5, 5))
    legs = {"A": (10, 50), "B": (110, 70), "C": (130, 170), "D": (230, 190), "E": (250, 290),
            "F": (350, 310)}  # fmt: skip
    x = np.stack([found[f"Platform.{c}"] for c in "xyz"], axis=1)
    P = np.stack([found[f"Platform.P{k}"] for k in (1, 2, 3)], axis=1)
    for motion in found.model.motions:
        b, p = np.deg2rad(legs[motion.name[0]])
        foot = 0.6 * np.array([np.cos(b), np.sin(b), 0.0])
        head = 0.4 * np.array([np.cos(p), np.sin(p), 0.0])
        tops = x + np.array([np.array(matrix(tuple(row))) @ head for row in P])
        lengths = np.linalg.norm(tops - foot, axis=1)
        amplitude, omega, phase, _ = motion.law.numbers
        start = np.linalg.norm(head - foot + np.array([0.0, 0.0, 0.8]))
        wanted = start + amplitude * (np.sin(omega * found["time"] + phase) - np.sin(phase))
        assert np.abs(lengths - wanted).max() <= 4e-15
    assert found.motion.redundant == 0


def test_tables_of_markers_and_groups_are_those_of_a_run():
    found = Computed(deck("markers"), np.linspace(0.0, 0.1, 6))
    simulation = replace(
        found.model.simulation, scheme="gauss", degree=3, dt=2e-3, t_final=0.1, output_interval=0.02
    )
    sink = MemorySink()
    run(replace(found.model, simulation=simulation), Options(error=OFF), sink)
    for name in ("markers", "system", "joints"):
        assert np.abs(found.tables[name] - sink.table(name)).max() <= 1e-11


def test_too_many_bodies_are_refused(monkeypatch):
    monkeypatch.setattr(kinematics, "MOST_BODIES", 12)
    with pytest.raises(StartError, match=r"13 bodies; motions of up to 12"):
        prepare(deck("stewart"))


def test_motion_and_reactions_are_those_of_a_run_with_small_steps():
    model = slider_crank()
    found = Computed(model, np.linspace(0.0, 0.1, 11))
    simulation = replace(
        found.model.simulation, scheme="gauss", degree=3, dt=1e-3, t_final=0.1, output_interval=0.01
    )
    sink = MemorySink()
    run(replace(found.model, simulation=simulation), Options(error=OFF), sink)
    for name, tolerance in (("states", 1e-11), ("accelerations", 1e-9), ("joints", 1e-9)):
        assert np.abs(found.tables[name] - sink.table(name)).max() <= tolerance
    columns = [
        k for k, c in enumerate(found.columns["reactions"]) if not c.endswith(("Fy", "Mx", "Mz"))
    ]
    difference = found.tables["reactions"] - sink.table("reactions")
    assert np.abs(difference[:, columns]).max() <= 1e-8  # of 100 N
    # By quadrature through six of eleven output times, of a work of 0.9 J.
    assert np.abs(found.tables["work"] - sink.table("work")).max() <= 1e-5


@pytest.mark.slow
def test_error_bars_hold_against_higher_precision():
    """Near a dead point of the slider-crank that is moved at its slider."""
    law = Law("polynomial", (0.0, 0.1))
    x0 = R * np.cos(np.pi / 6.0) + np.sqrt(L**2 - (R * np.sin(np.pi / 6.0)) ** 2)
    for left in (1e-2, 1e-8):
        end = (R + L - x0) / 0.1 * (1.0 - left)
        found = Computed(slider_crank(law=law), np.array([0.0, end]))
        with localcontext(prec=40):
            r, rod, speed = Decimal(R), Decimal(L), Decimal("0.1")
            x = r * Decimal(3).sqrt() / 2 + (rod**2 - r**2 / 4).sqrt() + speed * Decimal(float(end))
            cosine = (r**2 + x**2 - rod**2) / (2 * r * x)
            sine = (1 - cosine**2).sqrt()
            height, rate = r * sine / 2, (r * cosine - x) * speed / (x * r * sine)
        errors = found.motion.errors
        assert abs(found["Crank.z"][-1] - float(height)) <= errors.position
        assert abs(found["Pivot.angleRate"][-1] - float(rate)) * L <= errors.velocity
        # Not much too large either.
        assert errors.position <= 1e4 * max(abs(found["Crank.z"][-1] - float(height)), 1e-17)


@pytest.mark.slow
def test_dead_points_are_found_between_output_times():
    """Crank and rod of equal length: the slider is at 2 r cos phi, with phi = 30 deg + 3 t."""
    law = Law("sine", (2.0 * R, 3.0, np.pi / 2.0 + np.pi / 6.0, 0.0))
    found = Computed(slider_crank(("l=0.1 m",), law), np.linspace(0.0, 1.0, 21))
    known = (np.array([np.pi / 2.0, np.pi]) - np.pi / 6.0) / 3.0
    singular = found.motion.singular
    assert [s.limit for s in singular] == [False, False]
    assert np.abs([s.time for s in singular] - known).max() <= 1e-12
    assert all(s.uncertainty <= 1e-11 for s in singular)
    phi = np.pi / 6.0 + 3.0 * found["time"]
    # The branch is kept: the crank rotates on.
    assert np.abs(found["Pivot.angle"] - phi).max() <= 1e-12
    folded, stretched = report_of(found.motion, 1.0).warnings
    # Folded, the rod rotates with the crank about its pivot; stretched, pin and crank move.
    assert "Crank" in folded
    assert "Rod" in folded
    assert "Slider" not in folded
    assert "Pusher" in stretched
    assert "t = 0.872664625997" in stretched
    assert report_of(found.motion, 1.0).verdict["word"] == "WARN"


@pytest.mark.parametrize(("start", "phase"), [(180, 270), (0, 90), (180, 270.0 + 360e3)])
def test_a_motion_that_begins_at_a_dead_point_contradicts_nothing(start, phase):
    """Its rate is that of a sine at its crest: round-off of the phase, however large it is."""
    text = (MECHANISMS / "dead_points.xml").read_text()
    read = ParsedDeck(Source.of(text.replace(">120</phase>", f">{phase}</phase>")))
    model = read.model((f"start={start} deg",))
    assert max(np.abs(body.velocity).max() for body in model.bodies) <= 1e-9
    with pytest.raises(StartError, match="singular"):
        prepare(model)


def test_a_motion_that_contradicts_a_dead_point_is_a_fault():
    text = (MECHANISMS / "dead_points.xml").read_text().replace(">120</phase>", ">269.9</phase>")
    with pytest.raises(DeckError, match="rates and velocities contradict it"):
        ParsedDeck(Source.of(text)).model(("start=180 deg",))


def test_dead_points_of_two_mechanisms_at_once_are_found():
    """Two singular values pass through zero together, so the determinant keeps its sign."""
    law = Law("sine", (2.0 * R, 3.0, np.pi / 2.0 + np.pi / 6.0, 0.0))
    model = slider_crank(("l=0.1 m",), law)

    def second(name):
        return name if name == "Base" else f"{name} 2"

    twice = replace(
        model,
        bodies=(*model.bodies, *(replace(b, name=second(b.name)) for b in model.bodies)),
        joints=(
            *model.joints,
            *(
                replace(j, name=second(j.name), parent=second(j.parent), child=second(j.child))
                for j in model.joints
            ),
        ),
        motions=(
            *model.motions,
            *(replace(m, name=second(m.name), joint=second(m.joint)) for m in model.motions),
        ),
    )
    found = Computed(twice, np.linspace(0.0, 0.5, 6))
    (folded,) = found.motion.singular
    assert folded.time == pytest.approx(np.pi / 9.0, abs=1e-11)
    (text,) = report_of(found.motion, 0.5).warnings
    assert all(name in text for name in ("Crank", "Crank 2", "Rod", "Rod 2"))


def test_motions_that_contradict_each_other_are_named():
    model = slider_crank()
    pushed = JointMotion("Pusher", "Guide", "slide", Law("polynomial", (0.0, 0.1)))
    with pytest.raises(StartError, match=r"contradict .* Motor, .*Pusher"):
        prepare(replace(model, motions=(*model.motions, pushed)))


@pytest.mark.slow
def test_an_output_time_at_a_dead_point_has_no_row():
    law = Law("sine", (2.0 * R, np.pi / 3.0, np.pi / 2.0 + np.pi / 6.0, 0.0))
    found = Computed(slider_crank(("l=0.1 m",), law), np.linspace(0.0, 2.0, 21))
    assert found.motion.omitted == [1.0]  # phi = 90 deg at 1 s
    assert found.motion.rows == 20
    assert np.abs(found["Pivot.angle"] - np.pi / 6.0 - np.pi / 3.0 * found["time"]).max() <= 1e-11


@pytest.mark.slow
def test_the_end_of_reach_is_named():
    x0 = R * np.cos(np.pi / 6.0) + np.sqrt(L**2 - (R * np.sin(np.pi / 6.0)) ** 2)
    found = Computed(slider_crank(law=Law("polynomial", (0.0, 0.1))), np.linspace(0.0, 0.5, 26))
    (limit,) = found.motion.singular
    assert limit.limit
    assert limit.time == pytest.approx((R + L - x0) / 0.1, abs=1e-12)
    assert not found.motion.complete
    assert found["time"][-1] == pytest.approx(0.18)
    report = report_of(found.motion, 0.5)
    assert report.status == "not converged"
    assert "limit position at t = 0.184484853432" in report.message


@pytest.mark.slow
def test_a_flattened_parallelogram_keeps_its_branch():
    """Equal cranks and a coupler as long as the ground: flat at 180 degrees, where the rocker could
    turn back (an antiparallelogram)."""
    model = deck("four_bar_by_angle")
    joints = {joint.name: joint for joint in model.joints}
    crank, coupler, rocker = model.bodies
    half, base = 0.15, 0.9
    up = (np.cos(np.pi / 3.0), 0.0, np.sin(np.pi / 3.0))

    def at(*parts):
        return tuple(float(x) for x in np.sum(parts, axis=0))

    along = tuple(half * x for x in up)
    bodies = (
        replace(crank, position=along),
        replace(coupler, position=at(along, along, (base / 2, 0, 0)), orientation=(0.0, 0.0, 0.0)),
        replace(rocker, position=at(along, (base, 0, 0)), orientation=crank.orientation),
    )
    joints = tuple(
        {
            "Crank pivot": joint,
            "Crank pin": joint,
            "Rocker pin": replace(joint, child_point=(half, 0.0, 0.0)),
            "Rocker pivot": replace(
                joint, parent_point=(base, 0.0, 0.0), child_point=(-half, 0.0, 0.0)
            ),
        }[joint.name]
        for joint in model.joints
    )
    found = Computed(replace(model, bodies=bodies, joints=joints), np.linspace(0.0, 1.0, 14))
    assert [s.time for s in found.motion.singular] == pytest.approx(
        [1.0 / 3.0, 5.0 / 6.0], abs=1e-12
    )  # at 180 and 360 degrees
    assert np.abs(found["Coupler.P2"]).max() <= 1e-12


def test_incompletely_prescribed_motions_are_refused():
    with pytest.raises(StartError, match=r"1 degree of freedom remains; .*angle of 'Crank pivot'"):
        prepare(deck("spatial_slider_crank"))
    with pytest.raises(StartError, match=r"6 degrees of freedom remain.*slide of 'A\.Cylinder'"):
        prepare(replace(deck("stewart"), motions=()))


def test_motions_that_follow_from_rates_are_refused():
    model = read_deck(MECHANISMS / "rolling_disk.xml")
    with pytest.raises(StartError, match=r"3 degrees of freedom remain; Disk can move"):
        prepare(model)
    still = Law("constant", (0.0,))
    motions = tuple(
        PointMotion(f"P{k}", "Disk", point, direction, still)
        for k, (point, direction) in enumerate(
            (((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
             ((0.1, 0.2, 0.3), (1.0, 0.0, 0.0)))
        )
    )  # fmt: skip
    with pytest.raises(StartError, match=r"2 of the positions follow from rates alone"):
        prepare(replace(model, motions=motions))


def test_works_are_integrated_exactly_to_degree_five():
    times = np.array([0.0, 0.1, 0.3, 0.35, 0.6, 0.7, 0.9, 1.0])
    found = integrals(times, np.stack([times**5, np.ones_like(times)], axis=1))
    assert np.abs(found - np.stack([times**6 / 6.0, times], axis=1)).max() <= 1e-14
    assert integrals(times[:2], times[:2, None])[1, 0] == pytest.approx(0.005)
