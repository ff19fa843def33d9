"""The codes beside ours, those of them that are installed."""

from importlib import import_module
from types import ModuleType

PACKAGES = {
    "exudyn": "benchmarks.exudyn_peer",
    "mujoco": "benchmarks.mujoco_peer",
    "pydrake": "benchmarks.drake_peer",
}
"""The package that each needs, and our module that runs it."""


def import_peers(packages: dict[str, str]) -> tuple[dict[str, ModuleType], dict[str, str]]:
    """Return the modules that can be imported, and why others cannot, by package."""
    peers, missing = {}, {}
    for package, name in packages.items():
        try:
            peers[package] = import_module(name)
        except ImportError as error:
            missing[package] = " ".join(str(error).split())
    return peers, missing


PEERS, MISSING = import_peers(PACKAGES)
"""By package; ``MISSING`` says why one cannot be measured."""


def versions() -> str:
    """Those measured, and why others are not."""
    there = [f"{package} {module.VERSION}" for package, module in PEERS.items()]
    missing = [f"{package} is missing ({why})" for package, why in MISSING.items()]
    return ", ".join([*there, *missing]) + "."
