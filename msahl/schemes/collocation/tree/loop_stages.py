"""Work arrays of the equations that close the loops of a tree, and their unknowns."""

from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import copy
from msahl.formulations.absolute.frames import frame_count
from msahl.formulations.tree.table import Tree
from msahl.jit.kernel import kernel, optional
from msahl.jit.lanes import LANES
from msahl.schemes.collocation.tableau import Tableau
from msahl.system.arrays import System, node_count
from msahl.system.cut import PIECES, Cut, CutWorkspace, new_cut_workspace


class LoopStages(NamedTuple):
    """Work arrays of the m cut equations, with e entries, in steps of s nodes."""

    cut: Cut
    start: CutWorkspace
    node: CutWorkspace
    still: np.ndarray  # (nodes, 3) unknowns of no motion
    x: np.ndarray  # (f, 3) at a node: mass centres [m]
    R: np.ndarray  # (f, 3, 3) orientations
    gap: np.ndarray  # (k, 3) violations at the start, by the multipliers' nodes
    displacement: np.ndarray  # (3 (b+1), LANES) of all bodies at t_1 ... t_s [m]
    wrench: np.ndarray  # (6 PIECES m, LANES) of unit multipliers, moments about the origin first
    gradient: np.ndarray  # (e, LANES) entries of G at t_1 ... t_s
    lever: np.ndarray  # (e, LANES) likewise at t_0 ... t_(s-1)
    moment: np.ndarray  # (e, LANES) as ``lever``, of balls about axes fixed in their parents
    balance: np.ndarray  # (e, LANES) work array
    is_ball: np.ndarray  # (e,) whether the coordinate is one of a ball
    violation: np.ndarray  # (m, LANES) at t_1 ... t_s [m]
    to_nodes: np.ndarray  # (s, LANES) ab_kj: lane k of row j
    across: np.ndarray  # (s, LANES) at_il: lane i of row l
    weight: np.ndarray  # (s,) B_l
    y: np.ndarray  # (s, m) unknowns
    last_y: np.ndarray  # (s, m) those of the step to follow
    half_y: np.ndarray  # (2, s, m) of both halves of a pair
    needed: np.ndarray  # (m, LANES) what the multipliers are to remove from the violations [m]
    pull: np.ndarray  # (n, LANES) G_l^T y_l at t_0 ... t_(s-1)
    pull_moment: np.ndarray  # (n, LANES) likewise by ``moment``
    rest: np.ndarray  # (n, LANES) residual of the momenta
    independent: np.ndarray  # (m,) whether the equation is used in the present step
    matrix: np.ndarray  # (s m, s m) T, then its factors
    pivot: np.ndarray  # (s m,)
    right: np.ndarray  # (s m,) right-hand side
    left: np.ndarray  # (1,) largest violation of dependent equations, after the last correction [m]
    end_matrix: np.ndarray  # (m, m) G M^-1 G^T at one configuration
    end_pivot: np.ndarray  # (m,)
    end_right: np.ndarray  # (m,)


def new_loop_stages(cut: Cut, tree: Tree, system: System, tableau: Tableau) -> LoopStages:
    """Return the arrays for steps of a ``system`` by a ``tableau``."""
    s, m, e = tableau.force_weight.size, cut.scale.size, cut.coordinate.size
    nodes, multipliers = node_count(system), int(system.multipliers.node.size)
    arrays = _lane_arrays(cut, tree, tableau)
    return LoopStages(
        cut=cut,
        start=new_cut_workspace(cut, nodes),
        node=new_cut_workspace(cut, nodes),
        still=np.zeros((nodes, 3)),
        x=np.zeros((frame_count(system.frames), 3)),
        R=np.zeros((frame_count(system.frames), 3, 3)),
        gap=np.zeros((multipliers, 3)),
        is_ball=of_ball(tree)[cut.coordinate],
        weight=tableau.multiplier_weight,
        y=np.zeros((s, m)),
        last_y=np.zeros((s, m)),
        half_y=np.zeros((2, s, m)),
        independent=np.ones(m, dtype=bool),
        matrix=np.zeros((s * m, s * m)),
        pivot=np.zeros(s * m, dtype=np.int64),
        right=np.zeros(s * m),
        left=np.zeros(1),
        end_matrix=np.zeros((m, m)),
        end_pivot=np.zeros(m, dtype=np.int64),
        end_right=np.zeros(m),
        **arrays,
        **{name: np.zeros((e, LANES)) for name in ("gradient", "lever", "moment", "balance")},
    )


def of_ball(tree: Tree) -> np.ndarray:
    """(n,) whether a coordinate of the tree is one of a ball."""
    first = tree.ball[tree.body]
    return (first >= 0) & (np.arange(tree.body.size) >= first)


def _lane_arrays(cut: Cut, tree: Tree, tableau: Tableau) -> dict[str, np.ndarray]:
    """Return the weights of the nodes, and arrays by bodies, equations and coordinates."""
    b, w = tableau.force_weight, tableau.multiplier_weight
    lane = np.minimum(np.arange(LANES), b.size - 1)
    before = np.vstack([np.zeros(b.size), tableau.integral[:-1]])  # ab_li, l = 0 ... s - 1
    across = w[:, None] * (1.0 - before / b)
    m, n = cut.scale.size, tree.body.size
    rows = {
        "displacement": 3 * tree.frame.size,
        "wrench": 6 * PIECES * m,
        **dict.fromkeys(("violation", "needed"), m),
        **dict.fromkeys(("pull", "pull_moment", "rest"), n),
    }
    return {
        "to_nodes": np.ascontiguousarray(tableau.integral[lane].T),
        "across": np.ascontiguousarray(across[:, lane]),
        **{name: np.zeros((count, LANES)) for name, count in rows.items()},
    }


@optional()
def save_half(loops: LoopStages, half: int) -> None:
    """Keep the unknowns of a half of a pair."""
    copy(loops.last_y, loops.half_y[half])


@optional()
def follow_half(loops: LoopStages) -> None:
    """Let the next prediction follow the second half."""
    copy(loops.half_y[1], loops.last_y)


@optional()
def follow_halves(loops: LoopStages, half: np.ndarray, weights: np.ndarray) -> None:
    """Let the next prediction follow both halves, see ``tableau.Halves``."""
    join(loops.half_y, half, weights, loops.last_y)


@kernel
def join(halves: np.ndarray, half: np.ndarray, weights: np.ndarray, out: np.ndarray) -> None:
    """Set row i of ``out`` to the rows of the ``half`` i, of two, with the row i of ``weights``."""
    for i in range(half.size):
        for k in range(out.shape[1]):
            total = 0.0
            for j in range(weights.shape[1]):
                total += weights[i, j] * halves[half[i], j, k]
            out[i, k] = total
