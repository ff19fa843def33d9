"""Switches of expressions in the tangents of a run: sides within a step, and times of jumps.

Where a force jumps at a time t*(p), that time moves with a parameter p. A step that ends there has

    dt*/dp = -(dg/dp) / (dg/dt)

with the margin g of the switch (``expressions.tape``) along the motion before the jump: the size of
this step changes by it, and that of the next one by as much less. Both follow from the solved
equations of the steps, so the state after the jump has the term (f- - f+) dt*/dp of its derivative.
Kinks that divide steps move these in the same way.
Sides are those in the middle of a step; its formulas are smooth with them, also in differences.
"""

from typing import Any

import numpy as np

from msahl.events import margins
from msahl.events.expressions import used_switches
from msahl.events.margins import Span, build_margins
from msahl.expressions.tape import FREE
from msahl.jit.compiled import compiled
from msahl.schemes.common import tangents as kernels
from msahl.schemes.common.tangents import MEMBERS, Tangents
from msahl.schemes.common.workspace import Workspace
from msahl.system import evaluate

_set_values = compiled(margins.set_values)
HIGHEST_ORDER = 10
"""Margins of kinks are those of schemes of any higher order."""


class Switches:
    """The switches that the motion of a subsystem depends on within a step."""

    def __init__(self, workspace: Workspace, own: np.ndarray, found: margins.Margins) -> None:
        signals = workspace.system.forces.signals
        assert signals is not None, "a system with expressions"
        tape = signals.tape
        self.number, self.margin = own, tape.switches.margin[own]
        self.free = tape.switches.free[own]
        self.jumps, self.integers = tape.switches.jumps[own], tape.switches.integers[own]
        self._margins, self._unused = found, np.zeros(found.kind.size)

    def values(self, workspace: Workspace) -> np.ndarray:
        """Return all values of the tape at the prepared state; a view."""
        _set_values(self._margins, workspace.system, workspace.start, self._unused)
        found: np.ndarray = workspace.start.forces.signals.values.value
        return found

    def distances(self, workspace: Workspace) -> np.ndarray:
        """Return how far the margins are from their next levels."""
        g = self.values(workspace)[self.margin]
        return np.where(self.integers, g - np.round(g), g)

    def sides(self, workspace: Workspace) -> np.ndarray:
        """Return what the switches are at the prepared state, if they are not held."""
        return self.values(workspace)[self.free].copy()

    def hold(self, workspace: Workspace, sides: np.ndarray | float = FREE) -> None:
        """Hold the switches at the ``sides``; by default they are free."""
        workspace.state.held[self.number] = sides

    def reached(
        self, workspace: Workspace, within: np.ndarray, sides: np.ndarray, near: float
    ) -> tuple[int, np.ndarray]:
        """Return the switch whose level is at the end of a step, -1 if there is none, and which
        others are not on the ``sides`` any more that were held in it. ``within`` are the distances
        in the middle of the step; ``near`` fractions of their changes count as none.
        """
        end = self.distances(workspace)
        at_level = np.abs(end) <= near * np.abs(end - within)
        changed = np.flatnonzero(at_level & (end != within))
        passed = np.flatnonzero(~at_level & (self.sides(workspace) != sides))
        return int(changed[0]) if changed.size else -1, passed

    def slopes(self, switch: int, base: Workspace, member: Workspace, of: Tangents) -> np.ndarray:
        """Return the derivatives of a margin by the parameters at the state of the ``base``, which
        ``of`` has as its ``before``.
        """
        found = np.zeros(len(of.slope))
        for j in range(found.size):
            e = kernels.difference_size(of, base.system.frames, j, 1.0)
            for k in range(MEMBERS):
                kernels.shift(of, j, kernels.shift_of(k) * e)
                evaluate.prepare(member.system, member.state, member.start)
                value = self.values(member)[self.margin[switch]]
                found[j] += kernels.weight(k) / e * value
            kernels.restore_numbers(of, j)
        return found


def switches_of(workspace: Workspace, end: float) -> Switches | None:
    """Return the switches of a subsystem until ``end`` [s]; None if it has none."""
    signals: Any = workspace.system.forces.signals
    if signals is None:
        return None
    own = np.array([k for k, late in used_switches(signals) if not late], dtype=np.int64)
    found = build_margins(workspace.system, HIGHEST_ORDER, Span(end)) if own.size else None
    return found and Switches(workspace, own, found._replace(has_expressions=True))
