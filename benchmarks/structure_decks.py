"""Decks of large structures of any size: chain, tree, ladder, net.

    python -m benchmarks.structure_decks net 20000 > net.xml

chain   links, each hanging on the one before it by a spherical joint
tree    the same, but two links hang on each: a binary tree
ladder  two chains and a rung between every two neighbours: closed loops one behind the other
net     knots and rods between them, all by spherical joints, held along its upper edge: closed
        loops side by side, without redundant equations

z is down; gravity acts along z, and every structure starts at rest, off its equilibrium.
"""

import argparse
import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

Point = tuple[float, float, float]

LENGTH = 1.0
"""Distance of neighbouring knots, and length of the links [m]."""
GROUND = "Base"
TILT = 0.5
"""Angle from the vertical at which chains, ladders and nets start [rad]."""


class Body(NamedTuple):
    """A body of 2 kg: its name and mass centre [m]; its axes are the inertial ones."""

    name: str
    at: Point


class Connection(NamedTuple):
    """A joint of two bodies at a point, inertial axes [m]."""

    parent: str
    child: str
    at: Point


class Structure(NamedTuple):
    """Bodies and the spherical joints between them."""

    bodies: list[Body]
    joints: list[Connection]


def chain(n: int) -> Structure:
    """``n`` links, one behind the other."""
    joints = [Connection(_link(i - 1), _link(i), _along(i)) for i in range(n)]
    return Structure([Body(_link(i), _along(i + 0.5)) for i in range(n)], joints)


def tree(n: int) -> Structure:
    """``n`` links; 2 i + 1 and 2 i + 2 hang on link i, and spread sideways ever less."""
    ends: list[Point] = [(0.0, 0.0, 0.0)]
    bodies: list[Body] = []
    joints: list[Connection] = []
    for i in range(n):
        x, y, z = ends[(i + 1) // 2]
        level = (i + 1).bit_length()
        side = 0.0 if i == 0 else math.copysign(0.5 / level, i % 2 - 0.5)
        down = math.sqrt(LENGTH**2 - side**2)
        place = (x + side * (level % 2), y + side * (1 - level % 2), z + down)
        ends.append(place)
        middle = (0.5 * (x + place[0]), 0.5 * (y + place[1]), 0.5 * (z + place[2]))
        bodies.append(Body(_link(i), middle))
        joints.append(Connection(_link((i - 1) // 2 if i else -1), _link(i), (x, y, z)))
    return Structure(bodies, joints)


def ladder(n: int) -> Structure:
    """``n`` bodies, three to a bay: two links and the rung that joins their lower ends."""
    bays = max(1, n // 3)
    bodies: list[Body] = []
    joints: list[Connection] = []
    for i in range(bays):
        for side in (0, 1):
            y = side * LENGTH
            name = f"Rail{i}_{side}"
            bodies.append(Body(name, _along(i + 0.5, y)))
            above = f"Rail{i - 1}_{side}" if i else GROUND
            joints.append(Connection(above, name, _along(i, y)))
            joints.append(Connection(name, f"Rung{i}", _along(i + 0.9, y)))
        bodies.append(Body(f"Rung{i}", _along(i + 0.9, 0.5 * LENGTH)))
    return Structure(bodies, joints)


def net(n: int) -> Structure:
    """About ``n`` bodies: m x m knots and the rods between them, row 0 hangs on the ground."""
    m = max(2, round(math.sqrt(n / 3.0)))
    bodies: list[Body] = []
    joints: list[Connection] = []
    for i in range(m):
        for j in range(m):
            knot = f"Knot{i}_{j}"
            bodies.append(Body(knot, _along(i + 1.0, j * LENGTH)))
            above = f"Knot{i - 1}_{j}" if i else GROUND
            _rod(f"Down{i}_{j}", (above, knot), (_along(i, j), _along(i + 1.0, j)), bodies, joints)
            if j:
                ends = (_along(i + 1.0, j - 1.0), _along(i + 1.0, j))
                _rod(f"Across{i}_{j}", (f"Knot{i}_{j - 1}", knot), ends, bodies, joints)
    return Structure(bodies, joints)


STRUCTURES: dict[str, Callable[[int], Structure]] = {
    "chain": chain,
    "tree": tree,
    "ladder": ladder,
    "net": net,
}


def structure_deck(kind: str, n: int, dt: float = 0.001, t_final: float = 0.01) -> str:
    """XML of the structure ``kind`` of about ``n`` bodies; times in s."""
    return "".join(_deck(kind, STRUCTURES[kind](n), dt, t_final))


def _link(i: int) -> str:
    return f"Link{i}" if i >= 0 else GROUND


def _along(distance: float, y: float = 0.0) -> Point:
    """The point at a distance from the upper edge, in the plane that is tilted by ``TILT``."""
    return (LENGTH * distance * math.sin(TILT), y, LENGTH * distance * math.cos(TILT))


def _rod(
    name: str,
    knots: tuple[str, str],
    ends: tuple[Point, Point],
    bodies: list[Body],
    joints: list[Connection],
) -> None:
    """Add a rod between two knots, joined to both."""
    (x0, y0, z0), (x1, y1, z1) = ends
    bodies.append(Body(name, (0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (z0 + z1))))
    joints.append(Connection(knots[0], name, ends[0]))
    joints.append(Connection(name, knots[1], ends[1]))


def _deck(kind: str, structure: Structure, dt: float, t_final: float) -> Iterator[str]:
    yield (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        f"<!-- A {kind} of {len(structure.bodies)} bodies and {len(structure.joints)} joints, "
        "released from rest; z is down. -->\n"
        "<data>\n  <unitSystem>SI</unitSystem>\n  <system>\n"
        '    <gravity><g3 units="m/sec^2">9.80665</g3></gravity>\n    <bodies>\n'
        f"      <ground><name>{GROUND}</name></ground>\n"
    )
    places = {GROUND: (0.0, 0.0, 0.0)}
    for name, at in structure.bodies:
        places[name] = at
        yield (
            f'      <rigidBody><name>{name}</name><mass units="kg">2.0</mass>'
            '<moi><Ixx units="kg-m^2">0.2</Ixx><Iyy units="kg-m^2">0.2</Iyy>'
            '<Izz units="kg-m^2">0.2</Izz></moi><initialConditions>'
            f"{_position(GROUND, at)}</initialConditions></rigidBody>\n"
        )
    yield "    </bodies>\n    <joints>\n"
    for i, (parent, child, at) in enumerate(structure.joints):
        ends = "".join(
            f"<{end}><name>{name}</name>{_position(name, _from(places[name], at))}</{end}>"
            for end, name in (("parent", parent), ("child", child))
        )
        yield f"      <spherical><name>Joint{i}</name>{ends}</spherical>\n"
    yield (
        f"    </joints>\n  </system>\n  <simulation>\n    <title>{kind}</title>\n"
        f'    <deltaT units="sec">{dt!r}</deltaT>\n    <tFinal units="sec">{t_final!r}</tFinal>\n'
        "  </simulation>\n</data>\n"
    )


def _from(origin: Point, at: Point) -> Point:
    return (at[0] - origin[0], at[1] - origin[1], at[2] - origin[2])


def _position(basis: str, at: Point) -> str:
    axes = zip("xyz", at, strict=True)
    entries = "".join(f'<{axis} units="m">{value!r}</{axis}>' for axis, value in axes)
    return f'<position basis="{basis}">{entries}</position>'


def main() -> None:
    parser = argparse.ArgumentParser(description="Write the deck of a large structure to stdout.")
    parser.add_argument("kind", choices=STRUCTURES)
    parser.add_argument("bodies", type=int)
    parser.add_argument("--dt", type=float, default=0.001, metavar="S")
    parser.add_argument("--t-final", type=float, default=0.01, metavar="S")
    options = parser.parse_args()
    print(structure_deck(options.kind, options.bodies, options.dt, options.t_final), end="")


if __name__ == "__main__":
    main()
