"""Decides on the formulation of a subsystem, and builds the tree of its bodies.

Joint coordinates need neither constraint equations nor multipliers but those that close loops. They
are used where every element has them: rigid bodies in a tree of joints that state their axes
(``joints.joint.TreeAxis``), or free, with loads that depend on places, velocities, time and
auxiliary states. All other joints are cut, as are couplings and prescribed motions: their equations
remain (``system.cut``). The rest keeps absolute coordinates, and ``Formulation.reason`` says why.

The tree takes the joints of the fewest coordinates, and of these the ones nearest to the ground, so
that there are few coordinates, few equations, and short paths. Joint coordinates count from the
start of each step, where no orientation is singular, so the choice needs no regard to positions.

A mass matrix in joint coordinates takes work by the square of the number of coordinates between a
body and the ground: long chains are faster in absolute coordinates, whose work is proportional to
the number of bodies.
"""

import heapq
import itertools
from typing import NamedTuple

import numpy as np

from msahl.algebra.vector import IDENTITY, ZERO, Vector, sub
from msahl.elements.signals.group import Signals, use_reactions
from msahl.formulations.absolute.frames import FramesWorkspace
from msahl.formulations.tree.table import ALIGN_AXES, ALIGN_FRAMES, NO_ALIGNMENT, Tree
from msahl.joints.joint import CHILD, PARENT, TreeAxis, X, Y, Z
from msahl.joints.registry import KINDS
from msahl.model import Joint, Model, RigidBody
from msahl.ports.forces import Forces, pressed_by_reactions
from msahl.system.arrays import System, SystemWorkspace
from msahl.system.collect import frame_index
from msahl.system.cut import Cut, build_cut

MOST_PRODUCTS = 800
"""Products in the factors of a mass matrix, per body, from which absolute coordinates take less
work: by timings of planar chains, at about 70 bodies."""
MOST_EQUATIONS = 36
"""Equations of cut joints from which absolute coordinates take less work, as these are solved as a
dense system: by timings of nets, at 40 to 50."""
REACH, REACH_ACROSS = 1.5, 1.0
"""Largest rotation about a hinge within a step [rad]: below the range of ``lanes.half_angle``; and
about the second one of a ball, whose three axes are in a plane at a right angle."""
FREE = "free"
"""What stands for the kind of joint of a body that no joint connects to the ground."""
INERTIAL = ""
"""What holds a free body."""
FREE_AXES = (*(TreeAxis(True, k) for k in (X, Y, Z)), *(TreeAxis(False, k) for k in (X, Y, Z)))
PARTS = {
    *("frames", "bodies", "coincide", "scalar", "beams", "reactions", "laws", "forces", "shown"),
    *("unit", "multipliers", "decay", "relaxation", "blocks", "pattern", "constant"),
}
"""Parts of a system that steps in joint coordinates know; an element that adds one is another."""
LOADS = {
    *("concentrated", "point", "along", "compliance", "actuator", "controlled", "signals", "laws"),
}
"""Groups of forces of which there are none but by loads of the model, and what they refer to."""
EQUAL = 1e-6
"""Difference of principal moments, relative to the largest, within which a body is one of
revolution."""
NOTHING_MOVES = "nothing can move"
"""Reason of a subsystem without coordinates."""
ALONG = 0.5
"""Cosine above which an axis in a planar subsystem is its normal: it is either 1 or 0."""


class Formulation(NamedTuple):
    """Coordinates of a subsystem: those of a ``tree``, or, for a ``reason``, absolute ones.

    ``cut`` has the equations that close its loops, ``closing`` the joints, couplings and motions to
    which they belong, by name.
    """

    tree: Tree | None
    reason: str = ""
    cut: Cut | None = None
    closing: tuple[str, ...] = ()


class Branch(NamedTuple):
    """A joint of the tree with the body that it carries; ``reversed`` if that is its parent."""

    joint: Joint
    body: str
    parent: str
    reversed: bool


def choose_formulation(
    model: Model,
    system: System,
    start: SystemWorkspace,
    free: np.ndarray,
    axis: int | None,
    saves_work: bool = True,
) -> Formulation:
    """Return the coordinates for a subsystem of ``free`` unknowns, prepared at its start; ``axis``
    is the normal of its plane, if it is planar. Where it ``saves_work``, joint coordinates are only
    chosen if they take less work.
    """
    reason = _excluded(model, system)
    if reason:
        return Formulation(None, reason)
    branches = _branches(model)
    tree = _build(model, system, start, axis, branches)
    if tree.body.size == 0:
        return Formulation(None, NOTHING_MOVES)
    depth = np.diff(tree.row)
    if saves_work and float(np.sum(depth * depth)) > 2.0 * MOST_PRODUCTS * len(model.bodies):
        return Formulation(None, "they take less work in chains as long as these")
    closing = _closing(model, branches)
    cut = build_cut(system, free, tree, set(closing))
    if saves_work and cut is not None and cut.scale.size > MOST_EQUATIONS:
        return Formulation(None, "they take less work where so many equations close loops")
    return Formulation(tree, "", cut, tuple(closing.values()) if cut else ())


def _closing(model: Model, branches: list[Branch]) -> dict[int, str]:
    """Return the names of what is not in the tree, by number among joints, couplings, motions."""
    kept = {branch.joint.name for branch in branches}
    elements, tied = model.constrained, len(model.joints)
    names = {e: one.name for e, one in enumerate(elements)}
    return {e: name for e, name in names.items() if e >= tied or name not in kept}


def tree_kind(model: Model, system: System) -> tuple[bool, ...]:
    """Return nothing for a subsystem without joint coordinates, else whether anything is cut."""
    if _excluded(model, system):
        return ()
    return (True,) if _closing(model, _branches(model)) else (True, True)


def _excluded(model: Model, system: System) -> str:
    """Return why elements of the model need absolute coordinates; empty if none does."""
    signals, scalar = system.forces.signals, system.scalar
    others = [name for name in system._fields if name not in PARTS]
    unknown = [name for name in others if getattr(system, name) is not None]
    rates = scalar is not None and not scalar.equations.holonomic.all()
    reasons = (
        (bool(unknown), f"{', '.join(unknown)} have no joint coordinates"),
        (
            bool(model.rigid_contacts),
            "contacts open and close, which joint coordinates do not follow",
        ),
        (bool(model.events or model.switched), "events change its constraints, laws or velocities"),
        (rates, "constraints between rates have no joint coordinates"),
        (system.beams is not None, "beams have no joint coordinates"),
        (bool(model.elastic_bodies), "elastic bodies have no joint coordinates"),
        (system.forces.compliance is not None, "springs in the compliance form have multipliers"),
        (pressed_by_reactions(system.forces) is not None, "friction depends on reactions"),
        (use_reactions(signals), "expressions depend on reactions"),
        (_states_switch(signals), "states beside switches take fewer steps in absolute ones"),
    )
    return next((reason for found, reason in reasons if found), "")


def _states_switch(signals: Signals | None) -> bool:
    """Return whether there are auxiliary states, and expressions that are not smooth: where states
    have no solution beyond a switch, steps in joint coordinates are left to absolute ones, one by
    one.
    """
    return signals is not None and signals.rate.size > 0 and signals.tape.held.size > 0


def _branches(model: Model) -> list[Branch]:
    """Return the joints of the tree from the ground outwards. Of bodies that no joint connects to
    it, those with the most joints are free.
    """
    grounds = {ground.name for ground in model.grounds}
    at: dict[str, list[Joint]] = {}
    for joint in model.joints:
        if KINDS[joint.kind].tree is not None:
            at.setdefault(joint.parent, []).append(joint)
            at.setdefault(joint.child, []).append(joint)
    branches: list[Branch] = []
    depth, count = dict.fromkeys((*grounds, INERTIAL), 0), itertools.count()
    waiting: list[tuple[int, int, int, Joint, str]] = []

    def reach(name: str) -> None:
        for joint in at.get(name, ()):
            rank = len(KINDS[joint.kind].tree or ()), depth[name], next(count)
            heapq.heappush(waiting, (*rank, joint, name))

    def take_waiting() -> None:
        while waiting:
            *_, joint, name = heapq.heappop(waiting)
            other = joint.child if joint.parent == name else joint.parent
            if other not in depth:
                depth[other] = depth[name] + 1
                branches.append(Branch(joint, other, name, joint.parent == other))
                reach(other)

    for name in grounds:
        reach(name)
    take_waiting()
    for body in sorted(model.bodies, key=lambda one: -len(at.get(one.name, ()))):
        if body.name not in depth:
            free = Joint("", FREE, INERTIAL, body.name, ZERO, body.r_BG)
            heapq.heappush(waiting, (0, 0, next(count), free, INERTIAL))
            take_waiting()
    return branches


def _tree_axes(joint: Joint) -> tuple[TreeAxis, ...]:
    """Return the axes of a joint, or of a free body."""
    return FREE_AXES if joint.kind == FREE else KINDS[joint.kind].tree or ()


def _build(
    model: Model,
    system: System,
    start: SystemWorkspace,
    axis: int | None,
    branches: list[Branch],
) -> Tree:
    """Return the tree's arrays."""
    ground = len(model.bodies)
    frame = {**frame_index(model), INERTIAL: ground}
    number = dict.fromkeys((*(one.name for one in model.grounds), INERTIAL), 0)
    arrays: dict[str, list[object]] = {
        "frame": [ground],
        "parent": [0],
        "first": [0, 0],
        "free": [False],
        "ball": [-1],
        "parent_point": [np.zeros(3)],
        "child_point": [np.zeros(3)],
        "alignment": [NO_ALIGNMENT],
        "parent_axes": [IDENTITY],
        "child_axes": [IDENTITY],
    }
    coordinates: list[tuple[int, bool, int, Vector]] = []
    for b, branch in enumerate(branches, start=1):
        number[branch.body] = b
        axes, is_ball = _axes(model, branch, frame, start.frames, axis)
        coordinates += [(b, slides, *place) for slides, place in axes]
        ball = len(coordinates) - 3 if is_ball else -1
        sides = _sides(model, branch)
        row = {
            "frame": frame[branch.body],
            "parent": number[branch.parent],
            "first": len(coordinates),
            "free": branch.joint.kind == FREE,
            "ball": ball,
            "parent_point": sides[0],
            "child_point": sides[1],
            "alignment": _alignment(branch.joint),
            "parent_axes": sides[2],
            "child_axes": sides[3],
        }
        for name, value in row.items():
            arrays[name].append(value)
    acting = model.loads or model.compliant_contacts
    return _finish(system, arrays, coordinates, not acting and _is_bare(system.forces))


def _is_bare(forces: Forces) -> bool:
    """Whether nothing acts or is solved for beside the loads of the model."""
    others = [name for name in forces._fields if name not in LOADS]
    signals = forces.signals
    states = signals is not None and signals.rate.size > 0
    return not states and all(getattr(forces, name) is None for name in others)


def _sides(model: Model, branch: Branch) -> tuple[Vector, Vector, object, object]:
    """Return the joint's points from the mass centres, and its axes, of the body nearer to the
    ground and of the other one.
    """
    centre = {body.name: body.r_BG for body in model.bodies}
    joint, none = branch.joint, (0.0, 0.0, 0.0)
    first = sub(joint.parent_point, centre.get(joint.parent, none))
    second = sub(joint.child_point, centre.get(joint.child, none))
    if branch.reversed:
        return second, first, joint.child_axes, joint.parent_axes
    return first, second, joint.parent_axes, joint.child_axes


def _alignment(joint: Joint) -> int:
    """Return what of the joint's frames stays together."""
    hinges = [axis for axis in _tree_axes(joint) if not axis.slides]
    if not hinges:
        return ALIGN_FRAMES
    return ALIGN_AXES if len(hinges) == 1 else NO_ALIGNMENT


def _axes(
    model: Model, branch: Branch, frame: dict[str, int], start: FramesWorkspace, normal: int | None
) -> tuple[list[tuple[bool, tuple[int, Vector]]], bool]:
    """Return the axes of the joint, each with the frame in which it is fixed, and whether the last
    three are a ball's; in a planar subsystem those along which it moves.
    """
    joint, parent, R = branch.joint, frame[branch.parent], start.R
    axes = _tree_axes(joint)
    is_ball = sum(not axis.slides for axis in axes) == 3
    if is_ball:
        axes = tuple(axis for axis in axes if axis.slides)
    found = [(axis.slides, _fixed(joint, frame, axis)) for axis in axes]
    if is_ball and normal is None:
        body = frame[branch.body]
        spin = R[body].T @ (start.W[body] - start.W[parent])
        own = next(other for other in model.bodies if other.name == branch.body)
        return [*found, *((False, (body, a)) for a in _axes_of_ball(own, joint, spin))], True
    if is_ball:
        x, y, z = (float(number) for number in R[parent][normal])
        found.append((False, (parent, (x, y, z))))
    # An axis that is fixed in the tree's parent acts before one that is fixed in its child.
    found.sort(key=lambda entry: not entry[0] and entry[1][0] != parent and len(axes) == 2)
    if normal is None:
        return found, False
    kept = []
    for slides, (owner, vector) in found:
        along = abs(float(R[owner][normal] @ np.array(vector))) > ALONG
        if along != slides:
            kept.append((slides, (owner, vector)))
    return kept, False


def _axes_of_ball(body: RigidBody, joint: Joint, spin: np.ndarray) -> list[Vector]:
    """Return three perpendicular axes of the ``body``, the last one its principal axis at the joint
    that is nearest to the ``spin``: about that it rotates far in a step, if about any. A body of
    revolution has one axis alone that stays where it is as it spins.
    """
    point = joint.child_point if joint.child == body.name else joint.parent_point
    arm = np.array(sub(point, body.r_BG))
    J = np.array(body.inertia) + body.mass * (arm @ arm * np.eye(3) - np.outer(arm, arm))
    moments, axes = np.linalg.eigh(J)
    low, high = np.diff(moments) <= EQUAL * moments[2]
    if low and high:
        third = spin if np.any(spin) else axes[:, 2]
    elif low or high:
        third = axes[:, 2 if low else 0]
    else:
        third = axes[:, int(np.argmax(np.abs(spin @ axes)))]
    third = third / np.linalg.norm(third)
    first = np.cross(IDENTITY[int(np.argmin(np.abs(third)))], third)
    first = first / np.linalg.norm(first)
    rows = (first, np.cross(third, first), third)
    return [(float(x), float(y), float(z)) for x, y, z in rows]


def _fixed(joint: Joint, frame: dict[str, int], axis: TreeAxis) -> tuple[int, Vector]:
    """Return the frame that has the ``axis``, and the axis there."""
    if axis.owner == CHILD:
        return frame[joint.child], joint.child_axes[axis.axis]
    assert axis.owner == PARENT
    return frame[joint.parent], joint.parent_axes[axis.axis]


def _finish(
    system: System,
    arrays: dict[str, list[object]],
    coordinates: list[tuple[int, bool, int, Vector]],
    bare: bool,
) -> Tree:
    """Return the tree of these bodies and coordinates; ``bare`` if nothing but gravity acts."""
    frames, bodies = system.frames, system.bodies
    columns: dict[str, np.ndarray] = {name: np.array(rows) for name, rows in arrays.items()}
    columns["first"] = columns["first"].astype(np.int64)
    of_frame = {int(f): k for k, f in enumerate(bodies.frame)}
    own = [of_frame[int(f)] for f in columns["frame"][1:]]
    body = np.array([b for b, *_ in coordinates], dtype=np.int64)
    slides = np.array([s for _, s, *_ in coordinates], dtype=bool)
    precedes = _precedes(columns["parent"], columns["first"])
    before, depth = _paths(columns["parent"], columns["first"])
    reach = np.where(slides, np.inf, REACH)
    reach[columns["ball"][columns["ball"] >= 0] + 1] = REACH_ACROSS
    return Tree(
        **{
            name: column.astype(float) if column.ndim > 1 else column
            for name, column in columns.items()
        },
        mass=np.append(0.0, 1.0 / bodies.inverse_mass[own]),
        inertia=np.concatenate([np.zeros((1, 3, 3)), bodies.inertia[own]]),
        bare=bare,
        gravity=bodies.gravity if bare else np.zeros(3),
        body=body,
        slides=slides,
        axis_frame=np.array([f for *_, f, _ in coordinates], dtype=np.int64),
        axis=np.array([axis for *_, axis in coordinates], dtype=float).reshape(-1, 3),
        precedes=precedes,
        before=before,
        row=np.append(0, np.cumsum(depth)).astype(np.int64),
        length=np.where(slides, 1.0, frames.length[columns["frame"][body]]),
        reach=reach,
    )


def _precedes(parent: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return (n, b+1) whether a coordinate is on the path from the ground to a body."""
    found = np.zeros((int(first[-1]), parent.size), dtype=bool)
    for b in range(1, parent.size):
        found[:, b] = found[:, parent[b]]
        found[first[b] : first[b + 1], b] = True
    return found


def _paths(parent: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return, for each coordinate, the one before it, and how many there are up to it."""
    last = [-1]  # coordinate of each body's path that is farthest from the ground
    before: list[int] = []
    depth: list[int] = []
    for b in range(1, parent.size):
        k = last[parent[b]]
        for own in range(first[b], first[b + 1]):
            before.append(k)
            depth.append(1 + (depth[k] if k >= 0 else 0))
            k = own
        last.append(k)
    return np.array(before, dtype=np.int64), np.array(depth, dtype=np.int64)
