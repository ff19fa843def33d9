"""A linearised model as a file: .npz of numpy, .mat of Matlab, or JSON, by the suffix."""

from pathlib import Path
from typing import Any

import numpy as np

from msahl.analysis.linearize import LinearModel
from msahl.run.options import OptionError

MATRICES = ("A", "B", "C", "D")
KINDS = ("states", "inputs", "outputs")
SUFFIXES = (".npz", ".mat", ".json")


def contents(model: LinearModel) -> dict[str, Any]:
    """Return what a file contains, by name: matrices, names, units, values and how good they are.

    Names: ``stateNames``, ``stateUnits``, ``stateValues`` and likewise of inputs and outputs.
    """
    found: dict[str, Any] = {name: getattr(model, name) for name in MATRICES}
    for kind in KINDS:
        each = getattr(model, kind)
        one = kind.removesuffix("s")
        found[f"{one}Names"] = [of.name for of in each]
        found[f"{one}Units"] = [of.unit for of in each]
        found[f"{one}Values"] = np.array([of.value for of in each])
    found["stateRates"] = model.rates
    found |= {"title": model.title, "time": model.time, "states": model.chosen}
    found |= {
        "residual": model.equilibrium.residual,
        "relativeResidual": model.equilibrium.relative,
        "isSteady": model.equilibrium.holds,
        "condition": model.condition,
        "disagreement": model.disagreement,
        "error": model.error,
        "warnings": list(model.warnings),
    }
    return found


def check_suffix(path: Path) -> None:
    """Raise ``OptionError`` unless the suffix of ``path`` is one of those known."""
    if path.suffix not in SUFFIXES:
        raise OptionError([f"'{path}' ends in none of {', '.join(SUFFIXES)}; choose one of these"])


def save(model: LinearModel, path: Path) -> None:
    """Write ``model`` to ``path``, in the format of its suffix."""
    check_suffix(path)
    found = contents(model)
    if path.suffix == ".json":
        import orjson

        numbers = orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_INDENT_2
        plain = {
            name: np.ascontiguousarray(value) if isinstance(value, np.ndarray) else value
            for name, value in found.items()
        }
        path.write_bytes(orjson.dumps(plain, option=numbers) + b"\n")
    elif path.suffix == ".mat":
        from scipy.io import savemat

        # Lists of texts become cells, as one column.
        cells = {
            name: np.array(value, dtype=object).reshape(-1, 1)
            for name, value in found.items()
            if isinstance(value, list)
        }
        savemat(path, found | cells, oned_as="column")
    else:
        np.savez(path, **found)
