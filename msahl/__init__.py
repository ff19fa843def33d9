"""msahl: spatial multibody systems by Hamilton's weak principle, with their error bars.

model = msahl.load("pendulum.xml", L=0.8)
result = model.run(dt=0.01)
result.states, result.verdict, result["Bob.z"]
"""

from msahl.version import VERSION

# Checkers of types take it for true. To import it from typing takes longer than all of a client.
TYPE_CHECKING = False
if TYPE_CHECKING:
    from typing import Any

    from msahl.analysis.inverse.drives import InverseError
    from msahl.api.batch import BatchError, batch
    from msahl.api.co_simulation import CoSimulation
    from msahl.api.derivatives import GradientError, Gradients
    from msahl.api.importing import import_file
    from msahl.api.model import Model, load
    from msahl.api.result import Result, read
    from msahl.check import ModelError
    from msahl.deck import DeckError
    from msahl.results.info import ResultError
    from msahl.run.options import OptionError
    from msahl.run.snapshot import ResumeError
    from msahl.run.stepped_run import RunEnded
    from msahl.start.velocities import StartError

__version__ = VERSION
__all__ = [
    "BatchError",
    "CoSimulation",
    "DeckError",
    "GradientError",
    "Gradients",
    "InverseError",
    "Model",
    "ModelError",
    "OptionError",
    "Result",
    "ResultError",
    "ResumeError",
    "RunEnded",
    "StartError",
    "batch",
    "import_file",
    "load",
    "read",
]

_PLACES = {
    "BatchError": "msahl.api.batch",
    "CoSimulation": "msahl.api.co_simulation",
    "DeckError": "msahl.deck",
    "InverseError": "msahl.analysis.inverse.drives",
    "GradientError": "msahl.api.derivatives",
    "Gradients": "msahl.api.derivatives",
    "Model": "msahl.api.model",
    "ModelError": "msahl.check",
    "OptionError": "msahl.run.options",
    "Result": "msahl.api.result",
    "ResultError": "msahl.results.info",
    "ResumeError": "msahl.run.snapshot",
    "RunEnded": "msahl.run.stepped_run",
    "StartError": "msahl.start.velocities",
    "batch": "msahl.api.batch",
    "import_file": "msahl.api.importing",
    "load": "msahl.api.model",
    "read": "msahl.api.result",
}
"""Modules of the public names: each is imported when a name of it is used, because the commands
start in a fraction of the time that all take."""


def __getattr__(name: str) -> "Any":
    """Import a public name when it is first used."""
    from importlib import import_module

    if name not in _PLACES:
        raise AttributeError(f"module 'msahl' has no attribute '{name}'")
    globals()[name] = value = getattr(import_module(_PLACES[name]), name)
    return value


def __dir__() -> list[str]:
    """Return all names, also those that were not used yet."""
    return sorted({*globals(), *__all__})
