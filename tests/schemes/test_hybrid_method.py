"""Powell's hybrid method without scipy.optimize has its digits, and falls back on it."""

import numpy as np
import pytest
from scipy.optimize import root

from msahl.schemes.common import hybrid_method

SIZE, TOLERANCE = 12, 1e-11


def rows(z):
    """Broyden's tridiagonal function: a nonlinear chain whose root takes several iterations."""
    left, right = np.append(0.0, z[:-1]), np.append(z[1:], 0.0)
    return (3.0 - 2.0 * z) * z - left - 2.0 * right + 1.0


def derivative(z):
    return np.diag(3.0 - 4.0 * z) - np.eye(SIZE, k=-1) - 2.0 * np.eye(SIZE, k=1)


def test_the_extension_module_is_found_and_gives_the_digits_of_root():
    assert hybrid_method._extension() is not None
    z = -np.ones(SIZE)
    found = hybrid_method.find_root(rows, derivative, z, TOLERANCE)
    known = root(rows, z, jac=derivative, method="hybr", options={"xtol": TOLERANCE}).x
    assert np.array_equal(found, known)
    # Quadratic convergence ends far below the tolerance of the change.
    assert np.abs(rows(found)).max() < 1e-10


@pytest.mark.parametrize("known", ["FORM", "MODULE"])
def test_another_version_of_scipy_is_called_by_its_public_name(monkeypatch, known):
    if known == "FORM":
        monkeypatch.setattr(hybrid_method, "FORM", "_hybrj(fun)")
        hybrid_method._extension.cache_clear()
        assert hybrid_method._extension() is None
    else:
        monkeypatch.setattr(hybrid_method, "_extension", lambda: None)
    z = -np.ones(SIZE)
    found = hybrid_method.find_root(rows, derivative, z, TOLERANCE)
    monkeypatch.undo()
    hybrid_method._extension.cache_clear()
    assert np.array_equal(found, hybrid_method.find_root(rows, derivative, z, TOLERANCE))
