"""Steps of a given size, and those by tolerance, end at the breakpoints of laws of coordinates."""

import math
from dataclasses import replace

import numpy as np
import pytest

import msahl.schemes.midpoint.stepper
from msahl.algebra.functions import Law
from msahl.algebra.vector import ZERO
from msahl.deck import read_deck
from msahl.events.margins import build_margins
from msahl.model import Joint, JointMotion, Options
from msahl.model.loads import JointSpring
from msahl.run.subsystem import SubsystemIntegrator
from msahl.run.verdict import WARN
from msahl.schemes import fixed_stepper
from msahl.schemes.detection import Detection
from msahl.schemes.output_schedule import OutputSchedule
from msahl.schemes.stepper import Chunk
from tests.run.test_resume import advance as in_memory
from tests.run.test_resume import bits, in_two_parts, same_run
from tests.support.models import GROUND, ROOT, body, build_model, friction
from tests.support.models import simulate_and_estimate as simulate

MASS, STIFFNESS, FREE = 2.0, 200.0, 0.3
RATE = math.sqrt(STIFFNESS / MASS)
HITS = FREE, FREE + math.pi / RATE


def bouncing(count=1):
    """Bodies that slide at 1 m/s to springs 0.3 m away, which push and do not pull."""
    table = Law("linear", (-1.0 - FREE, -FREE, -STIFFNESS, 0.0))
    names = [f"Body {k}" for k in range(count)]
    bodies = [body(name, mass=MASS, velocity=(0.0, 0.0, -1.0)) for name in names]
    rails = [Joint(f"On {name}", "prismatic", GROUND.name, name, ZERO, ZERO) for name in names]
    pads = [
        JointSpring(f"Pad {k}", rail.name, "slide", 0.0, 0.0, table=table)
        for k, rail in enumerate(rails)
    ]
    return build_model(bodies, rails, pads)


def exact(t):
    """The slide [m] at the times ``t``: free, half a period of the spring, free again."""
    touching = -FREE - np.sin(RATE * (t - HITS[0])) / RATE
    return np.select([t < HITS[0], t < HITS[1]], [-t, touching], t - HITS[1] - FREE)


@pytest.mark.parametrize(
    ("scheme", "order", "steps"), [("gauss2", 4, 0.05), ("gauss3", 6, 0.1), ("radau3", 5, 0.1)]
)
def test_given_steps_keep_their_order_at_breakpoints(scheme, order, steps):
    """Without parts the error is that of a breakpoint in the middle of a step, of order 2."""
    errors = []
    for dt in (steps, 0.5 * steps):
        run = simulate(bouncing(), dt=dt, t_final=1.0, scheme=scheme, solver="newton", error="off")
        errors.append(abs(run.states[-1, 3] - exact(1.0)))
    # The spring is met within steps, so its steps are not quite halved: measured 0.02 to 0.05 less.
    assert math.log2(errors[0] / errors[1]) > order - 0.1


@pytest.mark.parametrize(("degree", "order", "tolerance"), [(2, 4, 1e-6), (3, 6, 1e-9)])
def test_steps_by_tolerance_end_at_breakpoints(degree, order, tolerance):
    model, given = bouncing(), {"scheme": "gauss", "degree": degree}
    errors, steps = [], []
    for part in (1.0, 1e-2):
        changed = replace(model.simulation, local_tolerance=part * tolerance, **given)
        run = simulate(replace(model, simulation=changed), dt=0.05, solver="newton", error="off")
        errors.append(abs(run.states[-1, 3] - exact(1.0)))
        steps.append(run.report.steps)
    # The local errors add up to the tolerance, and grow to twice that while the body flies back.
    assert errors[0] < 2.0 * tolerance
    assert errors[1] < 2e-2 * tolerance
    # A hundredth takes 100^(1/p) as many steps where steps are limited by their errors alone.
    assert steps[1] < 1.2 * 100 ** (1.0 / order) * steps[0]


def test_rows_within_a_divided_step_are_as_accurate_as_others():
    model = bouncing()
    model = replace(model, simulation=replace(model.simulation, output_interval=0.01))
    run = simulate(model, dt=0.05, t_final=1.0, scheme="gauss3", solver="newton", error="off")
    assert len(run.states) == 101
    t = run.states[:, 0]
    # The error of positions while the spring pushes, by gauss3 with 6 steps in half a period.
    assert run.states[:, 3] == pytest.approx(exact(t), abs=2e-7)
    # The spring's energy at these times, and the kinetic one: 2e-7 m at its largest force, 20 N.
    energy = 0.5 * MASS * run.states[:, 9] ** 2 + run.work[:, 1:].sum(axis=1)
    assert energy == pytest.approx(energy[0], abs=4e-6)


@pytest.mark.parametrize("scheme", ["preserving", "decaying"])
def test_steps_of_order_2_end_at_events(scheme, monkeypatch):
    """Their order is the same with a breakpoint within a step, so they do not end there unless a
    margin asks for it. If one does, their energy is as exact, and their error of the same size.
    """
    plain = simulate(bouncing(), dt=0.04, t_final=1.0, scheme=scheme, solver="newton", error="off")
    monkeypatch.setattr(
        msahl.schemes.midpoint.stepper,
        "build_margins",
        lambda system, order, *rest: build_margins(system, 3, *rest),
    )
    run = simulate(bouncing(), dt=0.04, t_final=1.0, scheme=scheme, solver="newton", error="off")
    assert np.array_equal(run.states[:8], plain.states[:8])  # before the first event, at 0.3 s
    assert len(run.states) == len(plain.states)
    assert run.states[-1, 0] == 1.0
    off, off_plain = (abs(of.states[-1, 3] - exact(1.0)) for of in (run, plain))
    assert off < 1.5 * off_plain
    if scheme == "preserving":
        energy = 0.5 * MASS * run.states[:, 9] ** 2 + run.work[:, 1:].sum(axis=1)
        # Machine epsilons of the energy, in 25 steps of some five iterations.
        assert energy == pytest.approx(energy[0], rel=1e-13)


@pytest.mark.parametrize("scheme", ["preserving", "decaying", "gauss2", "gauss3", "radau2"])
def test_given_steps_carry_the_impulse_of_a_motion_whose_speed_jumps(scheme):
    """A body on a spring from another one, which is driven at 0.6 m/s, and stops within a step."""
    speed, stop, end, dt = 0.6, 0.333, 1.0, 0.01
    bodies = [body("Driven", mass=1.0, velocity=(0.0, 0.0, speed)), body("Free", mass=MASS)]
    joints = [
        Joint("Drive", "prismatic", GROUND.name, "Driven", ZERO, ZERO),
        Joint("Rail", "prismatic", "Driven", "Free", ZERO, ZERO),
    ]
    law = Law("linear", (0.0, stop, end, 0.0, speed * stop, speed * stop))
    motion = JointMotion("Motor", "Drive", "slide", law)
    spring = JointSpring("Spring", "Rail", "slide", STIFFNESS, 0.0)
    model = build_model(bodies, joints, [spring], motions=(motion,))
    run = simulate(model, dt=dt, scheme=scheme, solver="newton")
    late = speed * np.sin(RATE * (end - stop)) - speed * np.sin(RATE * end)
    off = abs(run.states[-1, 15] - (speed * stop + late / RATE))
    # Two oscillations of 0.06 m, late by the phase w t (w dt)^2 / 12 by the midpoint rule; as much
    # again for the corner within a step.
    late_by = RATE * end * (RATE * dt) ** 2 / 12.0
    assert off < min(2.0 * 0.12 * late_by, 3.0 * run.report.error["position"])
    check = run.report.verdict["checks"]["speedJumps"]
    assert check["word"] == WARN
    assert "jumps: 'Motor' at t = 0.333 s; its load" in check["text"]


@pytest.mark.parametrize(
    ("interpolation", "end", "jumps"),
    [
        ("cubic", 2.0, ""),  # it begins with a slope at t = 0, as the arm does
        ("cubic", 2.1, "t = 2 s; "),  # and is constant afterwards
        ("linear", 1.1, "t = 0.5 s and 1 times more; "),
    ],
)
def test_the_verdict_says_where_in_the_deck_a_speed_jumps(tmp_path, interpolation, end, jumps):
    source = (ROOT / "decks/forces/joint_motion_table.xml").read_text()
    path = tmp_path / "given.xml"
    path.write_text(source.replace('"cubic"', f'"{interpolation}"'))
    run = simulate(read_deck(path), 0.05, end, "radau2", solver="newton")
    check = run.report.verdict["checks"].get("speedJumps", {"text": ""})
    line = 1 + source[: source.index("<jointMotion>")].count("\n")
    assert (f"'Motor' ({path}:{line}) at {jumps}" in check["text"]) == bool(jumps)
    assert bool(check["text"]) == bool(jumps)


def advance(model, scheme, degree, steps):
    """Take ``steps`` in one chunk of a second; return the integrator, the advance, and the calls
    from Python of the compiled loop and of single steps.
    """
    simulation = replace(model.simulation, scheme=scheme, degree=degree)
    integrator = SubsystemIntegrator(replace(model, simulation=simulation), "newton", False, steps)
    integrator.show_start()
    method, calls = integrator.stepper.method, {"take_steps": 0, "take_step": 0}

    def counted(name):
        function = getattr(method, name)

        def call(*arguments):
            calls[name] += 1
            return function(*arguments)

        return call

    for name in calls:
        setattr(method, name, counted(name))
    ends = np.arange(1, steps + 1) / steps
    schedule = OutputSchedule.at_ends(np.ones(steps, dtype=bool))
    chunk = Chunk(steps, h=1.0 / steps, ends=ends, schedule=schedule)
    return integrator, integrator.advance(chunk), calls


def test_the_compiled_loop_is_left_at_events_only():
    integrator, advanced, calls = advance(bouncing(), "gauss", 3, 97)
    assert advanced.steps == 97
    # Two events: after each the loop goes on. A search takes up to five steps by the secant, and
    # the rest of the step is one more.
    assert calls["take_steps"] == 3
    assert calls["take_step"] <= 2 * (1 + 5 + 1)
    times = [(k + part) / 97 for k, (part,) in sorted(advanced.parts.items())]
    assert times == pytest.approx(HITS, abs=1e-9)  # 97 steps of order 6
    assert integrator.workspace.tables.states[-1, 2] == pytest.approx(exact(1.0), abs=1e-9)


def test_what_has_no_margins_is_not_examined():
    model = bouncing()
    free = replace(model, loads=())
    _, advanced, calls = advance(free, "gauss", 3, 20)
    assert (advanced.steps, calls) == (20, {"take_steps": 1, "take_step": 0})


def test_a_run_with_events_goes_on_bit_for_bit(monkeypatch):
    """Interrupted between its events, with rows within steps; and, by tolerance, in the contact."""
    model, options = bouncing(), Options(solver="newton")
    fixed = replace(model.simulation, scheme="gauss", degree=3, dt=0.03, output_interval=0.01)
    same_run(monkeypatch, replace(model, simulation=fixed), options, 15)
    controlled = replace(model.simulation, scheme="auto", local_tolerance=1e-9)
    model = replace(model, simulation=controlled)
    _, rows = in_memory(model, options)
    (_, first), (_, second) = in_two_parts(monkeypatch, model, options, 6)
    assert bits(first, second) == bits(rows)


def test_the_companion_ends_at_its_own_events():
    """The estimate is of the error, which without them would be a thousand times as large."""
    run = simulate(
        bouncing(), dt=0.05, t_final=1.0, scheme="gauss3", solver="newton", error="estimate"
    )
    error = np.abs(run.states[:, 3] - exact(run.states[:, 0])).max()
    assert error < run.report.error["position"] < 3.0 * error


def test_subsystems_end_their_steps_apart():
    """One of two bodies starts later: rows of either are those that it has alone."""
    alone = simulate(bouncing(), dt=0.05, scheme="gauss3", solver="newton", error="off")
    both = simulate(bouncing(2), dt=0.05, scheme="gauss3", solver="newton", error="off")
    assert both.report.subsystems == 2
    assert np.array_equal(both.states[:, 1:13], alone.states[:, 1:13])


@pytest.mark.parametrize("short", [0.0, 3e-13])
def test_no_part_is_round_off(monkeypatch, short):
    """Where a width of friction is passed next to the end of a part, it ends with that part:
    forces would be round-off over the time of the rest. So would be the time of a width that
    begins the next parts.
    """
    found, sizes = fixed_stepper.time_of_zero, []

    def early(function, guess, rate, low, high, near):
        time = found(function, guess, rate, low, high, near)
        ends = high - short if short else time
        function(ends)
        return ends

    def taken(stepper, h, share, tried):
        sizes.append(h)
        return solve_once(stepper, h, share, tried)

    solve_once = fixed_stepper.FixedStepper._solve_once
    monkeypatch.setattr(fixed_stepper, "time_of_zero", early)
    monkeypatch.setattr(fixed_stepper.FixedStepper, "_solve_once", taken)
    monkeypatch.setattr(Detection, "time_of_a_width", lambda self, event: 1e-17)
    rail = Joint("Rail", "prismatic", GROUND.name, "Bob", ZERO, ZERO)
    rub = friction("Rub", "Rail", "slide", 0.3, 1.0, 1e-3)
    bob = body(velocity=(0.0, 0.0, 0.5))
    model = build_model([bob], [rail], [rub], gravity=(9.81, 0.0, 0.0))
    run = simulate(model, dt=0.01, t_final=0.3, scheme="gauss2", error="off", solver="newton")
    assert run.report.status == "completed"
    assert 0.005 in sizes  # the step was divided, and its parts became longer
    # In a millionth of a step its difference of momenta has ten digits.
    assert min(sizes) >= 0.95e-6 * 0.01
