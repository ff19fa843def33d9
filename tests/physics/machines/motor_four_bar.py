"""DC motor with inductance on the crank of a four-bar linkage, in the crank's angle.

Links a, b, c and the ground d close the loop   a e(theta) + b e(phi) = d e(0) + c e(psi)
in the plane of x and z, angles from x to z. phi' and psi' are derivatives by theta.

    I theta'' + I' theta'^2 / 2 = n k i - V'(theta) ,    L i' = U(t) - R i - n k theta'
"""

import numpy as np

from tests.physics.machines.integration import integrate, rotation

GROUND, CRANK, COUPLER, ROCKER = 0.33, 0.10, 0.30, 0.27
M_CRANK, M_COUPLER, M_ROCKER = 0.5, 1.0, 0.9
J_ROTOR = 0.012
"""Rotor seen at the crank [kg m^2]."""
RESISTANCE, INDUCTANCE, CONSTANT, GEAR = 1.2, 0.006, 0.08, 10.0
VOLTAGE, RISE = 24.0, 0.05
"""Voltage [V], reached by 1 - exp(-t/RISE)."""
START, G = np.radians(60.0), 9.81


def bar(mass, length):
    """Moment of inertia of a uniform bar about its centre [kg m^2]."""
    return mass * length**2 / 12.0


def angles(theta):
    """Angles of coupler and rocker, the rocker to the left of the coupler's end."""
    x, z = GROUND - CRANK * np.cos(theta), -CRANK * np.sin(theta)
    distance = np.hypot(x, z)
    at_crank = np.arccos((COUPLER**2 + distance**2 - ROCKER**2) / (2.0 * COUPLER * distance))
    phi = np.arctan2(z, x) + at_crank
    end = CRANK * unit(theta) + COUPLER * unit(phi) - [GROUND, 0.0]
    return phi, np.arctan2(end[1], end[0])


def unit(angle):
    """Unit vector (x, z) at this angle."""
    return np.array([np.cos(angle), np.sin(angle)])


def normal(angle):
    """Derivative of ``unit`` by its angle."""
    return np.array([-np.sin(angle), np.cos(angle)])


def ratios(theta):
    """Angles phi, psi with their first and second derivatives by theta."""
    phi, psi = angles(theta)
    S, C = np.sin, np.cos
    phi1 = -CRANK * S(psi - theta) / (COUPLER * S(psi - phi))
    psi1 = CRANK * S(phi - theta) / (ROCKER * S(phi - psi))
    part = C(psi - theta) * (psi1 - 1.0) * S(psi - phi)
    rest = S(psi - theta) * C(psi - phi) * (psi1 - phi1)
    phi2 = -CRANK / COUPLER * (part - rest) / S(psi - phi) ** 2
    part = C(phi - theta) * (phi1 - 1.0) * S(phi - psi)
    rest = S(phi - theta) * C(phi - psi) * (phi1 - psi1)
    return phi, psi, phi1, psi1, phi2, CRANK / ROCKER * (part - rest) / S(phi - psi) ** 2


def acceleration(theta, rate, torque):
    """theta'' [rad/s^2] under a torque on the crank."""
    phi, psi, phi1, psi1, phi2, psi2 = ratios(theta)
    g1 = CRANK * normal(theta) + COUPLER / 2.0 * normal(phi) * phi1
    g2 = -CRANK * unit(theta) + COUPLER / 2.0 * (normal(phi) * phi2 - unit(phi) * phi1**2)
    j_crank = J_ROTOR + bar(M_CRANK, CRANK) + M_CRANK * CRANK**2 / 4.0
    j_coupler, j_rocker = bar(M_COUPLER, COUPLER), 4.0 * bar(M_ROCKER, ROCKER)
    inertia = j_crank + M_COUPLER * g1 @ g1 + j_coupler * phi1**2 + j_rocker * psi1**2
    change = 2.0 * (M_COUPLER * g1 @ g2 + j_coupler * phi1 * phi2 + j_rocker * psi1 * psi2)
    lever = M_CRANK * CRANK / 2.0 * np.cos(theta) + M_COUPLER * g1[1]
    lever += M_ROCKER * ROCKER / 2.0 * np.cos(psi) * psi1
    return (torque - G * lever - 0.5 * change * rate**2) / inertia


def motion(times, rtol=1e-12):
    """(times, 3) crank angle, its rate, and current."""
    k = GEAR * CONSTANT

    def rates(t, y):
        theta, rate, current = y
        voltage = VOLTAGE * (1.0 - np.exp(-t / RISE))
        change = (voltage - RESISTANCE * current - k * rate) / INDUCTANCE
        return np.array([rate, acceleration(theta, rate, k * current), change])

    return integrate(rates, [START, 0.0, 0.0], times, rtol)


def places(y):
    """Position and axes of each body by its name, from one of the times of ``motion``."""
    theta, about = y[0], np.array([0.0, -1.0, 0.0])
    phi, psi = angles(theta)
    pin = CRANK * np.array([np.cos(theta), 0.0, np.sin(theta)])
    return {
        "Crank": (np.zeros(3), rotation(about, theta)),
        "Coupler": (pin, rotation(about, phi)),
        "Rocker": (np.array([GROUND, 0.0, 0.0]), rotation(about, psi)),
    }
