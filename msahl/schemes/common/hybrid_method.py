"""Powell's hybrid method for roots, of MINPACK, without importing all of ``scipy.optimize``.

Most runs take one step by it. The package that ``scipy.optimize.root`` comes with takes a quarter
of a second to import, and the extension module that it calls takes a millisecond. The name of that
module is private; so it is used only if its function says that it takes the arguments that are
given here and solves a first equation, and else ``scipy.optimize.root`` is called. The digits are
the same.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_loader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from msahl.command_process import is_command

Rows = Callable[[np.ndarray], np.ndarray]

MODULE = "scipy.optimize._minpack"
CALLBACKS = "scipy._lib._ccallback"
"""Module that the extension module imports at its first call, to see whether it was given a
``LowLevelCallable``; with it all that ``import scipy`` does is imported, which takes 6 ms."""
FORM = (
    "[x,infodict,info] = "
    "_hybrj(fun, Dfun, x0, args, full_output, col_deriv, xtol, maxfev, factor, diag)"
)
"""What the documentation of the extension module's function says of its arguments."""
FACTOR = 100.0
"""First size of the trust region; this, and the number of evaluations for each unknown, are scipy's
own."""
EVALUATIONS = 100


def find_root(rows: Rows, derivative: Rows, z: np.ndarray, tolerance: float) -> np.ndarray:
    """Return where the ``rows`` (n,) are zero, from ``z`` (n,), by their ``derivative`` (n, n).

    ``tolerance``: relative change of the unknowns at which the search ends. Whether it is a root
    is for the caller to decide.
    """
    hybrj = _extension()
    if hybrj is not None:
        return _call(hybrj, rows, derivative, z, tolerance)[0]
    from scipy.optimize import root

    found: np.ndarray = root(rows, z, jac=derivative, method="hybr", options={"xtol": tolerance}).x
    return found


def _call(hybrj: Any, rows: Rows, derivative: Rows, z: np.ndarray, tolerance: float) -> Any:
    """Call MINPACK's ``hybrj``; return the root, a dictionary and whether the search succeeded."""
    most = EVALUATIONS * (z.size + 1)
    # It writes the root to where it begins.
    return hybrj(rows, derivative, z.copy(), (), 1, 0, tolerance, most, FACTOR, None)


@cache
def _extension() -> Any:
    """Return MINPACK's function ``hybrj`` as scipy has it; None if it is not where, or what, it was
    in the versions that are known."""
    package = find_spec("scipy")
    for folder in (package and package.submodule_search_locations) or ():
        for suffix in EXTENSION_SUFFIXES:
            path = Path(folder, "optimize", f"_minpack{suffix}")
            if path.exists():
                return _checked(path)
    return None


def _checked(path: Path) -> Any:
    """Return the function of the extension module at ``path`` if it does what it is known to do."""
    loader = ExtensionFileLoader(MODULE, str(path))
    spec = spec_from_loader(MODULE, loader)
    assert spec is not None
    try:
        module = module_from_spec(spec)
        loader.exec_module(module)
        found: Any = module._hybrj  # type: ignore[attr-defined]
        if found.__doc__ != FORM:
            return None
        with _no_callbacks():
            root, _, success = _call(found, _first_rows, _first_derivative, np.zeros(2), 1e-12)
        return found if success == 1 and np.array_equal(root, FIRST_ROOT) else None
    except (ImportError, AttributeError, TypeError, ValueError):
        return None


FIRST_ROOT = np.array([0.5, -2.0])
"""Root of the linear equations that the extension module has to solve first: without rounding."""
FIRST_MATRIX = np.array([[2.0, 0.0], [0.0, 1.0]])


def _first_rows(z: np.ndarray) -> np.ndarray:
    rows: np.ndarray = FIRST_MATRIX @ (z - FIRST_ROOT)
    return rows


def _first_derivative(z: np.ndarray) -> np.ndarray:
    return FIRST_MATRIX


@contextmanager
def _no_callbacks() -> Iterator[None]:
    """In the process of a command, have ``CALLBACKS`` found as a module whose ``LowLevelCallable``
    nothing is. The extension module remembers it: elsewhere it would not know those of a user.
    """
    if "scipy" in sys.modules or not is_command():
        yield
        return
    module: Any = ModuleType(CALLBACKS)
    module.LowLevelCallable = type("LowLevelCallable", (), {})
    names = {"scipy": ModuleType("scipy"), CALLBACKS: module}
    sys.modules.update(names)
    try:
        yield
    finally:
        for name in names:
            del sys.modules[name]
