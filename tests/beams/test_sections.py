"""Sections of beams: areas, moments, torsion constants, shear factors."""

import math

import numpy as np
import pytest

from msahl.beams.sections import (
    Material,
    compliance,
    geometry,
    of_geometry,
    outline,
    rectangle_torsion,
)

ROUND_OFF = 1e-14


def moments(points):
    """Area and second moments about y and z of a polygon, by Green's theorem."""
    p = np.array([*points, points[0]])
    (y, z), (y1, z1) = p[:-1].T, p[1:].T
    c = y * z1 - y1 * z
    area = 0.5 * c.sum()
    I2 = (c * (z * z + z * z1 + z1 * z1)).sum() / 12.0
    I3 = (c * (y * y + y * y1 + y1 * y1)).sum() / 12.0
    return area, I2, I3


@pytest.mark.parametrize(
    ("kind", "sizes"), [("rectangle", (0.3, 0.1)), ("iSection", (0.1, 0.2, 0.01, 0.006))]
)
def test_moments_are_those_of_the_outline(kind, sizes):
    found = geometry(kind, sizes, 0.3)
    assert found[:3] == pytest.approx(moments(outline(kind, sizes)), rel=ROUND_OFF)


def test_a_round_outline_has_the_moments_but_for_its_corners():
    found = geometry("circle", (0.1,), 0.3)
    # A regular polygon of 24 corners has 1.1 % less area and 2.3 % less moment.
    assert moments(outline("circle", (0.1,))) == pytest.approx(found[:3], rel=0.025)


def test_torsion_of_rectangles():
    # Timoshenko and Goodier, table 7: k1 of J = k1 (2a)^3 2b.
    for ratio, k in ((1.0, 0.1406), (1.5, 0.196), (2.0, 0.229), (4.0, 0.281), (10.0, 0.312)):
        assert rectangle_torsion(ratio, 1.0) / ratio == pytest.approx(k, abs=6e-4)  # three digits
        assert rectangle_torsion(1.0, ratio) == rectangle_torsion(ratio, 1.0)
    assert rectangle_torsion(1.0, 1.0) == pytest.approx(0.14057701, rel=1e-7)


def test_shear_factors_of_cowper():
    assert geometry("rectangle", (1.0, 2.0), 0.0).k2 == pytest.approx(5.0 / 6.0)
    assert geometry("circle", (1.0,), 0.3).k2 == pytest.approx(7.8 / 8.8)
    # A tube without a hole is a circle; one with a thin wall has 2 (1 + nu)/(4 + 3 nu).
    assert geometry("tube", (1.0, 1.0), 0.3) == pytest.approx(geometry("circle", (1.0,), 0.3))
    assert geometry("tube", (1.0, 1e-6), 0.3).k2 == pytest.approx(2.6 / 4.9, rel=1e-6)
    # The web of an I carries the shear: k_3 A is its area, roughly.
    found = geometry("iSection", (0.1, 0.2, 0.01, 0.006), 0.3)
    assert found.k3 * found.area == pytest.approx(0.18 * 0.006, rel=0.1)


def test_mass_and_inertia_of_a_section():
    material = Material(2e11, 8e10, 7800.0)
    section = of_geometry(geometry("circle", (0.1,), material.poisson), material, "timoshenko")
    assert section.mass == pytest.approx(7800.0 * math.pi * 0.01)
    tensor = np.array(section.inertia)
    assert np.diag(tensor) == pytest.approx(7800.0 * 0.25e-4 * math.pi * np.array([2, 1, 1]))


def test_theories_are_limits_of_stiffness():
    K = np.diag([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    K[3, 4] = K[4, 3] = 1.0
    K[0, 3] = K[3, 0] = 0.5
    for theory, rigid in (
        ("timoshenko", []),
        ("eulerBernoulli", [1, 2]),
        ("inextensible", [0, 1, 2]),
    ):
        stiff = K.copy()
        stiff[rigid, rigid] = 1e12
        # The limit is reached to 1e-12 of what it is.
        assert np.array(compliance(K, theory)) == pytest.approx(np.linalg.inv(stiff), abs=1e-11)
