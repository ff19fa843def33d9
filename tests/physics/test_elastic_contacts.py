"""A ball that falls on the tip of a clamped elastic body, against its modes, integrated by scipy.

The body with its frame fixed at the root has the amplitudes a of unit modal mass, and the ball the
height z above the tip, which moves by b a:

    a" = f - Lambda a - b F      z" = -g + F/m      gap = z - b a

with the modal forces f of gravity. Nothing of msahl's floating frame or contacts is used.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import msahl
from msahl.reduction.body import body_bytes
from tests.support.elastic import reduced_box

DECK = """<data><system><gravity><g3>-9.81</g3></gravity><bodies><ground><name>Base</name></ground>
<elasticBody file="box.npz"><name>Box</name></elasticBody>
<rigidBody><name>Ball</name><mass units="kg">{m}</mass>
<moi><Ixx>1e-4</Ixx><Iyy>1e-4</Iyy><Izz>1e-4</Izz></moi>
<initialConditions><position basis="Base"><x>{x}</x><y>{y}</y><z>{z}</z></position>
<velocity basis="inertial"><v3>{v}</v3></velocity></initialConditions></rigidBody></bodies>
<joints><rigid><name>Clamp</name>
<parent><name>Base</name><position><x>{rx}</x><y>{ry}</y><z>{rz}</z></position></parent>
<child><name>Box.Root</name></child></rigid></joints>
<contacts><planeContact><name>Hit</name>
<parent><name>Box.Tip</name><normal><z>1</z></normal></parent>
<child><name>Ball</name></child><radius units="m">{r}</radius>{law}</planeContact></contacts>
</system><simulation scheme="gauss" degree="2"><title>t</title><deltaT>1e-5</deltaT>
<tFinal>{end}</tFinal></simulation></data>"""
MASS, RADIUS, GAP, SPEED, END = 0.1, 0.02, 1e-4, -1.0, 2e-3
GRAVITY = 9.81


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("contact")
    (made / "box.npz").write_bytes(body_bytes(reduced_box()))
    return made


def final(folder, law):
    """Result, and at its end: height of the ball, of the tip, and the ball's speed."""
    body = reduced_box()
    root, tip = body.centre + body.interface_places
    text = DECK.format(
        m=MASS, r=RADIUS, v=SPEED, law=law, end=END,
        x=tip[0], y=tip[1], z=tip[2] + RADIUS + GAP, rx=root[0], ry=root[1], rz=root[2],
    )  # fmt: skip
    (folder / "deck.xml").write_text(text)
    result = msahl.load(folder / "deck.xml").run(error="off")
    ball, moved = result["Ball.z"][-1] - tip[2] - RADIUS, result["Box.Tip.z"][-1] - tip[2]
    return result, (ball, moved, result["Ball.vz"][-1])


class Modes:
    """The ball and the clamped body; y = z, z', a, a'."""

    def __init__(self):
        fixed = reduced_box(frame="Root")
        self.b, self.squares = fixed.interface_shapes[1, 2], fixed.eigenvalues
        self.load = -GRAVITY * fixed.invariants.translation[2]
        self.start = np.r_[GAP, SPEED, np.zeros(2 * self.b.size)]

    def parts(self, y):
        """Gap, its rate, amplitudes and rates."""
        a, rate = y[2:].reshape(2, -1)
        return y[0] - self.b @ a, y[1] - self.b @ rate, a, rate

    def integrate(self, y, begin, stiffness=0.0):
        def slope(_, y):
            gap, _, a, rate = self.parts(y)
            F = stiffness * max(0.0, -gap)
            acceleration = self.load - self.squares * a - self.b * F
            return np.r_[y[1], F / MASS - GRAVITY, rate, acceleration]

        # Steps far below the periods of 3 kHz, so that kinks of the force do no harm.
        limits = {"rtol": 1e-11, "atol": 1e-15, "max_step": 2e-6 if stiffness else np.inf}
        return solve_ivp(slope, (begin, END), y, "DOP853", dense_output=True, **limits)

    def final(self, found):
        y = found.y[:, -1]
        return y[0], y[0] - self.parts(y)[0], y[1]


@pytest.mark.slow
def test_a_rigid_impact_on_an_elastic_body(folder):
    """One impact with a restitution of 0.6: the impulse is that of the modes' effective mass, and
    the vibration that of the impulse."""
    result, found = final(folder, "<restitution>0.6</restitution>")
    modes = Modes()
    free = modes.integrate(modes.start, 0.0)
    time = brentq(lambda t: modes.parts(free.sol(t))[0], 0.0, 1.5 * GAP, xtol=1e-18)
    y = free.sol(time)
    speed = modes.parts(y)[1]
    impulse = -1.6 * speed / (1.0 / MASS + modes.b @ modes.b)
    y[1] += impulse / MASS
    y[2 + modes.b.size :] -= impulse * modes.b
    [event] = result.frame("events").to_dict("records")
    # The shares of mass and the frame are those of the modes to 1e-8 in frequencies; the normal
    # rotates with the tip, by 1e-6 rad before the impact.
    assert event["time"] == pytest.approx(time, rel=1e-8)
    assert event["gapSpeedBefore"] == pytest.approx(speed, rel=1e-8)
    assert event["impulse"] == pytest.approx(impulse, rel=1e-6)
    wanted = modes.final(modes.integrate(y, time))
    # The tip moves by 7e-5 m: what is of second order is 1e-8 m and less by its length.
    assert found == pytest.approx(wanted, rel=1e-6, abs=1e-9)


@pytest.mark.slow
def test_a_compliant_contact_on_an_elastic_body(folder):
    """The ball presses for 1 ms, while the body vibrates."""
    modes = Modes()
    _, found = final(folder, "<stiffness>1e6</stiffness>")
    wanted = modes.final(modes.integrate(modes.start, 0.0, 1e6))
    assert wanted[2] > 0.5  # it has rebounded
    assert found == pytest.approx(wanted, rel=2e-6, abs=1e-9)
