"""Steps chosen by a tolerance: what they promise is kept, and how they are chosen is reported."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import msahl.run.loop
from msahl.algebra.vector import ZERO
from msahl.cli.main import main
from msahl.deck import check_simulation
from msahl.events.margins import Span
from msahl.expressions.syntax import parse
from msahl.model import (
    ConcentratedLoad,
    Joint,
    JointActuator,
    Options,
    SignalState,
    SpringDamper,
    resolve,
)
from msahl.model.settings import OFF
from msahl.run.attempts import Attempts
from msahl.run.conclusion import longest_step
from msahl.run.loop import Hooks, TimeLoop
from msahl.run.setup import build_setup
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.tables import MemorySink
from msahl.schemes.collocation.step_control import convergence
from msahl.schemes.collocation.stepper import CollocationMethod
from msahl.schemes.collocation.tree.stages import STEPS
from msahl.schemes.fixed_stepper import FixedStepper
from msahl.system.evaluate import prepare
from tests.run.test_resume import advance, bits, in_two_parts
from tests.support.closed_forms import recognise
from tests.support.models import (
    DECKS,
    GROUND,
    body,
    build_model,
    deck,
)
from tests.support.models import (
    simulate_and_estimate as simulate,
)
from tests.system.test_nonfinite import push

SINGLE = next(path for path in DECKS if path.stem == "single_pendulum_45")


def adaptive(model, tolerance, scheme="auto", degree=3, **others):
    """``model`` with steps by the local ``tolerance``."""
    given = {"scheme": scheme, "degree": degree, "local_tolerance": tolerance, **others}
    return replace(model, simulation=replace(model.simulation, **given))


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
def test_the_tolerance_is_met_and_not_by_far(tolerance):
    """The single pendulum's errors grow with time, but not more than they are added up."""
    run = simulate(adaptive(deck("single_pendulum_45"), tolerance), dt=0.1, t_final=10.0)
    exact = recognise(run.model).states(run.time)
    wrong = np.abs(run.states[:, 1:] - exact).reshape(-1, 4, 3).max(axis=(0, 2))
    assert wrong[0] <= tolerance
    own = run.report.extremes["localErrorSum"]
    # Sizes aim a little below their share, and grow to it from one pair to the next.
    assert 0.01 * tolerance <= own <= tolerance
    assert run.report.verdict["word"] == "PASS", run.report.verdict["reasons"]
    assert len(run.time) == 101


def test_a_tenth_of_the_tolerance_costs_little_more():
    """Work, in steps by degree, of order at least 6: 10^(1/6) is 1.5 times the steps at most."""
    steps = [
        simulate(
            adaptive(deck("double_pendulum_89"), tolerance, "gauss", 3), dt=0.02, t_final=4.0
        ).report.steps
        for tolerance in (1e-6, 1e-7, 1e-8)
    ]
    assert steps[0] < steps[1] < steps[2]
    # The last digit of a run's count is of where its sizes happen to fall.
    assert steps[2] <= 1.1 * steps[0] * 100 ** (1 / 6)


@pytest.mark.parametrize("full", [True, False])
def test_degrees_are_chosen_and_told(full):
    """In joint coordinates, where all degrees take about as long, that of the tolerance stays in so
    short a run; in absolute ones it is reviewed.
    """
    told = {}
    for tolerance in (1e-2, 1e-10):
        model = adaptive(deck("double_pendulum_89"), tolerance)
        report = simulate(model, dt=0.02, t_final=3.0, full=full).report
        control = report.step_control
        assert control["localTolerance"] == tolerance
        assert 2 * control["acceptedPairs"] == report.steps
        assert control["stepMin"] <= control["stepMax"]
        for choice in control["degrees"]:
            assert min(choice["work"], key=choice["work"].get) == str(choice["degree"])
        told[tolerance] = control["degrees"][-1]["degree"]
    assert told[1e-2] < told[1e-10] if full else told == {1e-2: 3, 1e-10: 4}


def test_steps_shrink_where_motion_is_quick_and_grow_again():
    """The triple pendulum's violent moments."""
    report = simulate(adaptive(deck("triple_pendulum_135"), 1e-6), dt=0.02, t_final=4.0).report
    assert report.status == "completed"
    assert report.step_control["rejectedPairs"] > 0
    assert report.step_control["stepMin"] < 0.3 * report.step_control["stepMax"]
    assert report.extremes["constraintViolationMax"] <= 1e-12


@pytest.mark.parametrize(
    ("name", "tolerance", "t_final", "most"),
    [
        ("conical_pendulum", 1e-3, 5.0, 1500),
        ("double_pendulum_89", 1e-9, 4.0, 600),
        ("torque_free", 1e-9, 5.0, 1650),
        ("spring_damper", 1e-6, 5.0, 420),
    ],
)
def test_few_pairs_are_refused_and_few_iterations_needed(name, tolerance, t_final, most):
    """A third to a half of all pairs was refused and 260 to 520 iterations, 160 of the linear
    spring, were needed where sizes grew at once to those refused before, no pair was lent what
    those before left, and the long step was predicted by the step before. These are those in
    joint coordinates, by the mass matrix: two to three times as many as by Newton's method, and
    in the conical pendulum and the free body, whose steps are as long as they converge there, six
    times, each a twentieth of the time. Of pairs that are refused because they do not converge
    there is one in six or seven, as sizes grow by 5 % from 0.75 of the last one.
    """
    model = adaptive(deck(name), tolerance)
    report = simulate(model, dt=0.01, t_final=t_final, error=OFF).report
    control = report.step_control
    assert control["rejectedPairs"] <= (1 / 6 if most < 1000 else 1 / 5) * control["acceptedPairs"]
    assert report.iterations <= most


def wheel(speed=0.0, moment=0.0, **others):
    """A wheel of 1 kg m^2 on an axle along z under a constant moment."""
    bob = body("Wheel", inertia=(1.0, 1.0, 1.0), angular_velocity=(0.0, 0.0, speed))
    axle = Joint("Axle", "revolute", GROUND.name, bob.name, ZERO, ZERO)
    load = ConcentratedLoad("Motor", bob.name, ZERO, ZERO, GROUND.name, (0.0, 0.0, moment),
                            GROUND.name)  # fmt: skip
    return build_model([bob], [axle], [load], **others)


def test_a_step_rotates_bodies_by_less_than_counting_of_revolutions_needs():
    """1.5 rad in a pair of steps: a wheel at constant speed has no error that would limit them."""
    model, speed = wheel(speed=20.0), 20.0
    run = simulate(adaptive(model, 1e-3), dt=0.01, t_final=1.0)
    assert run.report.step_control["stepMax"] == pytest.approx(0.75 / speed, rel=1e-12)
    # One revolution more or less would be 6.28 rad.
    assert run.others["joints"][-1, 1] == pytest.approx(speed, abs=0.01)


def test_a_step_in_which_a_body_begins_to_rotate_is_limited_as_well():
    """From rest the speed at the start of a pair limits nothing, that at its end does."""
    acceleration = 200.0
    model = adaptive(wheel(moment=acceleration), 1e-1, scheme="gauss")
    run = simulate(model, dt=0.2, t_final=0.4)
    # The error of gauss3 is 2.5e-5 rad at these steps; a revolution not counted would be 6.28 rad.
    assert run.others["joints"][-1, 1] == pytest.approx(0.08 * acceleration, abs=1e-4)


def test_steps_do_not_depend_on_the_clock(monkeypatch):
    model = adaptive(deck("double_pendulum_89"), 1e-6, t_final=2.0)
    _, complete = advance(model, Options())
    monkeypatch.setattr(msahl.run.loop, "CHUNK_SECONDS", 0.0)
    _, parts = advance(model, Options())
    assert bits(parts) == bits(complete)


@pytest.mark.parametrize("tolerance", ["tolerance", "local_tolerance"])
def test_a_run_by_tolerance_goes_on_bit_for_bit(monkeypatch, tolerance):
    given = {"local_tolerance": None, tolerance: 1e-6}
    model = adaptive(deck("double_pendulum_89"), 1e-6, t_final=2.0)
    model = replace(model, simulation=replace(model.simulation, **given))
    complete, rows = advance(model, Options())
    (_, first), (rest, second) = in_two_parts(monkeypatch, model, Options(), 6, 2)
    assert bits(first, second) == bits(rows)
    assert rest.step_control == complete.step_control
    assert rest.error == complete.error


def test_the_companion_halves_every_step():
    run = simulate(adaptive(deck("double_pendulum_89"), 1e-4), dt=0.02, t_final=3.0, accuracy=1e-3)
    # At half the step the error of degree 2 or more is a sixteenth at most.
    own = run.report.extremes["localErrorSum"]
    assert run.report.error["trustHorizon"] == 3.0
    assert 0.0 < run.report.error["position"] <= 50.0 * own


@pytest.mark.parametrize("name", ["double_pendulum_89", "four_bar"])
def test_a_companion_takes_steps_of_all_sizes_in_one_call(monkeypatch, name):
    """The same steps, bit for bit, as by a call for each size."""
    model = adaptive(deck(name), 1e-6, t_final=1.0)
    calls = []
    of_all_sizes = FixedStepper.take_varied

    def counted(self, sizes, first, schedule):
        last = of_all_sizes(self, sizes, first, schedule)
        calls.append((len(sizes), last))
        return last

    monkeypatch.setattr(FixedStepper, "take_varied", counted)
    report, rows = advance(model, Options())
    assert report.subdivisions == 0
    # One call for each chunk; 2 steps for every step of the run.
    assert all(first == last for first, last in calls)
    assert sum(first for first, _ in calls) == 2 * report.steps
    assert len(calls) <= 3
    monkeypatch.setattr(FixedStepper, "take_varied", lambda self, sizes, first, schedule: first)
    assert bits(advance(model, Options())[1]) == bits(rows)


def test_degrees_share_what_does_not_depend_on_them():
    """Steps of degree 3 are the same to the bit after steps of degree 4 were taken."""

    def steps_of(degrees):
        model = adaptive(deck("double_pendulum_89"), None, "gauss")
        one = SubsystemIntegrator(model, "newton", full=False, chunk=8)
        tree = (one.formulation.tree, one.formulation.cut)
        method = CollocationMethod(one.workspace, "gauss", degrees[0], Span(1.0, 0.0), None, tree)
        for degree in degrees:
            method.set_degree(degree)
            before = [array.copy() for array in one.workspace.state]
            assert method.take_step(0.05, 1.0).converged
            after = [array.copy() for array in one.workspace.state]
            for array, value in zip(one.workspace.state, before, strict=True):
                array[...] = value
            prepare(one.workspace.system, one.workspace.state, one.workspace.start)
        return method, after

    alone, both = steps_of([3]), steps_of([3, 4, 3])
    for one, other in zip(alone[1], both[1], strict=True):
        assert np.array_equal(one, other)
    by_degree = both[0].by_degree
    assert by_degree[3].instant is by_degree[4].instant
    assert by_degree[3].stages.start is by_degree[4].stages.start
    assert by_degree[3].stages.Z is not by_degree[4].stages.Z


@pytest.mark.parametrize(
    ("name", "tolerance", "most"),
    [
        ("double_pendulum_89", 1e-3, 75),
        ("double_pendulum_89", 1e-6, 75),
        ("four_bar", 1e-3, 105),
        ("four_bar", 1e-6, 110),
    ],
)
def test_runs_to_a_tolerance_take_few_steps_and_all_in_joint_coordinates(name, tolerance, most):
    """Steps solved, those refused and those of the companion counted, in one run: 61 to 96,
    of which 14 to 24 are the run's. Steps that do not converge are made shorter: one in absolute
    coordinates takes as long as twenty others.
    """
    simulation = replace(deck(name).simulation, scheme="auto", tolerance=tolerance, t_final=2.0)
    model = replace(deck(name), simulation=simulation)
    settings = resolve(simulation, Options())
    setup = build_setup(model, settings, Attempts(settings))
    report = TimeLoop(setup, MemorySink(), Hooks()).run(None)
    assert report.verdict["word"] == "PASS", report.verdict["reasons"]
    assert max(report.error["position"], report.error["orientation"]) <= tolerance
    solved = 0
    for integrator in setup.all_integrators:
        in_tree = [one.tree.figures[STEPS] for one in integrator.stepper.method.by_degree.values()]
        solved += integrator.workspace.counts[1]
        assert sum(in_tree) == integrator.workspace.counts[1]
    assert solved <= most


def test_steps_too_long_for_joint_coordinates_are_made_shorter_three_times():
    """Where they do not converge then, either, absolute coordinates solve them."""
    model = adaptive(deck("double_pendulum_89"), 1e3)
    run = simulate(model, dt=20.0, t_final=20.0, error=OFF)
    assert run.report.status == "completed"
    assert run.report.step_control["rejectedPairs"] > 0


@pytest.mark.parametrize(
    ("error", "order"), [(1e-14, 8.0), (4.0**-9, 8.0), (2.0**-9, 4.0), (1.0, 4.0), (9.0, 4.0)]
)
def test_long_steps_are_not_taken_to_have_their_order_yet(error, order):
    """Errors over the length of the body, which goes with h^9: at a quarter of the size that has
    an error of 1 the order is 8, at half of it 4.
    """
    subsystem = SimpleNamespace(
        workspace=SimpleNamespace(
            system=SimpleNamespace(frames=SimpleNamespace(length=np.array([2.0, 1.0])))
        )
    )
    assert convergence(subsystem, 8, 2.0 * error) == pytest.approx(order)


def test_subsystems_go_together():
    run = simulate(adaptive(deck("two_pendulums"), 1e-6), dt=0.05, t_final=2.0)
    assert run.report.status == "completed"
    assert run.report.subsystems == 1
    assert run.report.extremes["energyErrorMaxRelative"] < 1e-6


def test_nothing_that_moves_takes_few_steps():
    """Round-off is no reason for small steps."""
    still = deck("single_pendulum_45")
    bob = still.bodies[0]
    hanging = replace(bob, position=(0.0, 0.0, 5.0), orientation=(0.0, 0.0, 0.0))
    report = simulate(
        adaptive(replace(still, bodies=(hanging,)), 1e-12), dt=0.1, t_final=10.0
    ).report
    assert report.status == "completed"
    assert report.steps <= 60


def hanging(damping, preload):
    """A body at rest on a spring of 100 N/m, 2 m below where it is attached."""
    bob = body("Bob", position=(0.0, 0.0, -2.0))
    free = 2.0 - (9.81 * bob.mass + preload) / 100.0
    spring = SpringDamper("Spring", GROUND.name, bob.name, ZERO, ZERO, 100.0, damping, free)
    down = ConcentratedLoad("Down", bob.name, ZERO, (0.0, 0.0, -preload), GROUND.name, ZERO,
                            GROUND.name)  # fmt: skip
    return build_model([bob], [], [spring, down], gravity=(0.0, 0.0, -9.81))


@pytest.mark.parametrize(
    ("damping", "preload", "tolerance"), [(5.0, 0.0, 1e-6), (0.0, 50.0, 1e-9), (5.0, 50.0, 1e-9)]
)
def test_works_of_a_body_at_rest_cost_no_steps(damping, preload, tolerance):
    """Works and kinetic energy are both rounding errors there."""
    model = adaptive(hanging(damping, preload), tolerance)
    report = simulate(model, dt=0.01, t_final=2.0).report
    assert report.status == "completed"
    # Sizes treble from 0.01 s: some six pairs; with works over energy, 10^4 and more.
    assert report.steps <= 30
    assert report.verdict["word"] == "PASS", report.verdict["reasons"]


RATE, ANGLE = "J0.angleRate", "J0.angle"


NOISE = [
    (f"({RATE} - z)/0.01", "2*z"),
    (f"({RATE} - z)/1e-5", "5*z"),
    (f"100*{RATE}", f"5*{RATE}"),
    (f"({ANGLE} + 0.3 - 0.3 - {ANGLE} - z)/0.01", f"5*{RATE} + z"),
]
"""Rates of a state, and loads, that are rounding errors in a model at rest."""


def chain_at_rest(rate, load, change=lambda: 1.0):
    """A chain of three bodies that hangs in a skew direction, with dampers and a state z. Every
    number is multiplied by its own ``change``.
    """
    angle, lengths = 0.3 * change(), [change() for _ in range(3)]
    down = np.array([np.cos(angle), np.sin(angle), 0.0])
    middles = np.cumsum(lengths) - 0.5 * np.array(lengths)
    bodies = [
        body(f"B{k}", inertia=0.02 * change(), position=tuple(middles[k] * down)) for k in range(3)
    ]
    names = [GROUND.name, "B0", "B1", "B2"]
    ends = [ZERO, *(tuple(0.5 * length * down) for length in lengths)]
    joints = [
        Joint(f"J{k}", "revolute", names[k], names[k + 1], ends[k], tuple(-np.array(ends[k + 1])))
        for k in range(3)
    ]
    loads = [
        JointActuator(f"A{k}", f"J{k}", "angle", parse(text))
        for k, text in enumerate((f"-({load})", "-3*J1.angleRate", "-2*J2.angleRate"))
    ]
    states = (SignalState("z", parse(rate)),)
    return build_model(bodies, joints, loads, gravity=tuple(9.81 * down), signals=states)


def within(model, tolerance):
    """``model`` by ``auto`` to the global ``tolerance``."""
    simulation = replace(model.simulation, scheme="auto", tolerance=tolerance)
    return replace(model, simulation=simulation)


@pytest.mark.parametrize("tolerance", [1e-3, 1e-9])
@pytest.mark.parametrize(("rate", "load"), NOISE)
def test_states_that_are_noise_cost_no_steps(tolerance, rate, load):
    """A chain at rest: its states are rounding errors, which no steps resolve. Nor does what they
    are say anything of the run.
    """
    model = within(chain_at_rest(rate, load), tolerance)
    report = simulate(model, dt=0.01, t_final=10.0).report
    assert report.status == "completed", report.message
    # Some ten pairs until a step is as long as the run, and again where noise is resolved; noise
    # refuses up to twenty, after each of which steps grow slowly. Thousands if all were resolved.
    assert report.steps <= 200
    assert report.verdict["word"] == "PASS", report.verdict["reasons"]


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(30))
def test_rest_is_rest_whatever_the_rounding_errors_are(seed):
    """The same chains with all numbers changed in their twelfth digit: steps of 5 s, a thousand
    time constants and more, multiply errors of rates in none of them. 1e-9 rad/s is what a step's
    residual of 1e-14 means there.
    """
    random = np.random.default_rng(seed)
    model = chain_at_rest(*NOISE[seed % 4], lambda: 1.0 + 1e-12 * random.standard_normal())
    report = simulate(within(model, 1e-9), dt=0.01, t_final=10.0).report
    assert report.verdict["word"] == "PASS", report.verdict["reasons"]
    assert report.error["angularVelocity"] <= 1e-8


def test_output_between_steps_far_longer_than_time_constants_is_as_good_as_the_ends():
    """Accelerations at positions and velocities that are wrong by round-off are wrong by much more:
    (h/T)^2 times more from level to level of the dense output, T = 4 ms. They were 1e-8 rad/s; the
    ends of steps have up to 2e-12, which differs between processors.
    """
    model = adaptive(chain_at_rest(*NOISE[3]), 5e-15)
    run = simulate(model, dt=0.01, t_final=10.0, error=OFF)
    # Far longer than the time constants; where noise ends their growth is seen from 80 to 120.
    assert run.report.step_control["stepMax"] > 75 * 4e-3
    assert np.abs(run.of("spin")).max() <= 1e-11


def test_a_run_without_any_step_is_concluded():
    """Where no pair is good, the first size tried is the longest step."""
    setup = SimpleNamespace(output=SimpleNamespace(grid=SimpleNamespace(h=0.01)))
    none = SimpleNamespace(step_control={"stepMax": 0.0})
    assert longest_step(setup, none) == 0.01


def test_the_command_asks_for_it(tmp_path):
    words = ["run", str(SINGLE), "--t-final", "1", "-o", str(tmp_path), "--scheme", "auto"]
    assert CliRunner().invoke(main, [*words, "--tolerance", "1e-5"]).exit_code == 0
    about = json.loads((tmp_path / "run.json").read_text())
    assert (about["options"]["tolerance"], about["stepControl"]["tolerance"]) == (1e-5, 1e-5)
    (fault,) = check_simulation(replace(deck("single_pendulum_45").simulation, tolerance=1e-6))
    assert fault.startswith("tolerance: the preserving scheme takes the steps it is given")
    result = CliRunner().invoke(main, [*words, "--tolerance", "0"])
    assert result.exit_code == 2
    assert "greater than zero" in result.stderr
    result = CliRunner().invoke(main, [*words, "--solver", "root"])
    assert result.exit_code == 2
    assert "takes steps of a given size" in result.stderr


@pytest.mark.slow
def test_what_no_step_meets_is_reported():
    """A load of (10 t)^400 N: no step is small enough for it after some 0.2 s."""
    sudden = push(1e200, *[0.0] * 400, 1e200)
    model = build_model([body(velocity=(1.0, 0.0, 0.0))], loads=[sudden], dt=0.01, t_final=1.0)
    report, _ = advance(adaptive(model, 1e-6), Options())
    assert report.status == "not converged"
    assert 0.1 < report.time < 0.6
    assert "beyond what a computer holds" in report.message
    assert f"t = {report.time:g} s" in report.message
