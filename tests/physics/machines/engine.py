"""Crank-slider engine in its crank angle, by the rod's geometry.

The cylinder is along z (up), the crank rotates about y. theta is the crank's angle, zero at top
dead centre; the rod makes the angle -beta with z, sin(beta) = s = (r/l) sin(theta). The kinetic
energy is I(theta) theta'^2 / 2, so Lagrange's equation is

    I theta'' + I' theta'^2 / 2 = Q(theta, theta')
"""

import numpy as np
from scipy.interpolate import CubicSpline

from tests.physics.machines.integration import integrate, rotation

R, L = 0.045, 0.144
"""Radius of the crank, length of the rod [m]."""
ROD_CENTRE = 0.040
"""Mass centre of the rod from the crank pin [m]."""
M_PISTON, M_ROD, J_ROD = 0.42, 0.58, 0.0022
J_CRANK = 0.12
"""Crank with flywheel about its axis [kg m^2]; its mass centre is on the axis."""
LOAD = 0.11
"""Load torque over speed [N m s]."""
START, RATE = np.radians(-30.0), 140.0
"""Angle and speed at the start [rad, rad/s]."""
G = 9.81
GAS = (
    *(4800, 11400, 6200, 3300, 2000, 1350, 1000, 800, 620, 380),  # expansion from top dead centre
    *(180, 80, 60, 60, 60, 60, 60, 50),  # exhaust
    *(0, -40, -60, -70, -70, -70, -60, -50, -40, -20),  # intake
    *(0, 40, 110, 230, 420, 760, 1400, 2700, 4800),  # compression
)
"""Gas force on the piston, down [N], every 20 degrees over two revolutions."""
TABLE = CubicSpline(np.linspace(0.0, 4.0 * np.pi, len(GAS)), GAS, bc_type="periodic")


def rod(theta):
    """Sine and cosine of beta, and beta's derivatives by theta: s, c, b1, b2."""
    s, s1, s2 = R / L * np.sin(theta), R / L * np.cos(theta), -R / L * np.sin(theta)
    c = np.sqrt(1.0 - s * s)
    return s, c, s1 / c, s2 / c + s * s1 * s1 / c**3


def along_rod(theta, a):
    """Point on the rod at ``a`` from the crank pin, and its derivatives by theta: (x, z) each."""
    s, c, b1, b2 = rod(theta)
    sin, cos = np.sin(theta), np.cos(theta)
    place = np.array([R * sin - a * s, R * cos + a * c])
    first = np.array([R * cos - a * c * b1, -R * sin - a * s * b1])
    second = np.array(
        [-R * sin - a * (c * b2 - s * b1 * b1), -R * cos - a * (s * b2 + c * b1 * b1)]
    )
    return place, first, second


def acceleration(theta, rate):
    """theta'' [rad/s^2]."""
    _, p1, p2 = along_rod(theta, L)
    _, g1, g2 = along_rod(theta, ROD_CENTRE)
    _, _, b1, b2 = rod(theta)
    inertia = J_CRANK + M_PISTON * p1[1] ** 2 + M_ROD * g1 @ g1 + J_ROD * b1 * b1
    change = 2.0 * (M_PISTON * p1[1] * p2[1] + M_ROD * g1 @ g2 + J_ROD * b1 * b2)
    gas = TABLE(theta % (4.0 * np.pi))
    load = -(gas + M_PISTON * G) * p1[1] - M_ROD * G * g1[1] - LOAD * rate
    return (load - 0.5 * change * rate * rate) / inertia


def motion(times, rtol=1e-12):
    """(times, 2) crank angle and its rate.

    A third derivative of the spline jumps at its knots. So time and speed at the knots are found
    first, with the angle as independent variable; each output time is reached from the knot before.
    """

    def by_angle(theta, y):
        return np.array([1.0 / y[1], acceleration(theta, y[1]) / y[1]])

    def by_time(_, y):
        return np.array([y[1], acceleration(*y)])

    knots = np.append(START, TABLE.x[1] * np.arange(np.ceil(START / TABLE.x[1]), 1000.0))
    at_knots = [np.array([0.0, RATE])]
    while at_knots[-1][0] <= times[-1]:
        first, last = knots[len(at_knots) - 1 : len(at_knots) + 1]
        there = integrate(
            lambda a, y, z=first: by_angle(z + a, y), at_knots[-1], [last - first], rtol
        )
        at_knots.append(there[0])
    found = []
    for t in times:
        k = max(i for i, (start, _) in enumerate(at_knots) if start <= t)
        begin = [knots[k], at_knots[k][1]]
        rest = t - at_knots[k][0]
        found.append(integrate(by_time, begin, [rest], rtol)[0] if rest else np.array(begin))
    return np.array(found)


def piston(theta):
    """Height of the piston [m]."""
    return along_rod(theta, L)[0][1]


def places(y):
    """Position and axes of each body by its name, from one of the times of ``motion``."""
    theta, about = y[0], np.array([0.0, 1.0, 0.0])
    pin = R * np.array([np.sin(theta), 0.0, np.cos(theta)])
    tilt = np.arcsin(R / L * np.sin(theta))
    return {
        "Crank": (np.zeros(3), rotation(about, theta)),
        "Rod": (pin, rotation(about, -tilt)),
        "Piston": (np.array([0.0, 0.0, piston(theta)]), np.eye(3)),
    }
