"""Whether the motion of a model is prescribed completely, and in words what moves if it is not."""

import numpy as np

from msahl.algebra.rotation import matrix
from msahl.algebra.vector import at
from msahl.analysis.kinematics.configuration import Equations, jacobian, solve, violations
from msahl.formulations.absolute.frames import first_multiplier, moving_count
from msahl.joints.coordinates import columns, coordinates
from msahl.model import JointMotion, Model
from msahl.run.joint_table import JointTable
from msahl.start.redundancy import INDEPENDENT
from msahl.start.velocities import StartError
from msahl.system.arrays import State, node_count
from msahl.system.names import STATE_COLUMNS

CONTRADICTION = 1e-8
"""Velocity that no solution satisfies, relative to the largest prescribed one, that is not
round-off."""
PART = 0.05
"""Part of a motion or of loads, relative to the largest, below which it is not named."""
MOST_NAMED = 6
STILL = 1e-9
"""Rate of a coordinate, relative to the largest, that is none."""
MOVABLE = ("angle", "slide")
"""Coordinates of joints that can have a prescribed motion."""


def require_prescribed(model: Model, equations: Equations, state: State) -> int:
    """Return the rank of the constraint equations, which determine the positions at every time;
    raises ``StartError`` if they do not.
    """
    if model.beams:
        raise StartError(
            "the model has beams, which loads deform: positions do not follow from prescribed "
            "motions alone; run the deck with msahl run"
        )
    states = [signal.name for signal in model.states]
    if states:
        raise StartError(
            f"the loads depend on auxiliary states ({listed(states)}), which have to be "
            "integrated; run the deck with msahl run"
        )
    G, n = jacobian(equations, state), equations.coordinate.size
    solved = solve(G, np.zeros(len(G)))
    if solved.rank < n:
        raise StartError(_free(model, equations, state, G))
    holonomic = solve(G[equations.holonomic], np.zeros(int(equations.holonomic.sum()))).rank
    if holonomic < n:
        names = list(
            dict.fromkeys(
                _element_names(model, equations, equations.equation[~equations.holonomic])
            )
        )
        raise StartError(
            f"{n - holonomic} of the positions follow from rates alone ({listed(names)}), and have "
            "to be integrated; run the deck: msahl run --scheme gauss3"
        )
    return n


def _free(model: Model, equations: Equations, state: State, G: np.ndarray) -> str:
    """Return how many degrees of freedom remain, which bodies move, and what to prescribe."""
    _, values, right = np.linalg.svd(G)
    rank = int(np.count_nonzero(values > INDEPENDENT * values.max(initial=0.0)))
    free = right[rank:]
    count = len(free)
    bodies = moving_bodies(model, equations, np.sqrt((free**2).sum(axis=0)))
    remain = f"{count} degree of freedom remains" if count == 1 else f"{count} degrees of freedom"
    text = (
        f"the motion is not prescribed completely: {remain if count == 1 else remain + ' remain'}; "
        f"{listed(bodies)} can move"
    )
    proposed = _proposals(model, equations, state, free)
    if len(proposed) == count:
        text += f"; prescribe {listed(proposed)} by <jointMotion>, or run the deck with msahl run"
    else:
        text += "; prescribe more by <jointMotion> or <pointMotion>, or run the deck with msahl run"
    if model.motions:
        text += ". If the positions at t = 0 are singular, begin the motion elsewhere"
    return text


def require_compatible(model: Model, equations: Equations, state: State) -> None:
    """Raise ``StartError`` if motions contradict each other or the joints in their velocities."""
    _, rate = violations(equations, state, at_rest=True)
    G = jacobian(equations, state)
    remaining = -rate - G @ solve(G, -rate).z
    largest = float(np.abs(remaining).max(initial=0.0))
    if largest > CONTRADICTION * float(np.abs(rate).max(initial=0.0)):
        names = loaded_elements(model, equations, remaining)
        raise StartError(
            f"the prescribed motions contradict each other or the joints: at t = {state.time[0]:g} "
            f"s, velocities of {largest:.3g} m/s are left over in {listed(names)}; omit a motion, "
            "or give motions that fit"
        )


def _proposals(model: Model, equations: Equations, state: State, free: np.ndarray) -> list[str]:
    """Coordinates of joints, one for each of the motions ``free`` (d, n), that determine them."""
    joints = [joint for joint in model.joints if coordinates(joint)]
    if not joints:
        return []
    table = JointTable(model, 2).rows({"states": _states(equations, state, free)})[:, 1:]
    taken = {(m.joint, m.coordinate) for m in model.motions if isinstance(m, JointMotion)}
    names, chosen, column = [], [], 0
    for joint in joints:
        width = len(columns(joint, 0))
        for k, name in enumerate(columns(joint, 0)):
            if name in MOVABLE and (joint.name, name) not in taken:
                names.append(f"{name} of '{joint.name}'")
                chosen.append(column + width + k)
        column += 2 * width
    if not chosen:
        return []
    from scipy.linalg import qr

    rates = table[:, chosen]
    size = np.linalg.norm(rates, axis=0)
    # Rates of angles and slides have different units.
    rates = np.where(size > STILL * size.max(initial=1e-300), rates / np.maximum(size, 1e-300), 0.0)
    _, R, order = qr(rates, mode="economic", pivoting=True)
    pivots = np.abs(np.diag(R))
    return [names[order[k]] for k in range(len(pivots)) if pivots[k] > 1e-6]


def _states(equations: Equations, state: State, motions: np.ndarray) -> np.ndarray:
    """Rows of ``states.csv`` with the velocities of ``motions`` (d, n), at the mass centres."""
    frames, bodies = equations.system.frames, equations.system.bodies
    width = len(STATE_COLUMNS)
    rows = np.zeros((len(motions), 1 + width * bodies.frame.size))
    for row, motion in zip(rows, motions, strict=True):
        flat = np.zeros((node_count(equations.system), 3))
        flat.reshape(-1)[equations.coordinate] = motion
        for b, f in enumerate(bodies.frame.tolist()):
            R = np.array(matrix(at(state.p, f)))
            w = R.T @ flat[frames.rotation[f]] / frames.length[f]
            arm = bodies.r_BG[b]
            v = R.T @ flat[frames.displacement[f]] - np.cross(w, arm)
            row[1 + width * b : 1 + width * (b + 1)] = [
                *(state.x[f] - R @ arm),
                *state.p[f],
                *v,
                *w,
            ]
    return rows


def moving_bodies(model: Model, equations: Equations, motion: np.ndarray) -> list[str]:
    """Names of the bodies that ``motion`` (n,) displaces or rotates, the largest first."""
    node, size = equations.coordinate // 3, np.zeros(moving_count(equations.system.frames))
    np.add.at(size, equations.system.frames.of_node[node], motion**2)
    return _largest(
        [body.name for body in model.bodies], np.sqrt(size[equations.system.bodies.frame])
    )


def loaded_elements(model: Model, equations: Equations, loads: np.ndarray) -> list[str]:
    """Names of the motions, couplings and joints whose multipliers are in ``loads`` (c,)."""
    sizes = dict[str, float]()
    for name, load in zip(
        _element_names(model, equations, equations.equation), np.abs(loads), strict=True
    ):
        sizes[name] = max(sizes.get(name, 0.0), float(load))
    return _largest(list(sizes), np.array(list(sizes.values())))


def _element_names(model: Model, equations: Equations, equation: np.ndarray) -> list[str]:
    """Names of the joints, couplings and motions to which equations, by flat numbers, belong."""
    elements = [*model.joints, *model.couplings, *model.motions]
    nodes = equation // 3 - first_multiplier(equations.system.frames)
    return [elements[int(e)].name for e in equations.system.multipliers.element[nodes]]


def _largest(names: list[str], sizes: np.ndarray) -> list[str]:
    order = np.argsort(-sizes, kind="stable")
    return [names[k] for k in order if sizes[k] > PART * sizes.max(initial=0.0)]


def listed(names: list[str]) -> str:
    """Return names with commas, the first of many."""
    shown = names if len(names) <= MOST_NAMED else names[:MOST_NAMED]
    rest = len(names) - len(shown)
    return ", ".join(shown) + (f" and {rest} more" if rest else "")
