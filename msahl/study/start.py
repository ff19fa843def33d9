"""The state a run starts from, without the run."""

from msahl.model import Model
from msahl.solve.assembly import assemble
from msahl.solve.initial import make_consistent
from msahl.system.arrays import State, System
from msahl.system.build import build_state, build_system


def first_state(model: Model) -> tuple[System, State]:
    """The system of ``model``, and its state at t = 0, consistent as the deck wishes."""
    system = build_system(model)
    state = build_state(model, system)
    if model.position == "project":
        assemble(system, state)
    make_consistent(system, state, model.velocity)
    return system, state
