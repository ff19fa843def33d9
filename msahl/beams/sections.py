"""Stiffness, mass and outline of a beam's cross-section.

Axes of the section: y along d_2, z along d_3, from its centroid; d_1 is normal to it.

    K = diag(EA, k_2 GA, k_3 GA, GJ, EI_2, EI_3)    I_2 = integral of z^2, I_3 = integral of y^2

The law is linear: (n_1, n_2, n_3, m_1, m_2, m_3) = K (stretch, two shears, twist rate, two
curvatures). Shear factors are Cowper's (The shear coefficient in Timoshenko's beam theory, 1966);
the torsion constant of a rectangle is Saint-Venant's series, that of an I section the sum of
b t^3/3 over its three thin parts.
"""

import math
from collections.abc import Callable, Mapping
from typing import NamedTuple, cast

import numpy as np

from msahl.algebra.vector import Vector
from msahl.model.beams import Compliance, Section
from msahl.model.shapes import Points
from msahl.records import record

SIZES: Mapping[str, tuple[str, ...]] = {
    "rectangle": ("width", "height"),
    "circle": ("radius",),
    "tube": ("radius", "thickness"),
    "iSection": ("width", "height", "flange", "web"),
}
"""Sizes [m] of each shape: ``width`` along d_2, ``height`` along d_3, ``flange`` and ``web`` the
thicknesses of an I whose web is along d_3; ``radius`` of a tube is the outer one."""

ROUND = 24
"""Corners of the outline of a round section."""

TERMS = 40
"""Terms of the series of a rectangle's torsion constant: the last is 1e-10 of the sum."""


@record
class Material:
    """Young's modulus and shear modulus [Pa], density [kg/m^3]."""

    E: float
    G: float
    density: float

    @property
    def poisson(self) -> float:
        """Poisson's ratio of an isotropic material with these moduli."""
        return 0.5 * self.E / self.G - 1.0


class Geometry(NamedTuple):
    """Area [m^2], second moments about d_2 and d_3 [m^4], torsion constant [m^4], shear factors."""

    area: float
    I2: float
    I3: float
    torsion: float
    k2: float
    k3: float


def of_geometry(geometry: Geometry, material: Material, theory: str) -> Section:
    """Return the section of a homogeneous material."""
    A, I2, I3, J, k2, k3 = geometry
    E, G, rho = material.E, material.G, material.density
    stiffness = np.diag([E * A, k2 * G * A, k3 * G * A, G * J, E * I2, E * I3])
    return section(stiffness, rho * A, (rho * (I2 + I3), rho * I2, rho * I3), theory)


def section(stiffness: np.ndarray, mass: float, inertia: Vector, theory: str) -> Section:
    """Return the section of K (6, 6), ``mass`` [kg/m] and rotary ``inertia`` about d_1, d_2, d_3
    [kg m], both per length; ``theory`` says which strains are zero."""
    x, y, z = inertia
    tensor = ((x, 0.0, 0.0), (0.0, y, 0.0), (0.0, 0.0, z))
    return Section(compliance(stiffness, theory), mass, tensor)


def geometry(kind: str, sizes: tuple[float, ...], poisson: float) -> Geometry:
    """Return the geometry of a shape of ``SIZES`` with the default torsion constant and factors."""
    return GEOMETRIES[kind](*sizes, poisson)


def outline(kind: str, sizes: tuple[float, ...]) -> Points:
    """Return the corners (y, z) [m] of a shape, counterclockwise about d_1."""
    if kind in ("circle", "tube"):
        return circle(sizes[0])
    b, h = 0.5 * sizes[0], 0.5 * sizes[1]
    if kind == "rectangle":
        return ((-b, -h), (b, -h), (b, h), (-b, h))
    t, f = 0.5 * sizes[3], h - sizes[2]
    right = ((b, -h), (b, -f), (t, -f), (t, f), (b, f), (b, h))
    return (*right, *((-y, z) for y, z in reversed(right)))


def circle(radius: float) -> Points:
    """Return the corners of a round outline."""
    angles = [2.0 * math.pi * i / ROUND for i in range(ROUND)]
    return tuple((radius * math.cos(a), radius * math.sin(a)) for a in angles)


def _rectangle(b: float, h: float, nu: float) -> Geometry:
    k = 10.0 * (1.0 + nu) / (12.0 + 11.0 * nu)
    return Geometry(b * h, b * h**3 / 12.0, h * b**3 / 12.0, rectangle_torsion(b, h), k, k)


def rectangle_torsion(b: float, h: float) -> float:
    """Return the torsion constant of a rectangle [m^4]: with a >= c its sides,

    a c^3 (1/3 - 64 c/(pi^5 a) sum of tanh(n pi a/(2 c))/n^5, n = 1, 3, ...).
    Source: Timoshenko, Goodier, Theory of Elasticity, 1970, article 109.
    """
    a, c = max(b, h), min(b, h)
    total = sum(math.tanh(0.5 * n * math.pi * a / c) / n**5 for n in range(1, 2 * TERMS, 2))
    return a * c**3 * (1.0 / 3.0 - 64.0 * c / (math.pi**5 * a) * total)


def _circle(r: float, nu: float) -> Geometry:
    moment, k = 0.25 * math.pi * r**4, 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu)
    return Geometry(math.pi * r * r, moment, moment, 2.0 * moment, k, k)


def _tube(r: float, t: float, nu: float) -> Geometry:
    inner = r - t
    moment, q = 0.25 * math.pi * (r**4 - inner**4), (inner / r) ** 2
    p = (1.0 + q) ** 2
    k = 6.0 * (1.0 + nu) * p / ((7.0 + 6.0 * nu) * p + (20.0 + 12.0 * nu) * q)
    return Geometry(math.pi * (r * r - inner * inner), moment, moment, 2.0 * moment, k, k)


def _i_section(b: float, h: float, f: float, w: float, nu: float) -> Geometry:
    """Return the geometry of an I section; along the flanges (d_2) their share of the area times
    5/6 carries the shear."""
    web = h - 2.0 * f
    A = 2.0 * b * f + web * w
    I2 = (b * h**3 - (b - w) * web**3) / 12.0
    I3 = (2.0 * f * b**3 + web * w**3) / 12.0
    J = (2.0 * b * f**3 + web * w**3) / 3.0
    depth = h - f  # between the middles of the flanges
    m, n = 2.0 * b * f / (depth * w), b / depth
    below = 12.0 + 72.0 * m + 150.0 * m**2 + 90.0 * m**3
    below += nu * (11.0 + 66.0 * m + 135.0 * m**2 + 90.0 * m**3)
    below += 30.0 * n**2 * (m + m**2) + 5.0 * nu * n**2 * (8.0 * m + 9.0 * m**2)
    k3 = 10.0 * (1.0 + nu) * (1.0 + 3.0 * m) ** 2 / below
    return Geometry(A, I2, I3, J, 5.0 / 6.0 * 2.0 * b * f / A, k3)


GEOMETRIES: Mapping[str, Callable[..., Geometry]] = {
    "rectangle": _rectangle,
    "circle": _circle,
    "tube": _tube,
    "iSection": _i_section,
}

RIGID: Mapping[str, tuple[int, ...]] = {
    "timoshenko": (),
    "eulerBernoulli": (1, 2),
    "inextensible": (0, 1, 2),
}
"""Strains that each theory keeps at zero, of stretch, shears along d_2 and d_3, twist, curvatures
about d_2 and d_3."""


def compliance(stiffness: np.ndarray, theory: str) -> Compliance:
    """Return C (6, 6), the inverse of K over the strains that ``theory`` leaves free, else zero."""
    free = [i for i in range(6) if i not in RIGID[theory]]
    C = np.zeros((6, 6))
    C[np.ix_(free, free)] = np.linalg.inv(stiffness[np.ix_(free, free)])
    rows = tuple(tuple(row) for row in (0.5 * (C + C.T)).tolist())
    return cast(Compliance, rows)
