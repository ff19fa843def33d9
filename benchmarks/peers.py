"""The codes beside ours, those of them that are installed."""

from importlib import import_module
from types import ModuleType

PACKAGES = {
    "exudyn": "benchmarks.exudyn_peer",
    "mujoco": "benchmarks.mujoco_peer",
    "pydrake": "benchmarks.drake_peer",
}
"""The package that each needs, and our module that runs it."""

PEERS: dict[str, ModuleType] = {}
MISSING: dict[str, str] = {}
"""Why a package cannot be measured."""

for _package, _name in PACKAGES.items():
    try:
        PEERS[_package] = import_module(_name)
    except ImportError as _error:
        MISSING[_package] = " ".join(str(_error).split())


def versions() -> str:
    """Those measured, and why others are not."""
    there = [f"{package} {module.VERSION}" for package, module in PEERS.items()]
    missing = [f"{package} is missing ({why})" for package, why in MISSING.items()]
    return ", ".join([*there, *missing]) + "."
