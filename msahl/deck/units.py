"""Units that a deck may use, and the exact factor of each to SI.

The schema lists the same names for each physical quantity (type ``lengthUnits`` and so on), which a
test checks. ``sec`` and ``s`` are the same unit. Definitions: foot 0.3048 m, pound 0.45359237 kg,
standard gravity 9.80665 m/s^2, all exact (NIST SP 811); a slug is the mass to which one lbf gives
1 ft/s^2.
"""

import math
import re
from collections.abc import Mapping
from fractions import Fraction
from functools import cache
from typing import NamedTuple

from msahl.algebra.many import for_many
from msahl.expressions.dimensions import ANGLE, PURE, Dimension

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
    "stress": {
        "Pa": Fraction(1),
        "kPa": Fraction(1000),
        "MPa": Fraction(10**6),
        "GPa": Fraction(10**9),
        "N/m^2": Fraction(1),
        "N/mm^2": Fraction(10**6),
        "psi": _LBF / _IN**2,
        "lbf/in^2": _LBF / _IN**2,
        "lbf/ft^2": _LBF / _FT**2,
    },
    "density": {
        "kg/m^3": Fraction(1),
        "g/cm^3": Fraction(1000),
        "slug/ft^3": _SLUG / _FT**3,
        "lbm/ft^3": _LBM / _FT**3,
        "lbm/in^3": _LBM / _IN**3,
    },
    "bendingStiffness": {
        "N-m^2": Fraction(1),
        "N-mm^2": Fraction(1, 10**6),
        "kN-m^2": Fraction(1000),
        "lbf-ft^2": _LBF * _FT**2,
        "lbf-in^2": _LBF * _IN**2,
    },
    "massPerLength": {
        "kg/m": Fraction(1),
        "g/mm": Fraction(1),
        "g/m": Fraction(1, 1000),
        "slug/ft": _SLUG / _FT,
        "lbm/ft": _LBM / _FT,
        "lbm/in": _LBM / _IN,
    },
    "inertiaPerLength": {
        "kg-m": Fraction(1),
        "g-mm": Fraction(1, 10**6),
        "slug-ft": _SLUG * _FT,
        "lbm-ft": _LBM * _FT,
        "lbm-in": _LBM * _IN,
    },
    "areaMoment": {
        "m^4": Fraction(1),
        "cm^4": Fraction(1, 10**8),
        "mm^4": Fraction(1, 10**12),
        "ft^4": _FT**4,
        "in^4": _IN**4,
    },
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
        "stress": "lbf/ft^2",
        "density": "slug/ft^3",
        "bendingStiffness": "lbf-ft^2",
        "massPerLength": "slug/ft",
        "inertiaPerLength": "slug-ft",
        "areaMoment": "ft^4",
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
    if unit in UNIT_FACTORS[quantity]:
        return value
    return to_si_by(value, UNITS[quantity][unit])


@for_many
def to_si_by(value: float, factor: Fraction) -> float:
    """Return ``value``, in a unit of ``factor``, in SI, rounded once; infinite if too large."""
    if factor == 1 or not math.isfinite(value):
        return value
    n, d = value.as_integer_ratio()
    try:
        return (n * factor.numerator) / (d * factor.denominator)  # of integers: rounded once
    except OverflowError:
        return math.copysign(math.inf, value)


class Unit(NamedTuple):
    """A unit's factor to SI and its dimension."""

    factor: Fraction
    dimension: Dimension


class Parameter(NamedTuple):
    """A parameter of a deck: value in SI and dimension."""

    value: float
    dimension: Dimension


@cache
def symbols() -> Mapping[str, Unit]:
    """Return the units that others are made of by products, quotients and powers."""
    one = Fraction(1)
    m, kg, s, ampere = (Dimension(**{unit: one}) for unit in ("m", "kg", "s", "A"))

    def product(*powers: tuple[Dimension, int]) -> Dimension:
        total = PURE
        for base, n in powers:
            total = total.times(base.power(Fraction(n)))
        return total

    newton = product((kg, 1), (m, 1), (s, -2))
    joule, volt = newton.times(m), product((kg, 1), (m, 2), (s, -3), (ampere, -1))
    pascal = newton.times(m.power(Fraction(-2)))
    prefixes = {"": one, "k": one * 1000, "M": one * 10**6, "G": one * 10**9, "m": one / 1000}
    derived = {
        "N": (newton, "km"),
        "J": (joule, "km"),
        "W": (product((joule, 1), (s, -1)), "km"),
        "Pa": (pascal, "kMG"),
        "A": (ampere, "m"),
        "V": (volt, "km"),
        "ohm": (product((volt, 1), (ampere, -1)), "kmM"),
        "C": (product((ampere, 1), (s, 1)), ""),
        "H": (product((volt, 1), (s, 1), (ampere, -1)), "m"),
        "Wb": (product((volt, 1), (s, 1)), ""),
    }
    found = {
        f"{prefix}{name}": Unit(prefixes[prefix], dimension)
        for name, (dimension, more) in derived.items()
        for prefix in ("", *more)
    }
    rate = ANGLE.times(s.power(Fraction(-1)))
    for quantity, base in (("length", m), ("mass", kg), ("angle", ANGLE), ("time", s)):
        found |= {name: Unit(factor, base) for name, factor in UNITS[quantity].items()}
    found |= {name: Unit(UNITS["frequency"][name], rate) for name in ("rpm", "Hz")}
    found |= {"h": Unit(one * 3600, s), "1": Unit(one, PURE), "%": Unit(one / 100, PURE)}
    found |= {"bar": Unit(one * 10**5, pascal), "psi": Unit(_LBF / _IN**2, pascal)}
    found |= {"L": Unit(one / 1000, m.power(Fraction(3))), "lbf": Unit(_LBF, newton)}
    return found


_FACTOR = re.compile(r"([A-Za-z%]+|1)(?:\^(-?[1-9]))?")


@cache
def parse_unit(name: str) -> Unit | None:
    """Return the unit ``kg/m^3``, ``N-m-s/rad`` and the like; None if it is none.

    Factors are joined by ``-``, all those after the one ``/`` divide, and ``^`` is followed by an
    exponent of one digit.
    """
    above, slash, below = name.partition("/")
    factor, dimension = Fraction(1), PURE
    for part, sign in ((above, 1), (below, -1)) if slash else ((above, 1),):
        position = 0
        while True:
            match = _FACTOR.match(part, position)
            if match is None or match[1] not in symbols() or len(part) > LONGEST_UNIT:
                return None
            n, unit = sign * int(match[2] or 1), symbols()[match[1]]
            factor *= unit.factor**n
            dimension = dimension.times(unit.dimension.power(Fraction(n)))
            position = match.end()
            if position == len(part):
                break
            if part[position] != "-":
                return None
            position += 1
    return Unit(factor, dimension)


LONGEST_UNIT = 60
"""Characters of one side of a compound unit."""


@cache
def dimension_of(quantity: str) -> Dimension:
    """Return the dimension of a physical quantity of ``UNITS``; "" is a plain number."""
    unit = parse_unit(DEFAULTS["SI"][quantity]) if quantity else symbols()["1"]
    assert unit is not None  # a test goes through all
    return unit.dimension


@for_many
def from_si(value: float, factor: Fraction) -> float:
    """Return a finite ``value`` in SI in the unit of a ``factor``.

    It is a short decimal that is read back to the same double, if there is one: 30 deg, taken to
    rad, are 30 deg again.
    """
    if factor == 1:
        return value
    nearest = to_si_by(value, 1 / factor)
    shorter = (float(f"{nearest:.{digits}g}") for digits in (15, 16))
    return next((x for x in shorter if to_si_by(x, factor) == value), nearest)
