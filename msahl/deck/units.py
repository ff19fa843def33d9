"""Units that a deck may use, and the exact factor of each to SI.

The schema lists the same names for each physical quantity (type ``lengthUnits`` and so on), which a
test checks. ``sec`` and ``s`` are the same unit. Definitions: foot 0.3048 m, pound 0.45359237 kg,
standard gravity 9.80665 m/s^2, all exact (NIST SP 811); a slug is the mass to which one lbf gives
1 ft/s^2.
"""

import math
from collections.abc import Mapping
from fractions import Fraction

Factors = Mapping[str, Fraction]

_FT = Fraction("0.3048")
_IN = _FT / 12
_LBM = Fraction("0.45359237")
_LBF = _LBM * Fraction("9.80665")
_SLUG = _LBF / _FT
_DEG = Fraction(math.pi) / 180
_LENGTHS = {
    "m": Fraction(1),
    "mm": Fraction(1, 1000),
    "cm": Fraction(1, 100),
    "km": Fraction(1000),
    "ft": _FT,
    "in": _IN,
}


_ANGLES = {"rad": Fraction(1), "deg": _DEG}
_MOMENTS = {
    "N-m": Fraction(1),
    "N-mm": Fraction(1, 1000),
    "kN-m": Fraction(1000),
    "lbf-ft": _LBF * _FT,
    "lbf-in": _LBF * _IN,
}
_FORCE_PER_LENGTH = {
    "N/m": Fraction(1),
    "N/mm": Fraction(1000),
    "kN/m": Fraction(1000),
    "lbf/ft": _LBF / _FT,
    "lbf/in": _LBF / _IN,
}


def _per_second(factors: Factors, power: str = "") -> dict[str, Fraction]:
    """Return the units ``u/sec`` and ``u/s`` (``power`` "^2": per second squared) of each ``u``."""
    return {f"{u}/{s}{power}": f for u, f in factors.items() for s in ("sec", "s")}


def _times_second(factors: Factors, power: str = "") -> dict[str, Fraction]:
    """Return the units ``a-sec/b`` and ``a-s/b`` of each ``a/b``: those of damping from those of
    stiffness; ``power`` as above."""
    seconds = [f"-{s}{power}/" for s in ("sec", "s")]
    return {u.replace("/", s): f for u, f in factors.items() for s in seconds}


_MOMENT_PER_ANGLE = {f"{m}/{a}": f / g for m, f in _MOMENTS.items() for a, g in _ANGLES.items()}
_RATES = {**_per_second(_ANGLES), "rpm": 6 * _DEG}

UNITS: Mapping[str, Factors] = {
    "length": _LENGTHS,
    "mass": {
        "kg": Fraction(1),
        "g": Fraction(1, 1000),
        "slug": _SLUG,
        "lbm": _LBM,
    },
    "inertia": {
        "kg-m^2": Fraction(1),
        "kg-cm^2": Fraction(1, 10**4),
        "kg-mm^2": Fraction(1, 10**6),
        "g-cm^2": Fraction(1, 10**7),
        "slug-ft^2": _SLUG * _FT**2,
        "lbm-ft^2": _LBM * _FT**2,
        "lbm-in^2": _LBM * _IN**2,
    },
    "angle": _ANGLES,
    "velocity": _per_second(_LENGTHS),
    "angularVelocity": _RATES,
    "acceleration": _per_second(_LENGTHS, "^2"),
    "force": {"N": Fraction(1), "mN": Fraction(1, 1000), "kN": Fraction(1000), "lbf": _LBF},
    "moment": _MOMENTS,
    "time": {
        "sec": Fraction(1),
        "s": Fraction(1),
        "ms": Fraction(1, 1000),
        "min": Fraction(60),
    },
    "frequency": {**_RATES, "Hz": 360 * _DEG},
    "stiffness": _FORCE_PER_LENGTH,
    "damping": _times_second(_FORCE_PER_LENGTH),
    "angularStiffness": _MOMENT_PER_ANGLE,
    "angularDamping": _times_second(_MOMENT_PER_ANGLE),
    "lineLoad": _FORCE_PER_LENGTH,
    "dragCoefficient": _times_second({"N/m^2": Fraction(1), "lbf/ft^2": _LBF / _FT**2}, "^2"),
}
"""Factor to SI of every unit of every physical quantity."""

DEFAULTS: Mapping[str, Mapping[str, str]] = {
    "SI": {quantity: next(iter(factors)) for quantity, factors in UNITS.items()},
    "US": {
        "length": "ft",
        "mass": "slug",
        "inertia": "slug-ft^2",
        "angle": "rad",
        "velocity": "ft/sec",
        "angularVelocity": "rad/sec",
        "acceleration": "ft/sec^2",
        "force": "lbf",
        "moment": "lbf-ft",
        "time": "sec",
        "frequency": "rad/sec",
        "stiffness": "lbf/ft",
        "damping": "lbf-sec/ft",
        "angularStiffness": "lbf-ft/rad",
        "angularDamping": "lbf-ft-sec/rad",
        "lineLoad": "lbf/ft",
        "dragCoefficient": "lbf-sec^2/ft^2",
    },
}
"""Unit of a number without ``units``, per unit system; the SI unit is the first of each list."""


UNIT_FACTORS: Mapping[str, frozenset[str]] = {
    quantity: frozenset(unit for unit, factor in factors.items() if factor == 1)
    for quantity, factors in UNITS.items()
}
"""Units whose factor is 1, by physical quantity."""


def to_si(value: float, unit: str, quantity: str) -> float:
    """Return ``value`` in SI, rounded once: 9 mm is 0.009 m, and values in SI are unchanged.

    A result too large for a double is infinite.
    """
    if unit in UNIT_FACTORS[quantity] or not math.isfinite(value):
        return value
    factor = UNITS[quantity][unit]
    try:
        return float(Fraction(value) * factor)
    except OverflowError:
        return math.copysign(math.inf, value)
