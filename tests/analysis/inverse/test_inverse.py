"""Inverse dynamics gives back the loads of forward runs, and says what it cannot give."""

import re

import numpy as np
import pytest

import msahl
from msahl.algebra.rotation_arrays import product
from msahl.algebra.vector import ZERO
from msahl.analysis.inverse import solution
from msahl.analysis.inverse.drives import InverseError
from msahl.analysis.inverse.given import Measures
from msahl.analysis.inverse.solution import inverse
from msahl.analysis.inverse.splines import derived
from msahl.analysis.inverse.table import Track, motion_of_table, spins
from msahl.analysis.inverse.verdict import verdict
from msahl.analysis.kinematics import configuration
from msahl.analysis.linearised.point import at_start
from msahl.model import Joint
from tests.support.models import GROUND, ROOT, body, build_model
from tests.support.models import friction as rubbing

DECKS = ROOT / "decks"
ABOUT_Y = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
"""x, y and z of a joint about the axis y."""
FOUR_BAR = DECKS / "machines/motor_four_bar.xml"
ROBOT = DECKS / "machines/robot.xml"
STEWART = DECKS / "mechanisms/stewart_actuators.xml"
CART_POLE = DECKS / "machines/cart_pole.xml"
LEGS = [f"{leg}.Cylinder.slide" for leg in "ABCDEF"]
JOINTS = [f"J{k}.angle" for k in range(1, 7)]


def forward(model, h, t_final, scheme):
    return model.run(scheme=scheme, dt=h, output_interval=h, t_final=t_final, error="off")


def table(run, names):
    """The columns of coordinates of a run, with their rates."""
    heads = [*names, *(f"{name}Rate" for name in names)]
    return {"time": run.time} | {head: run[head] for head in heads}


def loads(run, names):
    return np.stack([run[f"{name}.load"] for name in names], axis=1)


def errors(deck, names, motors, scheme, steps, longest):
    """Largest errors of the loads of runs with these steps and half of them, but for five times at
    each end, where splines are less accurate; and whether all are within the error bars.
    """
    model, found = msahl.load(deck), []
    for parts in (1, 2):
        run = forward(model, longest / parts, steps * longest, scheme)
        solution = model.inverse(table(run, names)).solution
        wrong = np.abs(solution.rows.loads - loads(run, motors))
        inner = slice(5 * parts, -5 * parts)
        found.append((wrong[inner].max(), np.all(wrong <= solution.rows.error)))
    return found


@pytest.mark.slow
def test_loads_of_a_four_bar_at_the_order_of_gauss():
    (coarse, _), (fine, _) = errors(FOUR_BAR, ["Shaft.angle"], ["Motor"], "gauss2", 14, 0.002)
    # That of gauss2 or of the derivative of splines of degree 5, 5 to 6.
    assert 3.5 < np.log2(coarse / fine) < 7.0


# What is left of the ends' errors falls exponentially with their number, so orders
# of accurate schemes come out larger.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("scheme", "least", "most"),
    [("preserving", 1.5, 2.5), ("gauss2", 3.5, 7.5), ("gauss3", 5.0, 12.0)],
)
@pytest.mark.parametrize(
    ("deck", "names", "motors", "h"),
    [
        (ROBOT, JOINTS, [f"Motor {k}" for k in range(1, 7)], 0.02),
        (STEWART, LEGS, [f"{leg} force" for leg in "ABCDEF"], 0.02),
        (FOUR_BAR, ["Shaft.angle"], ["Motor"], 0.002),
    ],
)
def test_loads_at_the_order_of_the_scheme(deck, names, motors, h, scheme, least, most):
    (coarse, _), (fine, within) = errors(deck, names, motors, scheme, 20, h)
    assert least < np.log2(coarse / fine) < most
    if scheme == "gauss3":  # whose own errors are smaller than those of splines
        assert within


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["preserving", "gauss2"])
@pytest.mark.parametrize(
    ("deck", "names", "motors", "h"),
    [
        (FOUR_BAR, ["Shaft.angle"], ["Motor"], 0.002),
        (STEWART, LEGS, [f"{leg} force" for leg in "ABCDEF"], 0.01),
    ],
)
def test_error_bars_with_a_companion_contain_the_error_of_the_run(deck, names, motors, h, scheme):
    model = msahl.load(deck)
    run, companion = (forward(model, step, 20 * h, scheme) for step in (h, h / 2))
    exact = model.run(scheme="gauss5", dt=h / 2, output_interval=h, t_final=20 * h, error="off")
    found = model.inverse(table(run, names), companion=table(companion, names)).solution
    # Against the loads of the exact motion; those of the run differ from them as its motion does.
    wrong = np.abs(found.rows.loads - loads(exact, motors))
    assert np.all(wrong <= found.rows.error)


@pytest.mark.slow
def test_error_bars_contain_the_error_that_a_run_estimated(tmp_path):
    model = msahl.load(FOUR_BAR)
    run = model.run(dt=0.002, output_interval=0.002, t_final=0.05)
    exact = forward(model, 0.002, 0.05, "gauss5")
    run.write(tmp_path / "run")
    for motion in (run, tmp_path / "run", tmp_path / "run/joints.csv"):
        rows = model.inverse(motion).solution.rows
        for other in (run, exact):
            assert np.all(np.abs(rows.loads - loads(other, ["Motor"])) <= rows.error)
    # The table alone shows nothing of this error.
    alone = model.inverse({"time": run.time, "Shaft.angle": run["Shaft.angle"]}).solution
    assert not np.all(np.abs(alone.rows.loads - loads(exact, ["Motor"])) <= alone.rows.error)


@pytest.mark.slow
def test_a_run_without_an_estimated_error_warns_unless_it_has_accelerations():
    model = msahl.load(FOUR_BAR)
    run = forward(model, 0.001, 0.03, "gauss3")
    assert "the error of the run was not estimated" in model.inverse(run).reasons[0]
    full = model.run(
        scheme="gauss3", dt=0.001, output_interval=0.001, t_final=0.03, accelerations="yes",
        error="off",
    )  # fmt: skip
    assert model.inverse(full).verdict == "PASS"


@pytest.mark.slow
def test_loads_of_a_robot_within_their_error_bars():
    motors = [f"Motor {k}" for k in range(1, 7)]
    model = msahl.load(ROBOT)
    run = forward(model, 0.01, 0.1, "gauss3")
    found = model.inverse(table(run, JOINTS)).solution
    assert np.all(np.abs(found.rows.loads - loads(run, motors)) <= found.rows.error)
    # Ends of splines through eleven rows; the largest torque is 20 N m.
    assert found.rows.error.max() < 0.05
    assert found.unique.all()
    assert found.degrees_of_freedom == found.rank == 6


@pytest.mark.slow
def test_the_stewart_platform_ends_where_its_header_says():
    run = msahl.load(STEWART).run(scheme="gauss3", dt=0.02, error="off")
    (place,) = re.findall(r"\(([-\d., ]+)\) m", STEWART.read_text().partition("-->")[0])
    expected = [float(number) for number in place.split(",")]
    assert [run[f"Platform.{axis}"][-1] for axis in "xyz"] == pytest.approx(expected, abs=1e-7)


@pytest.mark.slow
def test_loads_of_a_stewart_platform_by_its_states_and_accelerations():
    model = msahl.load(STEWART)
    run = model.run(scheme="gauss3", dt=0.02, t_final=0.14, accelerations="yes", error="off")
    found = model.inverse(run)
    motors = [f"{leg} force" for leg in "ABCDEF"]
    # Accelerations of a run follow from the same equations: only round-off is left.
    assert np.abs(found.solution.rows.loads - loads(run, motors)).max() < 1e-9 * 300.0
    assert found["Platform.z"] == pytest.approx(run["Platform.z"], abs=1e-13)
    assert found["A.Foot.Fz"] == pytest.approx(run["A.Foot.Fz"], abs=1e-8)
    assert all(found.unique.values())


@pytest.mark.slow
def test_two_motors_on_a_four_bar_share_the_load_at_the_least_norm():
    model = msahl.load(FOUR_BAR)
    run = model.run(scheme="gauss3", dt=0.005, t_final=0.05, accelerations="yes", error="off")
    names = ["Motor", "Rocker pivot.angle"]
    rates = np.stack([run["Shaft.angleRate"], run["Rocker pivot.angleRate"]], axis=1)[1:]
    for weights in ({}, {"Motor": 3.0}):
        found = model.inverse(run, names, weights).solution
        square = np.array([weights.get(name, 1.0) ** 2 for name in names])
        # The power is unique; u of least sum w^2 u^2 is proportional to the rates over w^2.
        power = run["Motor.power"][1:]
        least = power[:, None] * (rates / square) / np.sum(rates**2 / square, axis=1)[:, None]
        assert found.rows.loads[1:] == pytest.approx(least, abs=1e-8 * 6.0)
        assert not found.unique.any()
        assert found.rank == found.degrees_of_freedom == 1
        # With other shares of the motors the reactions in the plane are others, too.
        assert "Fx" in found.non_unique_reactions["Rocker pin"]
    alone = model.inverse(run).solution
    assert alone.unique.all()
    assert "Fx" not in alone.non_unique_reactions["Rocker pin"]


def test_a_motion_that_the_drives_cannot_produce_fails():
    model = msahl.load(CART_POLE)
    run = model.run(scheme="gauss3", dt=0.01, t_final=0.2, accelerations="yes", error="off")
    own = model.inverse(run)
    assert own.verdict == "PASS"
    assert (own.solution.rank, own.solution.degrees_of_freedom) == (1, 2)
    assert own["Motor.load"] == pytest.approx(run["Motor.load"], abs=1e-8)
    names = [name for name in run.columns("joints") if name.endswith((".angle", ".slide"))]
    still = {"time": run.time} | {name: np.full(run.time.size, run[name][0]) for name in names}
    held = model.inverse(still)
    assert held.verdict == "FAIL"
    assert "cannot be produced" in held.reasons[0]
    assert "Pole" in held.reasons[0]


@pytest.mark.parametrize(
    ("deck", "drive", "near"),
    [
        ("forces/friction_hinge.xml", "Axle.angle", 1e-10),
        ("forces/torsional_spring.xml", "Axle.angle", 1e-10),
        ("forces/slide_spring.xml", "Rail.slide", 1e-8),
        ("forces/actuator_pid.xml", "Rail.slide", 1e-8),  # its law has an auxiliary state
        ("joints/screw.xml", "Thread.angle", 1e-10),
    ],
)
def test_a_drive_beside_all_other_forces_has_nothing_to_do(deck, drive, near):
    model = msahl.load(DECKS / deck)
    h = model.records.simulation.dt
    run = forward(model, h, 12 * h, "gauss3")
    found = model.inverse(table(run, [drive]), [drive]).solution
    assert np.abs(found.rows.loads[3:-3]).max() < near
    assert verdict(found).word == "PASS"


def test_torques_of_a_level_arm_at_rest():
    """Of five rods of 1 m and 1 kg: each hinge carries the moments of the weights beyond it."""
    rods = 5
    inertia = np.diag([1e-3, 1.0 / 12.0, 1.0 / 12.0])
    bodies = [body(f"L{k}", 1.0, inertia, (k + 0.5, 0.0, 0.0)) for k in range(rods)]
    names = [GROUND.name, *(rod.name for rod in bodies)]
    ends = [((0.5 if k else 0.0, 0.0, 0.0), (-0.5, 0.0, 0.0)) for k in range(rods)]
    joints = [
        Joint(f"J{k}", "revolute", names[k], names[k + 1], *ends[k], ABOUT_Y, ABOUT_Y)
        for k in range(rods)
    ]
    model = build_model(bodies, joints, gravity=(0.0, 0.0, -9.81))
    angles = [f"J{k}.angle" for k in range(rods)]
    still = np.zeros((8, rods + 1))
    still[:, 0] = 0.1 * np.arange(8)
    found = inverse(model, motion_of_table(["time", *angles], still, model, "table"), angles)
    expected = [-9.81 * sum(j - k + 0.5 for j in range(k, rods)) for k in range(rods)]
    assert found.rows.loads[4] == pytest.approx(expected, rel=1e-13)
    assert np.all(found.rows.power == 0.0)


def test_friction_of_an_arm_is_by_the_reactions_of_the_same_time():
    """They change by some newtons from row to row, and friction is added to what the motor does."""
    mass, length, speed, friction = 2.0, 0.5, 6.0, 0.03
    rod = body("Arm", mass, 0.1, (length, 0.0, 0.0))
    hinge = Joint("J", "revolute", GROUND.name, "Arm", ZERO, (-length, 0.0, 0.0), ABOUT_Y, ABOUT_Y)
    rub = rubbing("Rub", "J", "angle", 0.3, friction / 0.3, 1e-3)
    model = build_model([rod], [hinge], [rub], gravity=(0.0, 0.0, -9.81))
    time = 0.1 * np.arange(10)
    motion = motion_of_table(["time", "J.angle"], np.stack([time, speed * time], 1), model, "table")
    found = inverse(model, motion, ["J.angle"]).rows.loads[:, 0]
    c, s = np.cos(speed * time), np.sin(speed * time)
    force = mass * np.hypot(speed**2 * length * c, speed**2 * length * s + 9.81)
    assert np.abs(np.diff(force)).max() > 5.0
    assert found == pytest.approx(friction * force - 9.81 * mass * length * c, abs=1e-10)


def test_actuators_that_are_not_named_keep_their_laws():
    """The motor's current is an auxiliary state; a motor at the rocker has nothing to add."""
    model = msahl.load(FOUR_BAR)
    run = model.run(scheme="gauss3", dt=0.002, t_final=0.04, accelerations="yes", error="off")
    found = model.inverse(run, ["Rocker pivot.angle"])
    # But for the step of order 5 of the current, which is 1e-6 A off.
    assert np.abs(found.solution.rows.loads[3:]).max() < 1e-5
    assert found["Motor.load"] == pytest.approx(run["Motor.load"], abs=1e-5)


@pytest.mark.parametrize(
    ("deck", "motion"), [("joint_motion_sine", "Motor"), ("point_motion", "Shaker")]
)
def test_loads_of_prescribed_motions(deck, motion):
    model = msahl.load(DECKS / f"forces/{deck}.xml")
    h = model.records.simulation.dt
    run = forward(model, h, 12 * h, "gauss3")
    found = model.inverse(run)
    assert found.solution.rows.loads[3:-3, 0] == pytest.approx(
        run[f"{motion}.load"][3:-3], rel=1e-6
    )
    assert found[f"{motion}.power"] == pytest.approx(run[f"{motion}.power"], abs=1e-4)


@pytest.mark.slow
def test_work_and_energy_agree_with_the_run():
    model = msahl.load(FOUR_BAR)
    run = model.run(scheme="gauss3", dt=0.002, t_final=0.06, accelerations="yes", error="off")
    found = model.inverse(run)
    assert found["Motor.work"] == pytest.approx(run["Motor.work"], abs=1e-6)
    # A step of order 5 over 0.4 times the time constant of the current.
    assert found["current"] == pytest.approx(run["current"], abs=3e-6)
    checks = found.report["verdict"]["checks"]
    assert checks["energyBalance"]["word"] == "PASS"


@pytest.mark.slow
def test_the_place_of_its_platform_determines_all_legs():
    model = msahl.load(STEWART)
    run = forward(model, 0.02, 0.16, "gauss3")
    by_body = ["Platform.x", "Platform.y", "Platform.z", *(f"Platform.P{i}" for i in (1, 2, 3))]
    given = {"time": run.time} | {name: run[name] for name in by_body}
    found = model.inverse(given).solution
    assert np.abs(found.rows.misfit).max() < 1e-12
    assert found.degrees_of_freedom == 6


def test_the_pose_of_its_flange_determines_a_robot():
    model = msahl.load(ROBOT)
    run = forward(model, 0.01, 0.07, "gauss3")
    ends = ("x", "y", "z", "vx", "vy", "vz", "q0", "q1", "q2", "q3", "wx", "wy", "wz")
    pose = {"time": run.time} | {f"Flange.{end}": run[f"Flange.{end}"] for end in ends}
    found = model.inverse(pose)
    assert np.all(
        np.abs(found.solution.rows.loads - loads(run, [f"Motor {k}" for k in range(1, 7)]))
        <= found.solution.rows.error
    )
    for name in JOINTS:
        assert found[name] == pytest.approx(run[name], abs=1e-11)


def test_states_are_not_copied_at_each_row(monkeypatch):
    """Compiled functions lay out the arrays of a state anew for each copy: a third of the time."""
    made = []
    monkeypatch.setattr(
        solution, "copied", lambda state: made.append(1) or configuration.copied(state)
    )
    time = np.linspace(0.0, 0.1, 21)
    msahl.load(FOUR_BAR).inverse({"time": time, "Shaft.angle": time**3})
    # The start, two that are used again at each row, and three rows whose uniqueness is examined.
    assert len(made) == 6


@pytest.mark.slow
def test_noise_is_smoothed():
    model = msahl.load(FOUR_BAR)
    run = forward(model, 0.004, 0.1, "gauss3")
    rng = np.random.default_rng(3)
    noise = 1e-5
    noisy = {"time": run.time, "Shaft.angle": run["Shaft.angle"] + noise * rng.normal(size=26)}
    rough, smooth = (model.inverse(noisy, smooth=size).solution for size in (0.0, noise))
    inner = slice(5, -5)
    wrong = [np.abs(s.rows.loads[:, 0] - run["Motor.load"])[inner].max() for s in (rough, smooth)]
    assert wrong[1] < 0.2 * wrong[0]
    assert wrong[1] < smooth.rows.error[inner].max()


@pytest.mark.parametrize("rows", [26, 101, 401, 1001])
@pytest.mark.parametrize("noise", [1e-6, 1e-4, 1e-2])
def test_errors_of_smoothed_accelerations_are_within_their_bars(rows, noise):
    """Of two vibrations, with noise of its own sample for each."""
    time = np.linspace(0.0, 2.0, rows)
    exact = -9.0 * np.sin(3.0 * time) - 14.7 * np.sin(7.0 * time + 1.0)
    outside, largest = [], []
    for seed in range(5):
        error = noise * np.random.default_rng(seed).normal(size=rows)
        values = np.sin(3.0 * time) + 0.3 * np.sin(7.0 * time + 1.0) + error
        track = Track("J.angle", "J", "joint", "angle", values[:, None])
        used, *others = (way.accelerations[:, 0] for way in derived(time, track, noise))
        bar = 2.0 * np.max([np.abs(other - used) for other in others], axis=0)
        outside.append(np.mean(np.abs(used - exact) > bar))
        largest.append((np.abs(used - exact) / bar).max())
        # Bars are of use: the errors are not lost in them.
        assert np.median(bar / np.abs(used - exact)) < 400.0
    # Three standard deviations; what a spline cannot follow is estimated by another one.
    assert np.mean(outside) < 0.02
    assert max(largest) < 1.7


def test_jacobian_and_drift_of_the_given_values_against_differences():
    """Of an angle, a slide and a point, along a motion with velocities and accelerations."""
    model = msahl.load(ROBOT)
    run = model.run(scheme="gauss3", dt=1e-3, t_final=8e-3, accelerations="yes", error="off")
    point = at_start(model.records)
    names = [*JOINTS, "Flange.x", "Flange.y", "Flange.z"]
    columns = {"time": run.time} | {name: run[name] for name in names}
    given = motion_of_table(list(columns), np.stack(list(columns.values()), 1), model.records, "")
    measures = Measures(model.records, point.system, given.tracks)
    found = inverse(model.records, given)
    assert measures.size == 9
    assert np.abs(found.rows.misfit).max() < 1e-13
    assert found.tables.accelerations[4] == pytest.approx(
        run.array("accelerations")[4, 1:], abs=1e-3
    )


def test_spins_of_quaternions():
    """A body that spins at 2 rad/s about an axis that rotates: w and alpha by differences."""
    t = np.linspace(0.0, 1.0, 201)[:, None]
    zero = np.zeros_like(t)
    spin = np.concatenate([np.cos(t), zero, zero, np.sin(t)], axis=1)
    swing = np.concatenate([np.cos(0.3 * t**2), np.sin(0.3 * t**2), zero, zero], axis=1)
    track = Track("B", "B", "body", "orientation", product(spin, swing))
    smooth = derived(t[:, 0], track, 0.0)[0]
    w, alpha = spins(smooth.values, smooth.rates, smooth.accelerations)
    angle, rate = 0.6 * t[:, 0] ** 2, 1.2 * t[:, 0]
    expected = np.stack([rate, 2.0 * np.sin(angle), 2.0 * np.cos(angle)], axis=1)
    assert w == pytest.approx(expected, abs=1e-9)
    change = np.stack(
        [1.2 + 0.0 * angle, 2.0 * rate * np.cos(angle), -2.0 * rate * np.sin(angle)], axis=1
    )
    assert alpha[5:-5] == pytest.approx(change[5:-5], abs=1e-7)


def made(**changes):
    """A table of the four-bar's crank at rest, with changes of its columns."""
    columns = {"time": 0.01 * np.arange(10.0), "Shaft.angle": np.full(10, 1.0)}
    return {name: values for name, values in (columns | changes).items() if values is not None}


@pytest.mark.parametrize(
    ("columns", "message"),
    [
        (made(time=None), "no column 'time'"),
        (made(time=0.01 * np.arange(10.0)[::-1]), "times must increase"),
        (made(time=1.0 + np.arange(10.0)), "begin at 0"),
        (made(**{"Shaft.angle": np.full(10, np.nan)}), "row 1: Shaft.angle is nan"),
        (made(**{"Shaft.angel": np.ones(10)}), "did you mean Shaft.angle"),
        ({name: column[:5] for name, column in made().items()}, "5 rows"),
        (made(**{"Shaft.angle": 4.0 * np.arange(10)}), "half a revolution"),
        (made(**{"Shaft.angle": None}), "no column determines"),
        (made(time=1e-300 * np.arange(10.0), **{"Shaft.angle": np.arange(10.0)}), "infinite"),
        (made(**{"Shaft.angle": None, "Crank.x": np.zeros(10)}), "not determined"),
    ],
)
def test_tables_with_faults(columns, message):
    model = msahl.load(FOUR_BAR)
    with pytest.raises(InverseError, match=message):
        model.inverse(columns)


def test_values_that_contradict_the_joints_fail():
    """The rocker stands elsewhere than the crank lets it."""
    found = msahl.load(FOUR_BAR).inverse(made(**{"Rocker pivot.angle": np.full(10, 2.5)}))
    assert found.verdict == "FAIL"
    assert "contradict" in found.reasons[0]


def test_bodies_that_are_not_determined_are_named():
    with pytest.raises(InverseError, match=r"1 of 2 degrees .* motion of Pole") as raised:
        msahl.load(CART_POLE).inverse(
            {
                "time": 0.01 * np.arange(10.0),
                "Slide.slide": np.zeros(10),
            }
        )
    assert "Cart" not in str(raised.value)


@pytest.mark.parametrize(
    ("names", "weights", "message"),
    [
        (["Motr"], {}, "did you mean Motor"),
        (["Motor", "Motor"], {}, "named twice"),
        (["Motor"], {"Shaft": 1.0}, "not one of the drives Motor"),
        (["Motor"], {"Motor": 0.0}, "not a number above zero"),
    ],
)
def test_names_and_weights_with_faults(names, weights, message):
    with pytest.raises(InverseError, match=message):
        msahl.load(FOUR_BAR).inverse(made(), names, weights)


def test_a_model_without_drives_asks_for_loads():
    """A table of positions of bodies says nothing of motors."""
    model = msahl.load(DECKS / "forces/slide_spring.xml")
    name, still = model.records.bodies[0].name, np.zeros(10)
    table = {"time": 0.01 * np.arange(10.0), **{f"{name}.{c}": still for c in "xyz"}}
    with pytest.raises(InverseError, match="--loads, such as"):
        model.inverse(table)


def test_a_companion_needs_the_same_times():
    other = made(time=0.013 * np.arange(10.0))
    with pytest.raises(InverseError, match="the same times"):
        msahl.load(FOUR_BAR).inverse(made(), companion=other)


def test_beams_are_refused():
    """Coordinates of rigid bodies do not determine how they bend."""
    with pytest.raises(InverseError, match=r"has beams.*run the deck with msahl run"):
        msahl.load(DECKS / "elastic/bend45.xml").inverse(
            {
                "time": 0.01 * np.arange(10.0),
                "Tip.x": np.zeros(10),
            }
        )
