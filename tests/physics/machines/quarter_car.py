"""Quarter car: two masses on a line, on a road whose height is a function of time.

    m_s z_s'' = -m_s g + spring - damper(z_s' - z_u')
    m_u z_u'' = -m_u g - spring + damper + tyre

Both positions count from static equilibrium, where spring and tyre carry the weight.
"""

import numpy as np

from tests.physics.machines.integration import integrate

M_BODY, M_WHEEL = 300.0, 40.0
K_SPRING, K_TYRE = 20000.0, 180000.0
DAMPING, ASYMMETRY, V_SIDES, V_BLOW = 1500.0, 0.5, 0.3, 0.8
"""Damper [N s/m]; share by which rebound exceeds bump; rates of the two transitions [m/s]."""
SPEED = 15.0
WAVES = ((0.005, 5.0, 0.0), (0.0015, 1.7, 0.6))
"""Amplitude [m], length [m] and phase [rad] of the road's waves."""
BUMP, BUMP_AT, BUMP_WIDTH = 0.03, 12.0, 0.6
"""Height, place and half width of the bump [m]."""


HEIGHTS = 0.7, 0.3
"""Of body and wheel in equilibrium [m]."""


def road(t):
    """Height of the road under the wheel [m]."""
    x = SPEED * t
    waves = sum(a * np.sin(2.0 * np.pi * x / length + phase) for a, length, phase in WAVES)
    return waves + BUMP * np.exp(-(((x - BUMP_AT) / BUMP_WIDTH) ** 2))


def damper(v):
    """Tension of the damper at the rate of extension v [N]."""
    return DAMPING * v * (1.0 + ASYMMETRY * np.tanh(v / V_SIDES)) / np.hypot(1.0, v / V_BLOW)


def motion(times, rtol=1e-12):
    """(times, 4) heights of body and wheel above equilibrium and their rates."""

    def rates(t, y):
        body, wheel, v_body, v_wheel = y
        strut = -K_SPRING * (body - wheel) - damper(v_body - v_wheel)
        tyre = K_TYRE * (road(t) - wheel)
        return np.array([v_body, v_wheel, strut / M_BODY, (tyre - strut) / M_WHEEL])

    return integrate(rates, np.zeros(4), times, rtol)


def places(y):
    """Position and axes of each body by its name, from one of the times of ``motion``."""
    up = np.array([0.0, 0.0, 1.0])
    body, wheel = np.add(HEIGHTS, y[:2])
    return {"Body": (body * up, np.eye(3)), "Wheel": (wheel * up, np.eye(3))}
