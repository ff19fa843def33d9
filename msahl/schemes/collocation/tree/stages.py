"""Work arrays of steps in joint coordinates, and in which form steps are solved.

Where steps in joint coordinates do not converge they are left to absolute coordinates, and so are
the following ones, of which there are more each time. Each form has a truncation error of its own:
what compares steps, the halves of a pair or a run and its companion, compares those of one form.
"""

import math
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import copy
from msahl.formulations.tree.table import Tree, TreeMotion, new_motion
from msahl.jit.kernel import optional
from msahl.jit.lanes import LANES
from msahl.schemes.collocation.tableau import Halves, Tableau, lagrange
from msahl.schemes.collocation.tree import loop_stages
from msahl.schemes.collocation.tree.loop_stages import LoopStages, new_loop_stages
from msahl.schemes.collocation.tree.slopes import LoadSlopes, new_slopes
from msahl.schemes.collocation.workspace import StageArrays
from msahl.schemes.common.workspace import Workspace
from msahl.system.arrays import State, System, SystemWorkspace, new_system_workspace, node_count
from msahl.system.cut import Cut
from msahl.system.reductions import loads_alone

LONGEST_REST = 256
"""Largest number of steps that are left to Newton's method after one that was not solved."""
FROM_TREE, RESTING, REST, ITERATIONS, STEPS = range(5)
CONTRACTION, SIZE, ABSOLUTE, STIFF, SLOPES = range(5, 10)
"""Places in ``TreeStages.figures``: 1 if the polynomials to follow are those of rates of this form;
steps to be left to Newton's method now, and after the next step that is not solved; iterations and
steps in this form so far; ratio of the second to the first correction, and the size of the step in
which it was measured [s]; 1 if the next step is to be in absolute coordinates; size of steps that
take slopes of the loads, inf for none [s]; how often these were set so far."""
MIXED = 8.0
"""Growth of the rest after a pair whose steps were not all of one form, of which only the long one
did not converge."""


class LoadNode(NamedTuple):
    """What the loads at one node need of its motion: no joints, no constraint equations."""

    system: System  # see ``reductions.loads_alone``
    coordinate: np.ndarray  # (q,) number in the complete system of each of its coordinates
    state: State
    start: SystemWorkspace
    still: np.ndarray  # (nodes, 3) zero increments
    accelerations: np.ndarray  # (nodes, 3) by the loads [m/s^2]


class TreeStages(NamedTuple):
    """Work arrays of steps of one degree in joint coordinates."""

    tree: Tree
    motion: TreeMotion
    node: LoadNode
    slopes: LoadSlopes | None  # None: gravity is the only load
    loops: LoopStages | None  # of closed loops; None: no code for them
    nodes: np.ndarray  # (s, LANES) a_ij: lane i of row j
    rates: np.ndarray  # (s + 1, n) of the coordinates at c_i and at the start, of the present step
    last_rates: np.ndarray  # (s + 1, n) of the step to follow
    half_rates: np.ndarray  # (2, s + 1, n) of both halves of a pair
    half_form: np.ndarray  # (2,) ``FROM_TREE`` after each of them
    forms: np.ndarray  # (chunk,) ``FROM_TREE`` after each step of the present chunk
    given: np.ndarray  # (chunk,) 0 where a step of the chunk is to be in absolute coordinates
    figures: np.ndarray  # (10,) see above


def new_tree_stages(
    tree: Tree,
    cut: Cut | None,
    workspace: Workspace,
    tableau: Tableau,
    like: TreeStages | None = None,
) -> TreeStages:
    """Return the arrays for steps by a ``tableau`` of at most ``LANES`` nodes, with the equations
    of a ``cut`` where loops are closed; see ``new_stage_arrays`` for ``like``.
    """
    system, chunk = workspace.system, workspace.monitor.rows.shape[0]
    c, motion = tableau.force_time, new_motion(tree) if like is None else like.motion
    s, n = c.size, tree.body.size
    node = np.minimum(np.arange(LANES), s - 1)
    load_node = _new_load_node(system, workspace.state) if like is None else like.node
    return TreeStages(
        tree=tree,
        motion=motion,
        node=load_node,
        slopes=None if tree.bare else new_slopes(tree, load_node.system, c),
        loops=cut and new_loop_stages(cut, tree, system, tableau),
        nodes=np.ascontiguousarray(lagrange(c, c, -1)[node].T),
        rates=np.zeros((s + 1, n)),
        last_rates=np.zeros((s + 1, n)),
        half_rates=np.zeros((2, s + 1, n)),
        half_form=np.zeros(2),
        forms=np.zeros(chunk),
        given=np.ones(chunk),
        figures=np.array((0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, np.inf, 0.0)),
    )


def _new_load_node(system: System, state: State) -> LoadNode:
    """Return the arrays of one node, in a ``state`` of the complete system."""
    alone, coordinate = loads_alone(system)
    own = State(*(array.copy() for array in state))._replace(angle=np.zeros(coordinate.size))
    still, accelerations = np.zeros((2, node_count(alone), 3))
    start = new_system_workspace(alone, own)
    return LoadNode(alone, coordinate, own, start, still, accelerations)


@optional()
def forget(tree: TreeStages) -> None:
    """Solve the next step in this form, without what earlier steps have shown."""
    for place in (FROM_TREE, RESTING):
        tree.figures[place] = 0.0
    tree.figures[STIFF] = math.inf
    for place in (REST, CONTRACTION, SIZE):
        tree.figures[place] = 1.0


@optional()
def choose_form(tree: TreeStages, step: int) -> None:
    """Prepare for a ``step`` of the chunk."""
    tree.figures[ABSOLUTE] = 1.0 - tree.given[step]


@optional()
def save_form(tree: TreeStages, step: int) -> None:
    """Save in which form a ``step`` of the chunk was solved."""
    tree.forms[step] = tree.figures[FROM_TREE]


@optional()
def save_forms(tree: TreeStages, step: int) -> None:
    """Save in which form both halves of a pair were solved, whose first is the ``step``."""
    for half in range(2):
        tree.forms[step + half] = tree.half_form[half]


@optional(False)
def comes_first(tree: TreeStages) -> bool:
    """Whether the next step is tried in this form."""
    return tree.figures[ABSOLUTE] == 0.0 and tree.figures[RESTING] == 0.0


@optional(False)
def is_mixed(tree: TreeStages) -> bool:
    """Whether a long step was solved in another form than both halves. Each form has an error of
    its own, so the difference says nothing of either. Then the next steps are left to absolute
    coordinates.
    """
    form = tree.figures[FROM_TREE]
    if tree.half_form[0] == form and tree.half_form[1] == form:
        return False
    tree.figures[RESTING] = tree.figures[REST] = min(MIXED * tree.figures[REST], LONGEST_REST)
    return True


@optional(False)
def leave(tree: TreeStages, stages: StageArrays) -> bool:
    """Predict the next step from its start alone where the last one was of this form, which has no
    multipliers; return whether it was.
    """
    if tree.figures[FROM_TREE] > 0.0:
        stages.last_step[1] = 0.0
        tree.figures[FROM_TREE] = 0.0
        return True
    return False


@optional()
def save_half(tree: TreeStages, half: int) -> None:
    """Keep the rates of a half of a pair, and its form."""
    tree.half_form[half] = tree.figures[FROM_TREE]
    copy(tree.last_rates, tree.half_rates[half])
    loop_stages.save_half(tree.loops, half)


@optional()
def forget_halves(tree: TreeStages) -> None:
    """Forget the forms of both halves of a pair that was not solved."""
    tree.half_form[0] = tree.half_form[1] = tree.figures[FROM_TREE]


@optional()
def follow_half(tree: TreeStages) -> None:
    """Let the next prediction follow the second half."""
    tree.figures[FROM_TREE] = tree.half_form[1]
    copy(tree.half_rates[1], tree.last_rates)
    loop_stages.follow_half(tree.loops)


@optional(True)
def follow_halves(tree: TreeStages, halves: Halves) -> bool:
    """Let the next prediction follow both halves; return whether it can: they are of one form."""
    tree.figures[FROM_TREE] = tree.half_form[1]
    loop_stages.join(tree.half_rates, halves.rate_half, halves.rates, tree.last_rates)
    loop_stages.follow_halves(tree.loops, halves.multiplier_half, halves.multipliers)
    return bool(tree.half_form[0] == tree.half_form[1])
