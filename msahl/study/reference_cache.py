"""Keep independent solutions in the user's cache, each verified by a digest when it is read.

A solution is kept under a key of the model, the times at which it was checked, and its accuracy.
How the model is run is not part of the key. A damaged file is removed, and its solution computed
again.
"""

import hashlib
import io
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import platformdirs

from msahl.jit.kernel_store import Store
from msahl.model import Model, Simulation
from msahl.records import record

FORM = "5"
"""Version of the format of a file; to be increased when the meaning of its content changes."""


@record(slots=False)
class CachedSolution:
    """``ends`` and ``values`` of a solution's polynomials, its horizon [s], and the difference from
    a coarser solution [m].
    """

    ends: np.ndarray
    values: np.ndarray
    horizon: float
    difference: float


def load(model: Model, times: np.ndarray, accuracy: float) -> CachedSolution | None:
    """Return the solution from the cache; None if it has none or a damaged one."""
    name = cache_name(model, times, accuracy)
    content = _store().load(name)
    if content is None:
        return None
    try:
        with np.load(io.BytesIO(content)) as kept:
            horizon, difference = map(float, kept["scalars"])
            return CachedSolution(kept["ends"], kept["values"], horizon, difference)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):  # of another version
        _store().discard(name)
        return None


def save(model: Model, times: np.ndarray, accuracy: float, solution: CachedSolution) -> None:
    """Put the solution into the cache; nothing happens if the cache cannot be written."""
    content = io.BytesIO()
    scalars = np.array([solution.horizon, solution.difference])
    np.savez(content, ends=solution.ends, values=solution.values, scalars=scalars)
    _store().save(cache_name(model, times, accuracy), content.getvalue())


def cache_name(model: Model, times: np.ndarray, accuracy: float) -> str:
    """Return the name of the file: a digest of the model and the times, not of how it is run."""
    system = replace(model, simulation=Simulation("", 0.0, 0.0))
    key = hashlib.sha256(f"{FORM} {accuracy!r} {system!r}".encode())
    key.update(times.tobytes())
    return f"{key.hexdigest()[:32]}.npz"


def cache_folder() -> Path:
    """Return the folder of the cache."""
    return Path(platformdirs.user_cache_dir("msahl", appauthor=False)) / "references"


def _store() -> Store:
    return Store(cache_folder())
