"""The tree of joints by which bodies are placed, and what a deck gives of each at t = 0."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from msahl.algebra.vector import ZERO, Vector
from msahl.joints import coordinates
from msahl.joints.registry import KINDS
from msahl.model.joints import Joint


@dataclass
class JointStart:
    """What is given of a joint at t = 0, by names of its coordinates.

    ``values`` are kept, ``guesses`` are where iterations begin; ``P`` is the orientation if its
    name is among either. ``rates`` [SI] are by names of the columns of rates.
    """

    joint: Joint
    values: dict[str, float] = field(default_factory=dict)
    guesses: dict[str, float] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    P: Vector = ZERO


class Branch(NamedTuple):
    """A joint of the tree, and whether its parent is the body whose place was known first."""

    start: JointStart
    forward: bool


def spanning_tree(
    roots: Iterable[str], starts: Sequence[tuple[JointStart, bool]]
) -> tuple[list[Branch], list[JointStart], list[str]]:
    """Return the branches in the order in which they place bodies, the joints that close loops, and
    bodies that no branch places but others hang on, which are roots themselves.

    ``starts`` says of each joint whether it should be a branch before others.
    """
    parent_of: dict[str, str] = {}

    def find(name: str) -> str:
        while parent_of.setdefault(name, name) != name:
            parent_of[name] = name = parent_of[parent_of[name]]
        return name

    roots = list(roots)
    for name in roots:
        parent_of[find(name)] = find(roots[0])
    chosen: set[int] = set()
    able = [k for k, (start, _) in enumerate(starts) if KINDS[start.joint.kind].pose is not None]
    for k in sorted(able, key=lambda k: _rank(*starts[k])):
        joint = starts[k][0].joint
        a, b = find(joint.parent), find(joint.child)
        if a != b:
            parent_of[a] = b
            chosen.add(k)
    at: dict[str, list[JointStart]] = {}
    for k in sorted(chosen):
        joint = starts[k][0].joint
        at.setdefault(joint.parent, []).append(starts[k][0])
        at.setdefault(joint.child, []).append(starts[k][0])
    known, branches, more = set(roots), _walk(at, roots, set(roots)), []
    known.update(_placed(branches))
    for name in at:
        if name not in known:
            more.append(name)
            found = _walk(at, [name], {name})
            branches += found
            known.update((name, *_placed(found)))
    return branches, [start for k, (start, _) in enumerate(starts) if k not in chosen], more


def _rank(start: JointStart, preferred: bool) -> tuple[bool, int]:
    """Return by what joints are sorted: preferred ones first, then those of fewer coordinates."""
    return not preferred, len(coordinates.columns(start.joint, 1))


def _walk(at: dict[str, list[JointStart]], roots: list[str], known: set[str]) -> list[Branch]:
    """Return the branches reached from the ``roots``, nearest first."""
    branches, reached = [], list(roots)
    for name in reached:
        for start in at.get(name, ()):
            forward = start.joint.parent == name
            other = start.joint.child if forward else start.joint.parent
            if other not in known:
                known.add(other)
                reached.append(other)
                branches.append(Branch(start, forward))
    return branches


def _placed(branches: list[Branch]) -> list[str]:
    return [b.start.joint.child if b.forward else b.start.joint.parent for b in branches]
