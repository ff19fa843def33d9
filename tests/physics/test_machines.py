"""Machines with actuators, feedback and states, against independent integrations.

Each deck of decks/machines is compared with equations of motion in minimal coordinates, written and
integrated without msahl (tests/physics/machines). Errors are those of all bodies at the end: the
largest of positions [m] and of entries of rotation matrices.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise
from types import ModuleType

import numpy as np
import pytest
from click.testing import CliRunner

from msahl.cli.main import main
from msahl.deck import read_deck
from msahl.post.cli import main as post
from msahl.run.verdict import PASS
from msahl.system.names import signal_columns
from tests.physics.machines import (
    cart_pole,
    engine,
    motor_four_bar,
    quarter_car,
    robot,
    satellite,
)
from tests.support.models import ROOT, deck
from tests.support.models import simulate_and_estimate as simulate
from tools import robot_deck

ORDERS = {"preserving": 2.0, "gauss2": 4.0, "gauss3": 6.0}


@dataclass(frozen=True)
class Machine:
    """A deck with its reference, the time to compare at, and the coarsest step by scheme."""

    reference: ModuleType
    t: float
    steps: Mapping[str, float]
    tolerance: float = 1e-6


MACHINES = {
    "robot": Machine(robot, 0.5, {"preserving": 0.01, "gauss2": 0.05, "gauss3": 0.05}),
    "engine": Machine(engine, 0.04, {"preserving": 5e-4, "gauss2": 1e-3, "gauss3": 1e-3}),
    "quarter_car": Machine(
        quarter_car, 1.0, {"preserving": 2.5e-3, "gauss2": 2.5e-3, "gauss3": 5e-3}
    ),
    "satellite": Machine(satellite, 10.0, {"preserving": 5e-3, "gauss2": 0.05, "gauss3": 0.1}),
    "cart_pole": Machine(cart_pole, 1.0, {"preserving": 0.01, "gauss2": 0.05, "gauss3": 0.05}),
    "motor_four_bar": Machine(
        motor_four_bar, 0.2, {"preserving": 2e-3, "gauss2": 5e-3, "gauss3": 8e-3}
    ),
}
CASES = [(name, scheme) for name in MACHINES for scheme in ORDERS]


@cache
def known(name, t):
    """Positions and axes of all bodies at ``t``, by the reference."""
    reference = MACHINES[name].reference
    y = reference.motion([t])[0]
    return reference.places(y, t) if name == "satellite" else reference.places(y)


def error(run, places, row=-1):
    """Largest difference of positions [m] and of entries of rotation matrices."""
    found = 0.0
    for b, body in enumerate(run.model.bodies):
        x, R = places[body.name]
        found = max(found, np.abs(run.of("position", b)[row] - x).max())
        found = max(found, np.abs(run.matrices(b)[row] - R).max())
    return found


def errors(name, scheme, count=3):
    """Errors at the coarsest step of a scheme and ``count`` - 1 halved ones, and the last run."""
    machine, found = MACHINES[name], []
    # In joint coordinates a satellite's error is round-off at once, at steps in which its wheels
    # rotate no further than these allow.
    full = name == "satellite"
    for k in range(count):
        h = machine.steps[scheme] / 2**k
        run = simulate(deck(name), dt=h, t_final=machine.t, scheme=scheme, full=full, error="off")
        assert run.report.status == "completed"
        found.append(error(run, known(name, machine.t)))
    return found, run


def slopes(found):
    return [float(np.log2(a / b)) for a, b in pairwise(found)]


@pytest.mark.slow
@pytest.mark.sampled
@pytest.mark.parametrize(("name", "scheme"), CASES, ids=["-".join(case) for case in CASES])
def test_a_machine_is_approached_with_the_order_of_the_scheme(name, scheme):
    smooth = name != "engine" or scheme == "preserving"
    found, run = errors(name, scheme, 3 if smooth else 4)
    order = ORDERS[scheme]
    if smooth:
        # The next power of the step makes up a tenth of the error at the last steps but one.
        assert slopes(found)[-1] == pytest.approx(order, abs=0.02 if order == 2.0 else 0.35), found
    else:
        # The third derivative of the spline of the gas force jumps at its entries, which leaves
        # h^4 times how far inside a step they are: the slope scatters, about 4 or more.
        assert np.log2(found[0] / found[-1]) / 3.0 > 3.7, found
    if scheme == "preserving":
        # Round-off of hundreds of steps: actuators and states are within the balance.
        assert run.report.extremes["energyErrorMaxRelative"] < 1e-12
    assert run.report.extremes["constraintViolationMax"] < 1e-13


@pytest.mark.parametrize("name", [name for name in MACHINES if name != "engine"])
def test_order_ten_agrees_with_the_reference_to_its_accuracy(name):
    machine = MACHINES[name]
    h = machine.steps["preserving"]
    run = simulate(deck(name), dt=h, t_final=machine.t / 2, scheme="gauss5", error="off")
    # The references have a relative error of 1e-11; the wheels of the satellite rotate by 30 rad.
    assert error(run, known(name, machine.t / 2)) < 2e-11


@pytest.mark.parametrize("scheme", ["gauss2", "gauss3"])
def test_the_engine_with_a_smooth_gas_force_has_the_full_order(scheme, monkeypatch, tmp_path):
    """The mechanism of the deck under an expression instead of the table."""

    class Smooth:
        x = engine.TABLE.x

        def __call__(self, theta):
            return 11000.0 * np.exp(8.0 * (np.cos(theta / 2.0 - 0.2) - 1.0))

    monkeypatch.setattr(engine, "TABLE", Smooth())
    text = (ROOT / "decks" / "machines" / "engine.xml").read_text()
    gas = "-gas('Main bearing'.angle)"
    assert gas in text
    smooth = text.replace(gas, "-11000*exp(8*(cos('Main bearing'.angle/2 - 0.2) - 1))")
    path = tmp_path / "engine.xml"
    path.write_text(smooth)
    (row,) = engine.motion([0.04])
    found = [
        error(simulate(read_deck(path), dt=h, t_final=0.04, scheme=scheme), engine.places(row))
        for h in (1e-3, 5e-4)
    ]
    assert slopes(found) == pytest.approx([ORDERS[scheme]], abs=0.35), found


@pytest.mark.parametrize("name", MACHINES)
def test_the_tolerance_bounds_the_error_of_a_machine(name):
    machine, model = MACHINES[name], deck(name)
    given = replace(model.simulation, scheme="auto", tolerance=machine.tolerance)
    # Half the time beside the end: outputs must not end steps where they are.
    run = simulate(replace(model, simulation=given), dt=machine.t / 10, t_final=machine.t)
    assert run.report.verdict["word"] == PASS, run.report.verdict["reasons"]
    for row in (5, 10):
        places = known(name, float(run.time[row]))
        off = max(
            np.linalg.norm(run.of("position", b)[row] - places[body.name][0])
            for b, body in enumerate(run.model.bodies)
        )
        assert off <= run.report.error["position"] <= machine.tolerance


def test_the_current_of_the_motor_is_that_of_its_circuit():
    machine = MACHINES["motor_four_bar"]
    (row,) = motor_four_bar.motion([machine.t])
    found = []
    for h in (2.5e-4, 1.25e-4):
        run = simulate(deck("motor_four_bar"), dt=h, t_final=machine.t, error="off")
        column = signal_columns(run.model).index("current")
        found.append(abs(run.signals[-1, column] - row[2]))
    # The states' own term, of order 3, is 1 % of the error.
    assert slopes(found) == pytest.approx([2.0], abs=0.03)


@pytest.mark.slow
def test_a_payload_unknown_to_the_controller():
    """Half a kilogram at the tool: the robot sags, as its equations of motion say."""
    model = deck("robot")
    loaded = tuple(
        replace(body, mass=body.mass + 0.5) if body.name == "Tool" else body
        for body in model.bodies
    )
    t, heavier = 0.3, robot.heavier(0.5)
    (row,) = robot.motion([t], links=heavier)
    rotations, _, points = robot.kinematics(row[:6], heavier)
    places = dict(zip(robot.NAMES, zip(points, rotations, strict=True), strict=True))
    found = [
        error(simulate(replace(model, bodies=loaded), dt=h, t_final=t, scheme="gauss3"), places)
        for h in (0.05, 0.025)
    ]
    assert slopes(found) == pytest.approx([6.0], abs=0.5)
    assert error(simulate(model, dt=0.025, t_final=t, scheme="gauss3"), places) > 0.01


def test_the_robot_is_what_its_tool_writes():
    assert (ROOT / "decks" / "machines" / "robot.xml").read_text() == robot_deck.deck()


def test_the_satellite_keeps_its_angular_momentum():
    """The wheels take what the bus gives: about the mass centre of all, at every step."""
    run = simulate(deck("satellite"), dt=0.02, t_final=20.0, error="off")
    masses = np.array([body.mass for body in run.model.bodies])
    x = np.array([run.of("position", b) for b in range(4)])
    R = [run.matrices(b) for b in range(4)]
    v = np.array([np.einsum("tij,tj->ti", R[b], run.of("velocity", b)) for b in range(4)])
    centre, rate = np.tensordot(masses, x, 1) / masses.sum(), np.tensordot(masses, v, 1)
    assert np.abs(rate - rate[0]).max() < 1e-13 * masses.sum()
    momentum = np.zeros_like(centre)
    for b, body in enumerate(run.model.bodies):
        spin = np.einsum("tij,jk,tk->ti", R[b], body.inertia, run.of("spin", b))
        momentum += spin + np.cross(x[b] - centre, body.mass * v[b])
    # Round-off of 1000 steps; the wheels alone have ten times as much at their fastest.
    assert np.abs(momentum - momentum[0]).max() < 1e-12


def test_the_commands_read_a_machine(tmp_path):
    """Results with signals: a verdict, and works of actuators within the energy balance."""
    path = ROOT / "decks" / "machines" / "cart_pole.xml"
    run = CliRunner().invoke(main, ["run", str(path), "-o", str(tmp_path / "run")])
    assert run.exit_code == 0, run.output
    assert "PASS" in run.output
    head = (tmp_path / "run" / "work.csv").read_text().splitlines()[0].split(",")
    assert "Motor.work" in head
    energy = CliRunner().invoke(post, ["energy", str(tmp_path / "run")])
    assert energy.exit_code == 0, energy.output
