"""Linearised models against differences of the nonlinear equations, and against closed forms."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal
from scipy.io import loadmat

from msahl import load
from msahl.analysis.equilibria.at import point_at
from msahl.analysis.linearised.coefficients import coefficients, evaluated
from msahl.analysis.linearised.point import at_start, complete
from msahl.analysis.linearised.variations import Inputs, variations
from msahl.analysis.modes.solution import modes
from msahl.analysis.no_contacts import without_contacts
from msahl.analysis.state_space.columns import columns_by_table, shared_reactions
from msahl.analysis.state_space.linearize import linearize
from msahl.deck import read_deck
from msahl.expressions.syntax import Call, Number, parse
from msahl.model import (
    ConcentratedLoad,
    Joint,
    JointActuator,
    JointSpring,
    Law,
    PointMotion,
    Signal,
    SignalState,
    SpringDamper,
)
from msahl.run.options import OptionError
from msahl.start.velocities import StartError
from msahl.system.build import build_system
from msahl.system.state import build_state
from tests.analysis.differences import slopes, values
from tests.support.element_samples import ELEMENTS
from tests.support.loops import PLANAR, SPATIAL, random_loop
from tests.support.models import DECKS as DECKS_OF_ALL
from tests.support.models import GROUND, ROOT, body, build_model, deck, friction, simulate

MACHINES = ROOT / "decks" / "machines"
STILL = {"kPosition": 0, "kVelocity": 0, "kAngle": 0, "kRate": 0}
SAMPLES = ("rollingDisk", "actuator, markers", "friction")
PIECEWISE = ("camFollower", "jointMotion, table", "springDamper, table")
ENERGIES = ("torsionalSpringDamper", "slideSpringDamper")
"""Elements with jumps in a derivative, within the reach of the differences, and those whose elastic
energy has one."""
OTHERS = [name for name in ELEMENTS if name not in (*PIECEWISE, *ENERGIES, *SAMPLES)]
MOST_BODIES = 15
DECKS = ("bicycle", "satellite", "flyball_governor", "robot", "engine", "spatial_slider_crank")


def rate_of(name, model):
    """The column that is the derivative of a state."""
    if any(s.name == name for s in model.signals):
        return f"{name} rate"
    return f"{name.removesuffix('Rate')}Acceleration" if name.endswith("Rate") else f"{name}Rate"


def columns(model, point, redundant):
    """All columns but reactions that are not unique."""
    every = dict.fromkeys(c for names in columns_by_table(model).values() for c in names)
    return [c for c in every if not redundant or c not in shared_reactions(point)]


def check_states_and_outputs(model, tolerance=1e-9):
    """Compare A and C with differences along a random motion: A z = z', C z = y.

    Differences of order 4 with steps of 3e-4 have the round-off of their function over this step,
    3e-13 of the largest reaction or acceleration, and more by the condition of the loop.
    """
    point = at_start(model)
    own = evaluated(point.system, point.state)
    found = coefficients(point.system, point.state, own)
    n, s = found.coordinate.size, found.state_rate.size
    none = Inputs(np.zeros((n, 0)), np.zeros((s, 0)), np.zeros(0, dtype=int))
    changes = variations(point, own, found, none)
    outputs, m = columns(model, point, changes.linear.redundant), len(changes.into)
    linear = linearize(point, [], outputs)
    y = np.random.default_rng(1).normal(size=m)
    sizes = (np.abs(part[:, :m] @ y).max() for part in (changes.places, changes.rates))
    along = slopes(point, changes, y / max(*sizes, 1e-3))
    z = np.array([along[name] for name in linear.state_names])
    z_dot = np.array([along[rate_of(name, model)] for name in linear.state_names])
    measured = np.array([along[name] for name in outputs])
    size = max(np.abs(z_dot).max(), np.abs(measured).max(), 1.0)
    assert np.abs(linear.A @ z - z_dot).max() <= tolerance * max(np.abs(z_dot).max(), 1.0)
    assert np.abs(linear.C @ z - measured).max() <= tolerance * size
    # Differences of the order 4 with the same step; nothing here is stiff.
    assert linear.accuracy.disagreement <= 1e-8
    assert linear.accuracy.error <= 1e-8


@pytest.mark.parametrize("kind", [PLANAR, SPATIAL])
@pytest.mark.parametrize("seed", [1])
def test_a_random_loop_against_differences(kind, seed):
    check_states_and_outputs(random_loop(np.random.default_rng(seed), kind))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [PLANAR, SPATIAL])
@pytest.mark.parametrize("seed", [0, *range(2, 20)])
def test_more_random_loops_against_differences(kind, seed):
    check_states_and_outputs(random_loop(np.random.default_rng(seed), kind))


@pytest.mark.parametrize("name", SAMPLES)
def test_an_element_against_differences(name):
    check_states_and_outputs(ELEMENTS[name](np.random.default_rng(7)))


@pytest.mark.slow
@pytest.mark.parametrize("name", OTHERS)
def test_every_element_against_differences(name):
    check_states_and_outputs(ELEMENTS[name](np.random.default_rng(7)))


@pytest.mark.slow
def test_expressions_of_reactions_against_differences():
    """A motor and an auxiliary state by the reactions of two joints of a moving loop."""
    model = random_loop(np.random.default_rng(1), SPATIAL)
    motor = JointActuator("Motor", "J0", "angle", parse("0.1*J1.Fx + 0.02*J0.Mz*J0.Fy + 0.3*lag"))
    lag = SignalState("lag", parse("J2.Fz + command - 3*lag"), 0.1)
    felt = Signal("felt", parse("J1.Fy^2 - lag"))
    loads = tuple(load for load in model.loads if load.name != "Motor")
    signals = (model.signals[0], lag, felt)
    check_states_and_outputs(replace(model, loads=(*loads, motor), signals=signals))


@pytest.mark.slow
@pytest.mark.parametrize("name", DECKS)
def test_decks_against_differences(name):
    check_states_and_outputs(deck(name))


@pytest.mark.slow
@pytest.mark.parametrize("path", DECKS_OF_ALL, ids=lambda path: path.stem)
def test_every_deck_agrees_with_its_nonlinear_equations(path):
    try:
        point = at_start(read_deck(path))
    except StartError:
        pytest.skip("no consistent state at t = 0")
    if without_contacts(point.model):
        pytest.skip("contacts or events, which it refuses")
    if len(point.model.bodies) > MOST_BODIES:
        pytest.skip("many bodies")
    # Beams are stiff: round-off of their forces over the step of the differences.
    limit = 1e-6 if point.model.beams else 1e-8
    assert linearize(point, [], []).accuracy.disagreement <= limit


# Inputs -------------------------------------------------------------------------------------------


def raised(tree, w):
    return Call("+", (tree, Number(w)))


def with_input(model, name, w):
    """The model with the constant ``w`` added to what the input ``name`` is added to."""
    element, _, part = name.rpartition(".")
    if part[:1] in ("F", "M") and part[1:] in ("x", "y", "z"):
        places = {marker.name: (marker.body, marker.point) for marker in model.markers}
        vector, zero = tuple(w * (axis == part[1]) for axis in "xyz"), (0.0, 0.0, 0.0)
        both = (vector, zero) if part[0] == "F" else (zero, vector)
        on, point = places.get(element, (element, zero))
        ground = model.grounds[0].name
        load = ConcentratedLoad("in", on, point, both[0], ground, both[1], ground)
        return replace(model, loads=(*model.loads, load))
    if element:
        load = JointSpring("in", element, part, 0.0, 0.0, 0.0, -w)
        return replace(model, loads=(*model.loads, load))
    return replace(
        model,
        loads=tuple(more_load(load, w) if load.name == name else load for load in model.loads),
        signals=tuple(more_signal(s, w) if s.name == name else s for s in model.signals),
        motions=tuple(more_motion(m, w) if m.name == name else m for m in model.motions),
    )


def more_load(load, w):
    if getattr(load, "expression", None) is not None:
        return replace(load, expression=raised(load.expression, w))
    if load.law is not None:
        *wave, offset = load.law.numbers
        return replace(load, law=Law("sine", (*wave, offset + w)))
    both = (tuple((1.0 + w) * x for x in part) for part in (load.force, load.moment))
    return replace(load, **dict(zip(("force", "moment"), both, strict=True)))


def more_signal(each, w):
    if isinstance(each, SignalState):
        return replace(each, rate=raised(each.rate, w))
    return replace(each, expression=raised(each.expression, w))


def more_motion(motion, w):
    """The law has the derivative ``w`` more at t = 0, and the same value and rate."""
    a, omega, phase, offset = motion.law.numbers
    rise = -a * omega * omega * np.sin(phase) + w
    numbers = (a * np.sin(phase) + offset, a * omega * np.cos(phase), 0.5 * rise)
    return replace(motion, law=Law("polynomial", numbers))


def same_place(model, point):
    """Another model at the place and with the velocities of a point."""
    system = build_system(model)
    state, given = build_state(model, system), point.state
    moved = {name: getattr(given, name) for name in ("x", "p", "v", "w", "auxiliary", "time")}
    return complete(model, system, state._replace(**moved))


def check_inputs(model, inputs, tolerance=1e-9):
    """Compare B and D with central differences; rates and columns are linear in most inputs."""
    point = at_start(model)
    every = columns(model, point, linearize(point, [], []).redundant)
    outputs = [c for c in every if not c.endswith(".energy")]
    linear = linearize(point, inputs, outputs)
    w = 1e-3
    for i, name in enumerate(inputs):
        sides = [values(same_place(with_input(model, name, s * w), point), point) for s in (1, -1)]
        slope = {c: (sides[0][c] - sides[1][c]) / (2.0 * w) for c in sides[0]}
        of_states = {
            m: rate_of(state, model)
            for m, state in enumerate(linear.state_names)
            if ".motion" not in state
        }
        B = np.array([slope[c] for c in of_states.values()])
        assert linear.B[list(of_states), i] == pytest.approx(B, abs=tolerance * (1 + abs(B).max()))
        D = np.array([slope[c] for c in outputs])
        assert linear.D[:, i] == pytest.approx(D, abs=tolerance * (1 + abs(D).max()))


@pytest.mark.slow
def test_inputs_of_a_loop_against_differences():
    model = random_loop(np.random.default_rng(1), SPATIAL)
    names = ["Motor", "command", "current", "J0.angle", "J1.slide", "M.Fy", "B0.Mz", "B1.Fx"]
    check_inputs(model, names)


INPUTS = {
    "concentrated": ["L01", "L11"],
    "concentrated, law": ["L"],
    "concentrated, expression": ["L", "s"],
    "pointMotion": ["P"],
    "jointMotion, slide": ["D", "A.Fx"],
    "actuator, markers": ["P", "all", "s", "M.Mz"],
    "gear": ["J0.angle", "J1.angle"],
}
QUICK = ("concentrated, law", "pointMotion")


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[] if n in QUICK else pytest.mark.slow) for n in INPUTS]
)
def test_inputs_against_differences(name):
    check_inputs(ELEMENTS[name](np.random.default_rng(7)), INPUTS[name])


# Closed forms -------------------------------------------------------------------------------------

AXES = ((0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (1.0, 0.0, 0.0))
"""Rows of a joint's frame whose z is along x."""
OMEGA = np.array([0.3, 2.0, 9.0, 40.0])


def response(linear, omega=OMEGA):
    """(outputs, inputs, frequencies) by python-control, which takes seconds to import."""
    import control

    return control.frequency_response(linear.to_control(), omega).frdata


def test_cart_pole_against_its_equations():
    # (M + m) x'' + m l phi'' = F - d x',  m l x'' + (J + m l^2) phi'' = m g l phi
    model = load(MACHINES / "cart_pole.xml", **STILL, **{"Hinge.initialConditions.angle": 0})
    linear = model.linearize(["Motor"], ["Slide.slide", "Hinge.angle"])
    assert linear.state_names == [
        "Slide.slide",
        "Hinge.angle",
        "Slide.slideRate",
        "Hinge.angleRate",
    ]
    M, m, length, d, g = 1.5, 0.4, 0.3, 0.8, 9.81
    J = m * (2 * length) ** 2 / 12
    mass = np.array([[M + m, m * length], [m * length, J + m * length**2]])
    A, B = np.zeros((4, 4)), np.zeros((4, 1))
    A[:2, 2:] = np.eye(2)
    A[2:] = np.linalg.solve(mass, [[0, 0, -d, 0], [0, m * g * length, 0, 0]])
    B[2:] = np.linalg.solve(mass, [[1.0], [0.0]])
    assert np.allclose(linear.A, A, rtol=0.0, atol=1e-11)
    assert np.allclose(linear.B, B, rtol=0.0, atol=1e-12)
    assert np.allclose(linear.C, np.eye(2, 4), rtol=0.0, atol=1e-12)
    assert not linear.D.any()
    assert not linear.warnings


def test_quarter_car_against_its_transfer_function():
    model = load(MACHINES / "quarter_car.xml")
    linear = model.linearize(["road"], ["Body.z", "Strut.slide", "Tyre.load"], at="equilibrium")
    assert not linear.warnings
    mb, mw, k, kt, c = 300.0, 40.0, 20e3, 180e3, 1500.0
    s = 1j * OMEGA
    joint = k + c * s
    wheel = kt / (mw * s**2 + kt + joint - joint**2 / (mb * s**2 + joint))
    body_ = wheel * joint / (mb * s**2 + joint)
    expected = np.array([body_, body_ - wheel, kt * (1.0 - wheel)])
    assert response(linear)[:, 0] == pytest.approx(expected, rel=1e-10)
    assert linear.gains()[:, 0] == pytest.approx([1.0, 0.0, 0.0], abs=1e-8)


def dc_motor():
    """A rotor with an actuator whose current is an auxiliary state."""
    rotor = body("Rotor", 1.0, 0.02)
    axle = Joint("Axle", "revolute", GROUND.name, "Rotor", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    loads = (
        JointActuator("Motor", "Axle", "angle", parse("0.3*current")),
        JointSpring("Bearing", "Axle", "angle", 0.0, 0.05),
    )
    signals = (
        Signal("voltage", Number(0.0)),
        SignalState("current", parse("(voltage - 1.2*current - 0.3*Axle.angleRate)/0.004")),
    )
    return build_model([rotor], [axle], loads, signals=signals)


def test_dc_motor_against_its_transfer_function():
    linear = linearize(at_start(dc_motor()), ["voltage"], ["Axle.angleRate", "current", "Axle.Mz"])
    J, b, K, R, L, s = 0.02, 0.05, 0.3, 1.2, 0.004, 1j * OMEGA
    speed = K / ((J * s + b) * (L * s + R) + K * K)
    expected = np.array([speed, (J * s + b) * speed / K, 0.0 * s])
    assert response(linear)[:, 0] == pytest.approx(expected, abs=1e-11)
    assert linear.state_names == ["Axle.angle", "Axle.angleRate", "current"]
    assert linear.inputs[0].unit == "SI"


def shaken(k=40.0, c=0.6, m=2.0):
    """A mass on a spring and damper whose other end is moved by a law, along z."""
    z = (0.0, 0.0, 1.0)
    bodies = [body("Table", 1.0), body("Mass", m, position=z)]
    joints = [
        Joint(f"Guide {name}", "prismatic", GROUND.name, name, (0.0, 0.0, 0.0), at)
        for name, at in (("Table", (0.0, 0.0, 0.0)), ("Mass", (0.0, 0.0, -1.0)))
    ]
    zero = (0.0, 0.0, 0.0)
    spring = SpringDamper("Spring", "Table", "Mass", zero, zero, k, c)
    motion = PointMotion("Shaker", "Table", zero, z, Law("sine", (0.0, 1.0, 0.0, 0.0)))
    return build_model(bodies, joints, [spring], motions=[motion])


def test_a_prescribed_motion_as_input():
    k, c, m = 40.0, 0.6, 2.0
    outputs = ["Mass.z", "Shaker.load", "Mass.az"]
    linear = linearize(at_start(shaken(k, c, m)), ["Shaker"], outputs)
    assert linear.state_names[-2:] == ["Shaker.motion", "Shaker.motionRate"]
    assert linear.inputs[0].unit == "m/s^2"
    s = 1j * OMEGA
    mass = (c * s + k) / (m * s**2 + c * s + k)  # by the table's displacement
    load_ = s**2 * (1.0 + m * mass)
    expected = np.array([mass, load_, s**2 * mass]) / s**2
    assert response(linear)[:, 0] == pytest.approx(expected, rel=1e-10)


def test_friction_on_a_belt_against_its_equation():
    """A block that a spring holds on a moving belt, and presses to it less as it moves on.

    m x'' = -T/sqrt(2) + mu N tanh((v - x')/w) ,  N = m g - T/sqrt(2) ,  T = T_0 + k x/sqrt(2)
    """
    m, g, k, mu, v, w = 2.0, 9.81, 60.0, 0.3, 1.0, 0.4
    share, zero = np.tanh(v / w), (0.0, 0.0, 0.0)
    pull = mu * share * m * g / (1.0 + mu * share)  # T_0/sqrt(2), in equilibrium
    bodies = [body("Belt", 1.0, velocity=(v, 0.0, 0.0)), body("Block", m)]
    joints = [
        Joint(name, "prismatic", *ends, zero, zero, parent_axes=AXES, child_axes=AXES)
        for name, ends in (("Rollers", (GROUND.name, "Belt")), ("Contact", ("Belt", "Block")))
    ]
    motion = PointMotion("Motor", "Belt", zero, (1.0, 0.0, 0.0), Law("polynomial", (0.0, v)))
    far = -1e7 * np.sqrt(0.5)  # so that the spring's direction changes by 1e-7 a metre
    numbers = (k, 0.0, None, pull * np.sqrt(2.0))
    spring = SpringDamper("Spring", GROUND.name, "Block", (far, 0.0, far), zero, *numbers)
    loads = [spring, friction("Rub", "Contact", "slide", mu, 1.0, w)]
    model = build_model(bodies, joints, loads, gravity=(0.0, 0.0, g), motions=[motion])
    point = at_start(model)
    linear = linearize(point, ["Block.Fx", "Block.Fz"], ["Contact.Fz", "Block.x"])
    pressed, slope = m * g - pull, (1.0 - share**2) / w
    expected = [[0.0, 1.0], [-0.5 * k * (1.0 + mu * share) / m, -mu * pressed * slope / m]]
    assert np.allclose(linear.A, expected, rtol=1e-6, atol=1e-6)
    # A force along gravity presses, and friction carries the block along.
    assert np.allclose(linear.B[1], [1.0 / m, mu * share / m], rtol=1e-6)
    assert np.allclose(linear.D, [[0.0, -1.0], [0.0, 0.0]], atol=1e-6)
    assert np.allclose(np.sort_complex(modes(point).value)[-1:], linear.poles[:1], rtol=1e-9)


def test_a_step_response_against_a_run():
    """A voltage on the motor of a four-bar that hangs in equilibrium."""
    volts, path = 1e-3, MACHINES / "motor_four_bar.xml"
    point = point_at(load(path, supply=0.0).records, "equilibrium")
    linear = linearize(point, ["voltage"], ["Coupler.x", "Coupler.z", "current"])
    assert not linear.warnings
    time = np.linspace(0.0, 0.5, 51)
    import control

    _, y = control.step_response(linear.to_control(), time)
    _, by_scipy = signal.step(linear.to_scipy(), T=time)
    records = load(path, supply=volts, rise=1e-9).records
    rows = values(point, point)
    bodies = [
        replace(
            body,
            position=tuple(rows[f"{body.name}.{c}"] for c in "xyz"),
            orientation=tuple(rows[f"{body.name}.P{i}"] for i in (1, 2, 3)),
        )
        for body in records.bodies
    ]
    run = simulate(
        replace(records, bodies=tuple(bodies)), dt=0.01, t_final=0.5, scheme="gauss4", checked=True
    )
    measured = [run.of("position", 2)[:, 0], run.of("position", 2)[:, 2], run.column("current")]
    for k, column in enumerate(measured):
        change, expected = column - column[0], volts * np.asarray(y)[k, 0]
        # Terms of the second order are of 1e-4 of those of the first: the crank moves by 4e-4 rad.
        assert np.abs(change - expected).max() <= 1e-3 * np.abs(expected).max()
        assert np.abs(y[k, 0] - by_scipy[:, k]).max() <= 1e-9 * np.abs(y[k]).max()


# Choices, files, faults ---------------------------------------------------------------------------


def test_both_choices_of_states_have_one_transfer_function():
    """In an equilibrium; elsewhere the states of one move relative to those of the other."""
    point = point_at(deck("motor_four_bar"), "equilibrium")
    names = ["Motor", "voltage"], ["Shaft.angleRate", "Rocker.ax", "Crank pin.Fx", "current"]
    one, other = (linearize(point, *names, states) for states in ("coordinates", "nullspace"))
    H, G = response(one), response(other)
    assert np.abs(H - G).max() <= 1e-11 * np.abs(H).max()
    assert other.state_names[0].startswith("eta1: ")
    assert "Shaft.angle" in other.state_names[0]


def test_poles_of_the_bicycle_are_its_eigenvalues():
    model = load(ROOT / "decks/mechanisms/bicycle.xml", v=4)
    for states in ("coordinates", "nullspace"):
        linear = model.linearize([], ["Frame.y"], states=states)
        for value in modes(point_at(model.records, 0.0)).value[-3:]:
            assert np.abs(linear.poles - value).min() <= 1e-9 * abs(value)
    assert len(linear.states) == 10  # seven places and three rates: the wheels roll
    assert not linear.warnings


def test_files_say_the_same(tmp_path):
    model = load(MACHINES / "motor_four_bar.xml").linearize(["Motor"], ["Shaft.angle"])
    for suffix in ("npz", "mat", "json"):
        model.save(tmp_path / f"bar.{suffix}")
    numpy_file = np.load(tmp_path / "bar.npz")
    matlab = loadmat(tmp_path / "bar.mat")
    plain = json.loads((tmp_path / "bar.json").read_text())
    for name in "ABCD":
        expected = getattr(model, name)
        assert np.array_equal(numpy_file[name], expected)
        assert np.array_equal(matlab[name], expected)
        assert np.array_equal(np.array(plain[name]).reshape(expected.shape), expected)
    names = ["Shaft.angle", "Shaft.angleRate", "current"]
    assert numpy_file["stateNames"].tolist() == plain["stateNames"] == names
    assert [str(cell[0][0]) for cell in matlab["stateNames"]] == names
    assert plain["inputUnits"] == ["N m"]
    assert plain["isSteady"] is False
    assert plain["warnings"]
    with pytest.raises(OptionError, match=r"none of \.npz"):
        model.save(tmp_path / "bar.txt")


@pytest.mark.parametrize(
    ("inputs", "outputs", "message"),
    [
        (["Motr"], [], "'Motr' is no input.*did you mean Motor"),
        (["Motor", "Motor"], [], "'Motor' is an input twice"),
        ([], ["Shaft.angel"], "'Shaft.angel' is no output.*Shaft.angle"),
        ([], ["Motor.work"], "'Motor.work' is no output"),
        ([], ["Shaft.angle", "Shaft.angle"], "is an output twice"),
    ],
)
def test_names_that_do_not_exist(inputs, outputs, message):
    with pytest.raises(OptionError, match=message):
        linearize(at_start(deck("motor_four_bar")), inputs, outputs)


def test_a_motion_that_others_determine_cannot_be_an_input():
    model = shaken()
    twin = replace(model.motions[0], name="Twin")
    point = at_start(replace(model, motions=(*model.motions, twin)))
    with pytest.raises(StartError, match="cannot change alone"):
        linearize(point, ["Shaker"], [])


def test_reactions_that_are_not_unique_are_named():
    found = linearize(at_start(deck("motor_four_bar")), ["Motor"], ["Shaft.Fx", "Shaft.Fy"])
    (warning,) = [w for w in found.warnings if "redundant" in w]
    assert "Shaft.Fy" in warning
    assert "Shaft.Fx" not in warning
