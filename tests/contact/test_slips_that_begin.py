"""Slips that begin where a grip gives way, in any direction: against an independent integration.

A point of 1 kg on a plane is pushed by a force that grows as 6 t and rotates. The friction, of
coefficient 0.3, holds it until 0.4905 s; then the slip grows from nothing, by the square of the
time, along a direction that rotates with the force.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import msahl
from msahl.ports import sliding

G, MU, GROWTH = 9.81, 0.3, 6.0
BEGINS = MU * G / GROWTH
DECK = """<data><unitSystem>SI</unitSystem><system><gravity><g3>-9.81</g3></gravity>
<bodies><ground><name>Floor</name></ground><rigidBody><name>P</name><mass>1</mass>
<moi><Ixx>1e-3</Ixx><Iyy>1e-3</Iyy><Izz>1e-3</Izz></moi></rigidBody></bodies>
<contacts><planeContact><name>C</name><parent><name>Floor</name><normal><z>1</z></normal></parent>
<child><name>P</name></child><friction>0.3</friction></planeContact></contacts>
<loads>
<concentrated><name>Fx</name><body>P</body><force basis="Floor"><xForce>1</xForce></force>
<law><expression>6*t*cos({rate}*t)</expression></law></concentrated>
<concentrated><name>Fy</name><body>P</body><force basis="Floor"><yForce>1</yForce></force>
<law><expression>6*t*sin({rate}*t)</expression></law></concentrated></loads></system>
<simulation><title>Slip</title><deltaT>{dt}</deltaT><tFinal>1</tFinal></simulation></data>
"""


def place(rate, scheme, dt, tmp_path):
    """Place (2,) of the point at 1 s, and the kinds of events, of a run."""
    path = tmp_path / "slip.xml"
    path.write_text(DECK.format(rate=rate, dt=dt))
    done = msahl.load(path).run(error="off", solver="newton", scheme=scheme)
    assert done.report["status"] == "completed"
    return done.states[["P.x", "P.y"]].to_numpy()[-1], done.events["kind"].tolist()


def exact(rate):
    """Place (2,) at 1 s, to about 1e-13 m: a stiff integration from 1e-5 s after the beginning, up
    to which the slip is half the growth by the square of the time along the force."""
    after = 1e-5
    t = BEGINS + after
    slip = 0.5 * GROWTH * after**2 * np.array([np.cos(rate * t), np.sin(rate * t)])

    def rates(t, y):
        v = y[2:]
        force = GROWTH * t * np.array([np.cos(rate * t), np.sin(rate * t)])
        return np.concatenate([v, force - MU * G * v / np.hypot(*v)])

    begin = np.concatenate([slip * after / 3.0, slip])
    found = solve_ivp(rates, (t, 1.0), begin, method="Radau", rtol=1e-12, atol=1e-16)
    return found.y[:2, -1]


@pytest.mark.sampled
@pytest.mark.parametrize(("scheme", "sizes", "least"), [
    ("preserving", (0.02, 0.01, 0.005), 1.9), ("gauss2", (0.04, 0.02, 0.01, 0.005), 3.8),
    ("gauss3", (0.1, 0.05, 0.025), 5.8),
], ids=["preserving", "gauss2", "gauss3"])  # fmt: skip
@pytest.mark.parametrize("rate", [3.0, 12.0])
def test_the_order_is_kept(rate, scheme, sizes, least, tmp_path):
    """By the slope over all sizes: the time of the onset stands differently in the steps of each,
    by which single ratios scatter. The smallest error is 1e-11 m, above what the integration has.
    """
    true, errors = exact(rate), []
    for dt in sizes:
        x, kinds = place(rate, scheme, dt, tmp_path)
        assert kinds == ["closes", "sticks", "slides"]
        errors.append(np.hypot(*(x - true)))
    slope = np.polyfit(np.log(sizes), np.log(errors), 1)[0]
    assert slope > least


@pytest.mark.slow
@pytest.mark.parametrize(("scheme", "close"), [
    ("gauss2", 1e-5), ("gauss3", 1e-6), ("radau2", 1e-4), ("preserving", 1e-4),
])  # fmt: skip
def test_a_force_that_rotates_fast(scheme, close, tmp_path):
    """Four and a half revolutions in the run, three tenths of a radian in a step. The errors are
    those of the schemes at this step, a hundredth of the displacement of 6 mm and less."""
    x, kinds = place(30.0, scheme, 0.01, tmp_path)
    assert kinds == ["closes", "sticks", "slides"]
    assert np.hypot(*(x - exact(30.0))) < close


def group(width, friction=0.3, still=1e-10):
    one = np.array([0])
    return sliding.Sliding(
        row=one,
        tangent=np.array([[1, 2]]),
        along=np.array([[0, 1]]),
        reaction=one,
        friction=np.array([friction]),
        grip=np.array([0.3]),
        toward=np.array([[1.0, 0.0]]),
        still=np.array([still]),
        width=np.array([width]),
        column=one,
    )


@pytest.mark.parametrize(("width", "still"), [
    (0.0, 1e-10), (1e-3, 1e-10), (0.2, 1e-10), (50.0, 1e-10), (0.0, 0.1), (0.0, 0.3), (0.0, 1.0),
])  # fmt: skip
@pytest.mark.parametrize("slip", [(0.3, 0.2), (-0.3, 0.2), (0.01, -0.4)])
def test_the_slope_of_a_direction_is_its_derivative(width, still, slip):
    """Differences of order 2 over 1e-6 m/s: 1e-10."""
    of, e = group(width, still=still), 1e-6
    d_1, d_2, speed = sliding.direction(of, 0, *slip)
    for i in range(2):
        row = sliding.direction_slope(of, 0, (d_1, d_2), slip, i)
        for j in range(2):
            near = [np.array(slip), np.array(slip)]
            near[0][j] -= e
            near[1][j] += e
            low, high = (sliding.direction(of, 0, *at)[i] for at in near)
            assert row[j] / speed == pytest.approx((high - low) / (2.0 * e), abs=1e-8)


def test_a_direction_begins_as_that_before_and_becomes_that_of_the_slip():
    """Of slips at a right angle to d0: what stands for the slip differs from it by e^3/s^2."""
    of = group(0.0, still=1e-3)
    for slip, close in ((1e-9, 1e-5), (1e-6, 2e-3)):
        assert sliding.direction(of, 0, 0.0, slip)[:2] == pytest.approx((1.0, 0.0), abs=close)
    assert sliding.direction(of, 0, 0.0, 1.0)[:2] == pytest.approx((0.0, 1.0), abs=2e-9)


def test_no_width_is_sought_where_nothing_slides():
    assert sliding.widest(None) == sliding.widest(group(0.0, friction=0.0)) == 0.0
    assert sliding.widest(group(0.0)) == 1.0
