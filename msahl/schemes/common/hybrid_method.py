"""Powell's hybrid method for roots, of MINPACK, without importing all of ``scipy.optimize``.

Most runs take one step by it. The package that ``scipy.optimize.root`` comes with takes a quarter
of a second to import, and the extension module that it calls takes a millisecond. The name of that
module is private; so it is used only if its function says that it takes the arguments that are
given here, and else ``scipy.optimize.root`` is called. The digits are the same.
"""

from collections.abc import Callable
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES, ExtensionFileLoader
from importlib.util import find_spec, module_from_spec, spec_from_loader
from pathlib import Path
from typing import Any

import numpy as np

Rows = Callable[[np.ndarray], np.ndarray]

MODULE = "scipy.optimize._minpack"
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
    if hybrj is None:
        from scipy.optimize import root

        found: np.ndarray = root(
            rows, z, jac=derivative, method="hybr", options={"xtol": tolerance}
        ).x
        return found
    most = EVALUATIONS * (z.size + 1)
    # It writes the root to where it begins.
    found = hybrj(rows, derivative, z.copy(), (), 1, 0, tolerance, most, FACTOR, None)[0]
    return found


@cache
def _extension() -> Any:
    """Return MINPACK's function ``hybrj`` as scipy has it; None if it is not where, or what, it was
    in the versions that are known."""
    package = find_spec("scipy")
    for folder in (package and package.submodule_search_locations) or ():
        for suffix in EXTENSION_SUFFIXES:
            path = Path(folder, "optimize", f"_minpack{suffix}")
            if not path.exists():
                continue
            loader = ExtensionFileLoader(MODULE, str(path))
            spec = spec_from_loader(MODULE, loader)
            assert spec is not None
            try:
                module = module_from_spec(spec)
                loader.exec_module(module)
            except ImportError:
                return None
            found = getattr(module, "_hybrj", None)
            return found if getattr(found, "__doc__", None) == FORM else None
    return None
