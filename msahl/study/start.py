"""The state a run starts from, without the run."""

from msahl.model import Model
from msahl.run.subsystem import SubsystemIntegrator
from msahl.system.arrays import State, System
from msahl.system.build import build_system


def first_state(model: Model) -> tuple[System, State]:
    """The system of ``model``, and its state at t = 0, made consistent as the deck wishes."""
    integrator = SubsystemIntegrator(model, "newton", full=True, chunk=1)
    # The runner's own system may be relaxed, which is not what the equations say.
    return build_system(model), integrator.workspace.state
