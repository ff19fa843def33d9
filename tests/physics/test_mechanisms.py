"""Complete mechanisms: published numbers, redundant loops, assembly, starts that are refused."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import ZERO
from msahl.cli.main import main
from msahl.model import Joint, JointMotion, Law
from msahl.run.subsystem import SubsystemIntegrator
from msahl.start.velocities import StartError
from tests.support.models import (
    GROUND,
    build_model,
    deck,
    pendulum,
)
from tests.support.models import body as new_body
from tests.support.models import (
    simulate_and_estimate as simulate,
)

DECKS = Path(__file__).parents[2] / "decks"

BETA, THETA = 15.81077119629904, -15.75637105984298
"""Andrews' squeezer at 0.03 s: Hairer and Wanner, Solving ODEs II; beta starts at BETA_0."""
BETA_0 = -0.0617138900142764


def rotated(run, body):
    """Angle about z from the start, counted over all revolutions, at the end."""
    R = run.matrices(body)
    angle = np.unwrap(np.arctan2(R[:, 1, 0], R[:, 0, 0]))
    return angle[-1] - angle[0]


@pytest.mark.slow
def test_andrews_squeezer_comes_to_its_reference_with_order_two():
    model = deck("andrews_squeezer")
    names = [body.name for body in model.bodies]
    found = []
    for h in (4e-5, 2e-5, 1e-5, 5e-6):
        run = simulate(model, dt=h, t_final=0.03, solver="newton")
        beta = BETA_0 + rotated(run, names.index("K1"))
        found.append((beta, BETA_0 + rotated(run, names.index("K2")) - beta))
        assert run.report.extremes["energyErrorMaxRelative"] < 1e-10
        assert run.report.extremes["constraintViolationMax"] < 1e-13
        # All that comes in is the moment's work, and a term that vanishes with the step.
        works = [run.column(f"{load.name}.work")[-1] for load in model.loads]
        assert max(works) == pytest.approx(0.033 * (beta - BETA_0), rel=1e-4)
    errors = np.abs(np.subtract(found, (BETA, THETA)))
    assert errors[-1].max() < 3e-5
    orders = np.log2(errors[:-1] / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.1)
    best = (4 * np.array(found[-1]) - found[-2]) / 3
    assert best == pytest.approx((BETA, THETA), abs=1e-7)


def test_bricards_mechanism_keeps_its_energy_and_its_joints():
    run = simulate(deck("bricard"), dt=0.01, t_final=10.0)
    report, extremes = run.report, run.report.extremes
    assert report.status == "completed"
    assert report.degrees_of_freedom == {"byCount": 0, "byRank": 1}
    assert list(report.non_unique_reactions) == [joint.name for joint in run.model.joints]
    assert "P1: Fx, Fy, Fz" in report.verdict["checks"]["reactions"]["text"]
    assert report.verdict["checks"]["reactions"]["word"] == "PASS"
    # It falls and comes back: the kinetic energy is what is exchanged.
    assert extremes["largestKineticEnergy"] > 1.0
    assert extremes["energyErrorMaxRelative"] < 1e-9
    assert extremes["constraintViolationMax"] < 1e-10


def test_the_stiff_governor_runs_at_large_steps():
    run = simulate(deck("flyball_governor"), dt=0.01, t_final=10.0)
    assert (run.report.status, run.report.subdivisions) == ("completed", 0)
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-9
    assert run.report.extremes["constraintViolationMax"] < 1e-10
    assert run.report.degrees_of_freedom["byCount"] == run.report.degrees_of_freedom["byRank"]


def test_forces_of_a_four_bar_are_unique_in_its_plane():
    """Its hinges' axes are along y. With a ball joint and a line in place of two hinges nothing is
    redundant, and the motion and the forces in the plane are the same.
    """
    model = deck("four_bar")
    run = simulate(model, dt=0.01, t_final=1.0)
    assert run.report.degrees_of_freedom == {
        "byCount": -3,
        "byRank": run.report.degrees_of_freedom["byRank"],
    }
    assert run.report.non_unique_reactions == {j.name: ["Fy", "Mx", "Mz"] for j in model.joints}
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-10
    kinds = ("revolute", "pointOnLine", "spherical", "revolute")
    joints = tuple(replace(j, kind=kind) for j, kind in zip(model.joints, kinds, strict=True))
    simple = simulate(replace(model, joints=joints), dt=0.01, t_final=1.0, full=True)
    assert simple.report.non_unique_reactions == {}
    for j in range(4):
        known = simple.force(j)[:, ::2]
        # Forces carry the round-off of a step's places, 1e-16 m, times 2 m/h^2.
        assert run.force(j)[:, ::2] == pytest.approx(known, abs=1e-9 * np.abs(known).max())


def test_reactions_that_cease_to_be_unique_during_the_motion():
    """A door on two hinges, of which one would do; their axis, along x at first, is carried round.

    Hinges bear no moment about their axis, so Mx is unique until the axis has rotated.
    """
    X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    frame = new_body("Frame", 2.0, 0.1, position=X)
    door = new_body("Door", 1.0, (0.1, 0.1, 0.2), position=(1.0, 0.5, 0.0))
    joints = [Joint("Post", "revolute", GROUND.name, "Frame", ZERO, (-1.0, 0.0, 0.0))]
    for name, x in (("H1", -0.4), ("H2", 0.4)):
        ends = ((x, 0.0, 0.0), (x, -0.5, 0.0))
        joints.append(Joint(name, "revolute", "Frame", "Door", *ends, (Y, Z, X), (Y, Z, X)))
    rotation = JointMotion("Rotation", "Post", "angle", Law("polynomial", (0.0, 1.0)))
    model = build_model([frame, door], joints, gravity=(0.0, 0.0, -9.8), motions=(rotation,))
    at_first = SubsystemIntegrator(model, "newton", full=False, chunk=1).shared
    assert at_first == {name: ["Fx", "Fy", "Fz", "My", "Mz"] for name in ("H1", "H2")}
    later = simulate(model, dt=0.01, t_final=0.5).report.non_unique_reactions
    assert later == {name: ["Fx", "Fy", "Fz", "Mx", "My", "Mz"] for name in ("H1", "H2")}


def shaken(model, size, seed=0):
    """The model with its bodies a little out of place."""
    rng = np.random.default_rng(seed)
    bodies = []
    for body in model.bodies:
        rotation = from_axis_angle(tuple(rng.normal(size=3).tolist()), size * rng.normal())
        place = np.add(body.position, size * rng.normal(size=3))
        bodies.append(
            replace(
                body,
                position=tuple(place.tolist()),
                orientation=compose(rotation, body.orientation),
            )
        )
    return replace(model, bodies=tuple(bodies))


@pytest.mark.parametrize("name", ["four_bar", "spatial_slider_crank", "bricard"])
def test_a_loop_given_about_right_is_closed(name):
    model = replace(shaken(deck(name), 0.003), position="project")
    run = simulate(model, dt=0.005, t_final=0.1)
    (told,) = [w for w in run.report.warnings if "was removed" in w]
    assert "constraint violation of 0.0" in told
    for body in model.bodies:
        assert f"body '{body.name}' by " in told
    # Closed from the first row on; Bricard's also slips along its degree of freedom.
    assert run.report.extremes["constraintViolationMax"] < 1e-11
    for b in range(len(model.bodies)):
        moved = run.of("position", b)[0] - model.bodies[b].position
        assert 0.0 < np.linalg.norm(moved) < 0.3


def test_a_deck_drawn_by_hand_is_closed_and_told(tmp_path):
    path = DECKS / "mechanisms" / "four_bar_sketched.xml"
    out = tmp_path / "run"
    result = CliRunner().invoke(main, ["run", str(path), "--t-final", "0.5", "-o", str(out)])
    assert result.exit_code == 0, result.output
    told = "moving body 'Crank' by 0.00612 m and 0.00846 rad, body 'Coupler' by 0.00467 m"
    assert told in result.stderr
    assert any(
        told in warning for warning in json.loads((out / "run.json").read_text())["warnings"]
    )
    states = pd.read_csv(out / "states.csv")
    ends = {}
    for name, half in (("Crank", 0.15), ("Coupler", 0.45), ("Rocker", 0.4)):
        p = states[[f"{name}.P{i}" for i in (1, 2, 3)]].to_numpy()
        x = np.array([matrix(tuple(row))[i][0] for row in p for i in (0, 2)]).reshape(-1, 2)
        G = states[[f"{name}.x", f"{name}.z"]].to_numpy()
        ends[name] = G - half * x, G + half * x
    # Links as long as the deck says, end to end, from the first row on.
    for first, second in (("Crank", "Coupler"), ("Coupler", "Rocker")):
        assert ends[first][1] == pytest.approx(
            ends[second][0 if second == "Coupler" else 1], abs=1e-12
        )
    assert ends["Crank"][0] == pytest.approx(np.zeros((251, 2)), abs=1e-12)
    assert ends["Rocker"][0] == pytest.approx(np.tile([1.0, 0.0], (251, 1)), abs=1e-12)


def test_a_loop_that_cannot_be_closed_is_refused():
    model = deck("four_bar")
    far = replace(model.joints[-1], child_point=(9.0, 0.0, 0.0))
    model = replace(model, joints=(*model.joints[:-1], far), position="project")
    with pytest.raises(StartError, match="joints cannot be closed"):
        simulate(model, dt=0.01, t_final=0.01)


def spun(**others):
    """A pendulum whose bob is given a spin and no velocity."""
    bob = replace(pendulum().bodies[0], angular_velocity=(0.0, 1.0, 0.0))
    return replace(pendulum(), bodies=(bob,), **others)


def test_velocities_may_be_refused():
    with pytest.raises(StartError, match='velocity="refuse"'):
        simulate(spun(velocity="refuse"), dt=0.01, t_final=0.01)


def test_velocities_may_be_left_as_given():
    bob = replace(pendulum().bodies[0], velocity=(0.0, 0.0, 1.0))  # along its rod
    run = simulate(replace(pendulum(), bodies=(bob,), velocity="asGiven"), dt=0.01, t_final=1.0)
    assert run.of("velocity")[0].tolist() == [0.0, 0.0, 1.0]
    (told,) = run.report.warnings
    assert "constraints by 1 m/s and were left as given" in told
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-11
    # Joints are closed in position all the same; velocities alternate by what did not fit.
    assert run.report.extremes["constraintViolationMax"] < 1e-13
    along = run.of("velocity")[:, 2]
    assert along == pytest.approx((-1.0) ** np.arange(101), abs=1e-2)


def test_velocities_may_be_kept_in_angle_or_changed_by_mass():
    kept = simulate(spun(velocity="keepAngular"), dt=0.01, t_final=0.01)
    assert kept.of("spin")[0] == pytest.approx((0.0, 1.0, 0.0), abs=1e-14)
    assert np.linalg.norm(kept.of("velocity")[0]) == pytest.approx(5.0, rel=1e-12)
    free = simulate(spun(velocity="massWeighted"), dt=0.01, t_final=0.01)
    # Angular momentum about the pivot is kept: J w = (J + m L^2) w'.
    rate = 0.008 / (0.008 + 2.0 * 25.0)
    assert free.of("spin")[0] == pytest.approx((0.0, rate, 0.0), abs=1e-14)
    assert np.linalg.norm(free.of("velocity")[0]) == pytest.approx(5.0 * rate, rel=1e-12)
    assert "smallest change, weighted by mass" in free.report.warnings[0]


def test_four_corners_from_one_file_move_as_two_masses():
    """Expect: in the header of the deck, by the matrix exponential of a quarter of the car."""
    model = deck("suspension")
    ends = []
    for h in (0.001, 0.0005):
        run = simulate(model, dt=h, t_final=1.0, every=1000)
        ends.append(run.of("position", 0)[-1])
        corners = np.array([run.of("position", b)[-1] for b in range(1, 5)])
        # The corners differ by the round-off of their places alone.
        assert np.ptp(corners[:, 2]) < 1e-12
    assert (4 * ends[1] - ends[0]) / 3 == pytest.approx((0.0, 0.0, 0.7963125954), abs=2e-9)
