"""A linearised model as a file: .npz of numpy, .mat of Matlab, or JSON, by the suffix."""

from pathlib import Path
from typing import Any

import numpy as np

from msahl.run.options import OptionError

SUFFIXES = (".npz", ".mat", ".json")


def check_suffix(path: Path) -> None:
    """Raise ``OptionError`` unless the suffix of ``path`` is one of those known."""
    if path.suffix not in SUFFIXES:
        raise OptionError([f"'{path}' ends in none of {', '.join(SUFFIXES)}; choose one of these"])


def save(found: dict[str, Any], path: Path) -> None:
    """Write the contents ``found`` to ``path``, in the format of its suffix."""
    check_suffix(path)
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
