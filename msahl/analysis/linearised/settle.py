"""Accelerations, multipliers and reactions of a consistent state."""

from msahl.elements import reactions
from msahl.elements.reactions import MOST_ROUNDS
from msahl.elements.signals.group import use_reactions
from msahl.start.velocities import solve_accelerations
from msahl.system.arrays import State, System
from msahl.system.unknowns import Unknowns


def settle(system: System, state: State, unknowns: Unknowns) -> None:
    """Set accelerations, multipliers and reactions, until the reactions that expressions depend on
    are those that follow.
    """
    group = system.forces.signals
    for _ in range(MOST_ROUNDS if group is not None and use_reactions(group) else 1):
        last = state.reaction.copy()
        solve_accelerations(system, state, unknowns)
        if reactions.is_unchanged(state.reaction, last):
            break
