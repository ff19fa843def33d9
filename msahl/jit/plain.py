"""Compiles kernels by numba alone, where its insides differ from what ``machine_code`` extends.

The results are the same; compiling takes two to three times as long, and steps of small systems
half as long again.
"""

from collections.abc import Callable
from typing import Any

from msahl.jit.files import user_folder
from msahl.jit.kernel import MARKED
from msahl.jit.reach import package_digest

OPTIONS: dict[str, Any] = {"error_model": "numpy"}
_registered: set[Callable[..., Any]] = set()


def plain(function: Callable[..., Any]) -> Any:
    """Return ``function`` compiled by numba, with all that it calls, on its first call."""
    import numba

    from msahl.jit import lanes_machine  # noqa: F401 - registers itself

    # numba's own cache looks at the file of this function alone, not at those that it calls.
    folder = user_folder().with_name("plain") / package_digest()[:16]
    setattr(numba.config, "CACHE_DIR", str(folder))  # noqa: B010 - missing in its type stub
    for marked in MARKED:
        if marked not in _registered:
            _registered.add(marked)
            numba.extending.register_jitable(**OPTIONS)(marked)
    return numba.njit(cache=True, **OPTIONS)(function)
