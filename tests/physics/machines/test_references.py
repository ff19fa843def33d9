"""The independent integrations of machines: their own accuracy, and what each must conserve."""

import numpy as np
import pytest

from tests.physics.machines import cart_pole, engine, motor_four_bar, quarter_car, robot, satellite

CASES = {
    "robot": (robot.motion, 0.3),
    "engine": (engine.motion, 0.05),
    "quarter car": (quarter_car.motion, 1.0),
    "satellite": (satellite.motion, 20.0),
    "cart and pole": (cart_pole.motion, 2.0),
    "motor and four-bar": (motor_four_bar.motion, 0.3),
}


@pytest.mark.parametrize(("motion", "t"), CASES.values(), ids=CASES)
def test_a_tighter_tolerance_changes_nothing(motion, t):
    found, tighter = motion([t]), motion([t], rtol=5e-14)
    assert np.abs(found - tighter).max() < 1e-11 * max(1.0, np.abs(found).max())


@pytest.mark.slow
def test_the_errors_of_the_robot_decay_as_the_controller_demands():
    times = [0.2, 0.5]
    assert robot.motion(times)[:, :6] == pytest.approx(robot.exact(times), abs=1e-11)


def test_torques_of_the_robot_at_rest_carry_its_weight():
    """They are the gradient of the potential energy, by central differences."""
    q = np.array([0.3, -0.5, 0.8, 0.2, 1.1, -0.4])

    def potential(q):
        rotations, _, points = robot.kinematics(q)
        centres = [
            p + R @ link.centre for p, R, link in zip(points, rotations, robot.LINKS, strict=True)
        ]
        return -sum(
            link.mass * robot.GRAVITY @ c for link, c in zip(robot.LINKS, centres, strict=True)
        )

    step = 1e-5 * np.eye(6)
    gradient = [(potential(q + e) - potential(q - e)) / 2e-5 for e in step]
    found = robot.torques(q, np.zeros(6), np.zeros((1, 6)))[0]
    # Rounding of 60 J over the step.
    assert found == pytest.approx(gradient, abs=1e-8)


def test_the_power_of_the_robots_torques_is_the_change_of_its_energy():
    rng = np.random.default_rng(1)
    q, qd, qdd = rng.normal(size=(3, 6))

    def energy(t):
        """Along the motion q + qd t + qdd t^2/2."""
        at, rate = q + qd * t + qdd * t * t / 2, qd + qdd * t
        every = robot.torques(at, np.zeros(6), np.vstack([np.zeros(6), np.eye(6)]))
        M = every[1:] - every[0]
        rotations, _, points = robot.kinematics(at)
        height = sum(
            link.mass * (p + R @ link.centre)[2]
            for p, R, link in zip(points, rotations, robot.LINKS, strict=True)
        )
        return rate @ M @ rate / 2 + 9.81 * height

    power = (energy(1e-5) - energy(-1e-5)) / 2e-5
    assert robot.torques(q, qd, qdd[None])[0] @ qd == pytest.approx(power, abs=1e-7)


@pytest.mark.parametrize("angle", [0.4, 2.0, 4.5])
def test_accelerations_of_engine_and_four_bar_keep_the_energy(angle):
    """Without gas, load and current: the change of the kinetic energy is the work of the weight."""
    e, rate = 1e-5, 2.0

    def rest(theta, dot):
        """Kinetic and potential energy of the four-bar, from velocities of its points."""
        phi, psi, phi1, psi1, *_ = motor_four_bar.ratios(theta)
        m = motor_four_bar
        G = [
            (m.M_CRANK, m.CRANK / 2 * m.unit(theta), m.CRANK / 2 * m.normal(theta) * dot),
            (
                m.M_COUPLER,
                m.CRANK * m.unit(theta) + m.COUPLER / 2 * m.unit(phi),
                m.CRANK * m.normal(theta) * dot + m.COUPLER / 2 * m.normal(phi) * phi1 * dot,
            ),
            (m.M_ROCKER, m.ROCKER / 2 * m.unit(psi), m.ROCKER / 2 * m.normal(psi) * psi1 * dot),
        ]
        spin = (m.J_ROTOR + m.bar(m.M_CRANK, m.CRANK)) * dot**2
        spin += m.bar(m.M_COUPLER, m.COUPLER) * (phi1 * dot) ** 2
        spin += m.bar(m.M_ROCKER, m.ROCKER) * (psi1 * dot) ** 2
        return spin / 2 + sum(mass * (v @ v / 2 + m.G * x[1]) for mass, x, v in G)

    a = motor_four_bar.acceleration(angle, rate, 0.0)
    change = [rest(angle + rate * t + a * t * t / 2, rate + a * t) for t in (-e, e)]
    # Rounding of 10 J over the step.
    assert (change[1] - change[0]) / (2 * e) == pytest.approx(0.0, abs=1e-8)


def test_the_engine_without_gas_and_load_keeps_its_energy(monkeypatch):
    monkeypatch.setattr(engine, "TABLE", lambda theta: 0.0 * theta)
    monkeypatch.setattr(engine, "LOAD", 0.0)
    e, angle, rate = 1e-5, 1.1, 10.0

    def energy(theta, dot):
        place, rod, _ = engine.along_rod(theta, engine.ROD_CENTRE)
        pin, piston, _ = engine.along_rod(theta, engine.L)
        tilt = engine.rod(theta)[2]
        kinetic = engine.J_CRANK + engine.J_ROD * tilt**2
        kinetic += engine.M_ROD * rod @ rod + engine.M_PISTON * piston[1] ** 2
        height = engine.M_ROD * place[1] + engine.M_PISTON * pin[1]
        return kinetic * dot**2 / 2 + engine.G * height

    a = engine.acceleration(angle, rate)
    change = [energy(angle + rate * t + a * t * t / 2, rate + a * t) for t in (-e, e)]
    # The difference leaves e^2/6 times a third derivative of 7 J (10 rad/s)^3.
    assert (change[1] - change[0]) / (2 * e) == pytest.approx(0.0, abs=1e-6)


def test_the_satellite_keeps_its_angular_momentum():
    found = satellite.motion([10.0, 40.0])
    total, _ = satellite.constants()
    start = satellite.matrix(satellite.QUATERNION) @ total @ satellite.RATE
    for y in found:
        momentum = satellite.matrix(y[:4]) @ (total @ y[4:7] + satellite.J_SPIN * y[7:10])
        assert momentum == pytest.approx(start, abs=1e-11)


def test_the_gains_of_the_cart_are_those_of_the_regulator():
    found = cart_pole.optimal_gains()
    assert found == pytest.approx(cart_pole.GAINS, abs=1e-6)  # digits of the deck
