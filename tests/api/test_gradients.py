"""Derivatives of measures by numbers of a deck: against complete runs, and against closed forms."""

import math

import numpy as np
import pytest
from scipy.special import ellipk

import msahl
from msahl.analysis.gradients import run as tangent_run
from msahl.analysis.gradients.step_sequence import Step
from msahl.api import gradients
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.common import tangents
from msahl.schemes.midpoint import tangent as midpoint_tangent
from tests.support.models import ROOT

DECKS = ROOT / "decks"

DIFFERENCE = ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12))
"""Shifts and weights of the difference of order 4."""
SCENES = {
    "control": ("machines/cart_pole", {"t_final": 0.5}, "length,kAngle,poleMass",
                ["Hinge.angle final", "Slide.slide max", "Motor.work final"]),
    "control, gauss": ("machines/cart_pole", {"t_final": 0.3, "scheme": "gauss2"}, "length,kAngle",
                       ["Hinge.angle final", "Slide.slideRate mean"]),
    "auxiliary states, radau": ("machines/motor_four_bar", {"t_final": 0.1, "scheme": "radau2"},
                                "crank,inductance,rise",
                                ["Rocker pivot.angle final", "current final"]),
    "suspension, decaying": ("machines/quarter_car", {"t_final": 0.4, "scheme": "decaying"},
                             "spring,damping,vBlow", ["Strut.slide rms", "Body.z min"]),
    "markers": ("machines/robot", {"t_final": 0.1}, "L2", ["Flange.x final", "Flange.z at 0.0523"]),
    "groups": (
        "basics/markers",
        {"t_final": 0.2},
        "Arm.mass",
        ["Everything.kinetic final", "Everything.potential mean"],
    ),
    "control of the step size": ("machines/satellite",
                                 {"t_final": 1.0, "scheme": "auto", "tolerance": 1e-9}, "Kp",
                                 ["Sensor.q1 final", "Axle X.angleRate final"]),
    "condition at the end": ("basics/parameters",
                             {"stop_when": "Hinge.angle > -0.4", "t_final": 1.0, "dt": 0.02},
                             "L,start,gravity.g3",
                             ["Hinge.angleRate final", "Hinge.Fz mean"]),
    "friction": ("forces/friction_hinge", {"t_final": 0.3}, "Rub.coefficient,Flywheel.mass",
                 ["Axle.angle final"]),
    "law of time": ("forces/concentrated_law", {"t_final": 0.5}, "Push.sine.frequency",
                    ["Body.x final"]),
    "free length": ("forces/spring_damper", {"t_final": 0.5, "scheme": "decaying"},
                    "Spring.freeLength,Spring.damping,Body.mass", ["Body.x final"]),
    "prescribed motion": ("mechanisms/four_bar", {"t_final": 0.2}, "Coupler.mass",
                          ["Rocker pivot.F final"]),
    "redundant joints": ("mechanisms/bricard", {"t_final": 0.3}, "Bar 1.mass,Bar 3.Ixx",
                         ["P1.angle final"]),
    "rates constrained": ("joints/knife_edge", {"t_final": 0.3}, "Skate.omega3",
                          ["Ice.slide1 final"]),
}  # fmt: skip


@pytest.fixture
def in_absolute_coordinates(monkeypatch):
    """Steps that are differentiated are those of absolute coordinates."""
    monkeypatch.setattr(SubsystemIntegrator, "joint_coordinates", False)


@pytest.mark.sampled
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.usefixtures("in_absolute_coordinates")
def test_derivatives_are_those_of_complete_runs(name):
    deck, options, wrt, measures = SCENES[name]
    options = {"error": "off", **options} if "tolerance" not in options else options
    model = msahl.load(DECKS / f"{deck}.xml")
    found = model.gradient(measures, wrt, **options)
    request = gradients.make_request(model.job(**options), measures, wrt.split(","))
    for j, (name, number) in enumerate(request.numbers.items()):
        # Of order 4 with a shift of 1e-3; a run with step-size control is smooth to its tolerance.
        e, slopes = 1e-3 * abs(number.value), np.zeros(len(measures))
        for node, weight in DIFFERENCE:
            moved = f"{number.value + node * e!r} {number.units}".strip()
            run = model.with_(**{name: moved}).run(**options)
            values, _ = gradients.evaluate_columns(request.measures, run.records, run.array)
            slopes += weight / e * np.array([values[measure] for measure in measures])
        assert found.jacobian[:, j] == pytest.approx(slopes, rel=1e-6)
        assert (slopes != 0.0).all()


def test_an_oscillation_depends_on_its_parameters_as_the_closed_form_does():
    model = msahl.load(DECKS / "forces/torsional_spring.xml")
    names = ["Wire.stiffness", "Wire.damping", "Wire.freeAngle", "Wheel.Izz"]
    found = model.gradient("Axle.angle at 3", names, scheme="gauss3", dt=0.02)

    def angle(k, c, free, inertia, t=3.0):
        decay = 0.5 * c / inertia
        w = np.sqrt(k / inertia - decay**2)
        most = free * math.pi / 180.0
        return most * (1.0 - np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t)))

    given = np.array([0.05, 0.004, 400.0, 0.02], dtype=complex)
    exact = [angle(*(given + 1e-30j * np.eye(4)[i])).imag / 1e-30 for i in range(4)]
    assert found.values[0] == pytest.approx(angle(*given).real, rel=1e-8)
    # Of order 6, with w h = 0.03; the differences are good to about 1e-9.
    assert found.jacobian[0] == pytest.approx(exact, rel=1e-7)
    assert (np.abs(found.jacobian[0] - exact) <= found.errors[0] + 1e-8 * np.abs(exact)).all()
    assert found.units[0][2] == "rad/deg"


def test_derivatives_are_those_of_the_steps_to_nine_digits():
    model = msahl.load(DECKS / "forces/torsional_spring.xml", **{"Wire.damping": 0.0})
    options = {"dt": 0.05, "t_final": 3.0, "error": "off", "rotation_update": "exponential"}
    found = model.gradient("Axle.angle final", ["Wire.stiffness", "Wheel.Izz"], **options)

    def angle(k, inertia):
        # The midpoint rule for a linear oscillator: each step is a rotation of the phase.
        phase = 2.0 * np.arctan(0.5 * 0.05 * np.sqrt(k / inertia))
        return math.radians(400.0) * (1.0 - np.cos(60 * phase))

    given = np.array([0.05, 0.02], dtype=complex)
    exact = [angle(*(given + 1e-30j * np.eye(2)[i])).imag / 1e-30 for i in range(2)]
    assert found.values[0] == pytest.approx(angle(*given).real, rel=1e-12)
    # Differences of order 4 with shifts of 3e-4, those of the parameter of order 2 with 1e-5.
    assert found.jacobian[0] == pytest.approx(exact, rel=1e-9)


def test_the_period_of_a_pendulum_by_its_length():
    model = msahl.load(DECKS / "basics/parameters.xml")
    options = {"scheme": "gauss3", "dt": 0.01, "t_final": 0.5, "error": "off"}
    found = model.gradient("time of Hinge.angle = 0", "L,rho,start", **options)
    length, r, g = 0.8, 0.01, 9.80665
    reduced = (length**2 / 3.0 + r**2 / 4.0) / (0.5 * length)
    by_length = 2.0 / 3.0 - 2.0 * (r**2 / 4.0) / length**2
    quarter = math.sqrt(reduced / g) * ellipk(math.sin(math.radians(30.0)) ** 2)
    assert found.values[0] == pytest.approx(quarter, rel=1e-9)
    exact = 0.5 * quarter / reduced * by_length * 1e-2  # by cm
    # The crossing is that of a spline of degree 5 through the output times.
    assert found.jacobian[0, 0] == pytest.approx(exact, rel=1e-7)
    assert found.jacobian[0, 1] == pytest.approx(0.0, abs=1e-10)  # by g/cm^3


def test_derivatives_in_joint_coordinates_are_those_of_the_motion():
    """Runs in joint coordinates and the steps that are differentiated differ by their errors."""
    model = msahl.load(DECKS / "basics/parameters.xml")
    options = {"dt": 0.01, "t_final": 0.5, "scheme": "gauss3", "error": "off"}
    found = model.gradient("Hinge.angle final", "L", **options)
    moved = [model.with_(L=f"{length!r} cm").run(**options) for length in (80.01, 79.99)]
    ends = [run.joints["Hinge.angle"].iloc[-1] for run in moved]
    # Of order 2 with a shift of 1e-4: 1e-8 of the derivative.
    assert found.jacobian[0, 0] == pytest.approx((ends[0] - ends[1]) / 0.02, rel=1e-6)


@pytest.mark.parametrize("options", [{"error": "off"}, {"scheme": "auto", "tolerance": 1e-4}])
@pytest.mark.usefixtures("in_absolute_coordinates")
def test_the_end_of_a_run_moves_with_the_parameters(options):
    """The last step is cut there, or the last pair of those that a tolerance chooses."""
    model = msahl.load(DECKS / "basics/parameters.xml")
    options = {"stop_when": "Hinge.angle > 0", "dt": 0.02} | options
    found = model.gradient(["Rod.x final", "Rod.z final"], "L", **options)
    # The run ends where the rod is vertical: its mass centre is L/2 below the hinge.
    assert found.jacobian[:, 0] == pytest.approx([0.0, -0.005], abs=1e-11)


def test_differences_are_exact_for_polynomials_of_degree_four():
    for power in range(5):
        terms = [tangents.weight(k) * tangents.shift_of(k) ** power for k in range(4)]
        # Four terms of up to 8/12 times 2^4, rounded.
        assert sum(terms) == pytest.approx(1.0 if power == 1 else 0.0, abs=1e-14)


@pytest.mark.parametrize(
    ("sizes", "degree", "shares"),
    [
        ([0.2, 0.2, 0.1], 3, [0.0, 0.0, 1.0]),  # a last step that is cut
        ([0.2, 0.2, 0.1, 0.1], 3, [0.0, 0.0, 0.5, 0.5]),  # two pairs of steps
        ([0.2, 0.2, 0.2], 0, [0.0, 0.0, 1.0]),  # order 2 has no pairs
    ],
)
def test_all_of_the_end_of_a_run_is_in_its_last_step_or_pair(sizes, degree, shares):
    steps = [Step(size, degree, (), ()) for size in sizes]
    assert [tangent_run._end_share(steps, k) for k in range(len(steps))] == shares


@pytest.mark.slow
def test_the_equilibrium_from_which_a_run_starts_moves_with_the_parameters(tmp_path):
    deck = (DECKS / "machines/quarter_car.xml").read_text()
    deck = deck.replace("<simulation>", '<simulation start="equilibrium">')
    (tmp_path / "deck.xml").write_text(deck)
    model, options = msahl.load(tmp_path / "deck.xml"), {"t_final": 0.1, "error": "off"}
    found = model.gradient("Body.z final", "spring", **options)
    e = 1e-3 * 20000.0
    assert model.parameters["spring"]["value"] == 20000.0
    slope = sum(
        weight / e * model.with_(spring=20000.0 + node * e).run(**options)["Body.z"][-1]
        for node, weight in DIFFERENCE
    )
    assert found.jacobian[0, 0] == pytest.approx(slope, rel=1e-6)


def test_a_parameter_that_leaves_the_plane_of_a_model(tmp_path):
    deck = (DECKS / "basics/two_rods.xml").read_text()
    deck = deck.replace("<child><name>Rod 2</name><position>", "<child><name>Rod 2</name>"
                        '<position><y units="m">{aside}</y>')  # fmt: skip
    deck = deck.replace(
        "</parameters>", '<parameter name="aside" units="m">0</parameter></parameters>'
    )
    (tmp_path / "deck.xml").write_text(deck)
    model = msahl.load(tmp_path / "deck.xml")
    # The lower rod is moved aside: its mass centre by -1, and the moments about x and z follow.
    options = {"t_final": 0.1, "error": "off"}
    found = model.gradient(["Rod 2.y final", "Lower.Mx mean"], "aside", **options)
    e = 1e-3
    runs = [model.with_(aside=s * e).run(**options) for s in (-1.0, 1.0)]
    mean = [np.trapezoid(run["Lower.Mx"], run.time) / run.time[-1] for run in runs]
    assert found.jacobian[0, 0] == pytest.approx(-1.0, rel=1e-9)
    assert found.jacobian[1, 0] == pytest.approx((mean[1] - mean[0]) / (2.0 * e), rel=1e-5)


def test_each_step_is_taken_once_and_each_pair_of_steps_once(monkeypatch):
    calls, compiled = [], tangent_run._differentiate
    monkeypatch.setattr(
        tangent_run, "_differentiate", lambda *given: (calls.append(given), compiled(*given))
    )
    model = msahl.load(DECKS / "basics/two_rods.xml")
    model.gradient("Lower.angle final", "L1,L2,m1", t_final=0.1)
    assert len(calls) == 50 + 25
    model.gradient("Lower.angle final", "L1,L2,m1", t_final=0.1, error="off")
    assert len(calls) == 50 + 25 + 50


def test_compiled_and_plain_derivatives_are_the_same(monkeypatch):
    model = msahl.load(DECKS / "basics/two_rods.xml")
    fast, plain = [], midpoint_tangent.differentiate
    for found in (fast, fast):
        found.append(model.gradient("Lower.angle max", "L1,c1", t_final=0.01, error="off"))
        monkeypatch.setattr(tangent_run, "_differentiate", plain)
    assert (fast[0].jacobian == fast[1].jacobian).all()


def test_columns_are_differentiated_at_all_output_times():
    model = msahl.load(DECKS / "forces/spring_damper.xml")
    options = {"t_final": 0.5, "error": "off"}
    run = model.run(gradient=["Body.x", "Body.x final", "Body.x at 0.2"], wrt="Spring.stiffness",
                    **options)  # fmt: skip
    slopes = run.gradient.columns["Body.x"]
    assert slopes.shape == (len(run.time), 1)
    assert slopes[0] == 0.0
    row = int(np.argmin(np.abs(run.time - 0.2)))
    assert [slopes[-1, 0], slopes[row, 0]] == pytest.approx(run.gradient.jacobian[:, 0], rel=1e-9)


def test_the_estimated_error_is_that_of_the_scheme():
    model = msahl.load(DECKS / "basics/parameters.xml")
    options = {"t_final": 1.0}
    found = model.gradient("Hinge.angle final", "L,start", **options)
    exact = model.gradient("Hinge.angle final", "L,start", scheme="gauss3", dt=0.01, **options)
    ratio = found.errors / np.abs(found.jacobian - exact.jacobian)
    # 1.5 is the safety factor; terms of higher order are small at 5 ms.
    assert ratio == pytest.approx(1.5, rel=0.05)
    assert (exact.errors < 1e-8).all()
    unknown = model.gradient("Hinge.angle final", "L,start", error="off", **options)
    assert np.isnan(unknown.errors).all()
    assert (unknown.jacobian == found.jacobian).all()


def test_a_chaotic_motion_is_reported():
    model = msahl.load(DECKS / "basics/two_rods.xml", start=120.0, c1=0.0, c2=0.0)
    options = {"t_final": 20.0, "dt": 0.01, "error": "off", "every": 100}
    remarks = model.gradient("Lower.angle final", "L1", **options).remarks
    assert "unstable or chaotic" in remarks[0]
    calm = model.with_(start=5.0).gradient("Lower.angle final", "L1", **options).remarks
    assert not calm


def test_a_parameter_at_the_edge_of_what_is_allowed_is_differenced_to_one_side():
    model = msahl.load(DECKS / "basics/two_rods.xml", c1=0.0)
    at_edge, inside = (
        of.gradient("Lower.angle final", "c1", t_final=0.5, error="off").jacobian[0, 0]
        for of in (model, model.with_(c1=1e-6))
    )
    assert at_edge == pytest.approx(inside, rel=1e-4)


def test_constants_that_are_equal_by_chance_are_distinguished():
    model = msahl.load(DECKS / "machines/cart_pole.xml")
    equal = model.with_(kRate=model.parameters["kVelocity"]["value"])
    near = model.with_(kRate=model.parameters["kVelocity"]["value"] * (1.0 + 1e-7))
    one, other = (
        of.gradient("Hinge.angle final", "kRate", t_final=0.2, error="off").jacobian[0, 0]
        for of in (equal, near)
    )
    assert one == pytest.approx(other, rel=1e-5)


@pytest.mark.parametrize(
    ("measure", "wrt", "said"),
    [
        ("Hinge.angl final", "L", "did you mean Hinge.angle"),
        ("steps", "L", "name a column"),
        ("Hinge.angle final", "LL", "did you mean L"),
        ("Hinge.angle final", "simulation.deltaT", "held fixed"),
        ("Hinge.angle final", "Rod.position.z", "the deck allows no values near"),
    ],
)
def test_faults_name_what_there_is(measure, wrt, said):
    model = msahl.load(DECKS / "basics/parameters.xml")
    with pytest.raises(msahl.GradientError, match=said):
        model.gradient(measure, wrt, t_final=0.1)
