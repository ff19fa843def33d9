"""Powell's hybrid method without scipy.optimize has its digits, and falls back on it."""

import subprocess
import sys

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


def solve():
    return hybrid_method.find_root(rows, derivative, -np.ones(SIZE), TOLERANCE)


def by_scipy():
    options = {"xtol": TOLERANCE}
    return root(rows, -np.ones(SIZE), jac=derivative, method="hybr", options=options).x


@pytest.fixture(autouse=True)
def fresh():
    """Nothing is known of the extension module, before and after a test."""
    hybrid_method._extension.cache_clear()
    yield
    hybrid_method._extension.cache_clear()


def test_the_extension_module_is_found_and_gives_the_digits_of_root():
    assert hybrid_method._extension() is not None
    found = solve()
    assert np.array_equal(found, by_scipy())
    # Quadratic convergence ends far below the tolerance of the change.
    assert np.abs(rows(found)).max() < 1e-10


def another_form(monkeypatch):
    monkeypatch.setattr(hybrid_method, "FORM", "_hybrj(fun)")


def another_place(monkeypatch):
    monkeypatch.setattr(hybrid_method, "EXTENSION_SUFFIXES", [".missing"])


def another_file(monkeypatch):
    monkeypatch.setattr(hybrid_method, "find_spec", lambda name: None)


def another_result(monkeypatch):
    """As if the function returned its values in another order, or another root."""
    call = hybrid_method._call
    monkeypatch.setattr(hybrid_method, "_call", lambda *given: call(*given)[::-1])


def another_root(monkeypatch):
    monkeypatch.setattr(hybrid_method, "FIRST_ROOT", np.array([0.5, np.nan]))


def other_arguments(monkeypatch):
    monkeypatch.setattr(hybrid_method, "FACTOR", "100")


def no_module(monkeypatch):
    def refuse(spec):
        raise ImportError(spec.name)

    monkeypatch.setattr(hybrid_method, "module_from_spec", refuse)


@pytest.mark.parametrize(
    "change",
    [
        another_form,
        another_place,
        another_file,
        another_result,
        another_root,
        other_arguments,
        no_module,
    ],
)
def test_another_version_of_scipy_is_called_by_its_public_name(monkeypatch, change):
    change(monkeypatch)
    assert hybrid_method._extension() is None
    assert np.array_equal(solve(), by_scipy())
    monkeypatch.undo()
    hybrid_method._extension.cache_clear()
    assert hybrid_method._extension() is not None
    assert np.array_equal(solve(), by_scipy())


COMMAND = """
import sys
import numpy as np
from msahl.command_process import run_command
from msahl.schemes.common.hybrid_method import find_root

def cube(z):
    return z**3 - 2.0

def slope(z):
    return np.diag(3.0 * z**2)

def program():
    mine = find_root(cube, slope, np.ones(1), 1e-11)
    print([name for name in sys.modules if name.split(".")[0] == "scipy"])
    from scipy.optimize import root
    import scipy
    theirs = root(cube, np.ones(1), jac=slope, method="hybr", options={"xtol": 1e-11}).x
    print(mine.tobytes() == theirs.tobytes(), scipy.__version__)

run_command(lambda: program)
"""


def test_a_command_imports_nothing_else_of_scipy_and_can_import_all_of_it():
    command = [sys.executable, "-c", COMMAND]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    names, same = done.stdout.splitlines()
    assert names == f"['{hybrid_method.MODULE}']"
    import scipy

    assert same == f"True {scipy.__version__}"
