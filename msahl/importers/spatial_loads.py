"""Loads at ball joints and free joints, in the axes of the link.

(s, e) is the quaternion of a ball: that of the link's axes in the axes P that its parent would
give it with the coordinate zero. With the angular velocity w of the link relative to the parent, in
the link's axes, the moments on the link, whose opposites act on the parent, are

    phi = 2 atan2(|e|, |s|)/(|e| |s|) s e        rotation vector, |phi| <= pi

    spring   M = -k phi        damper   M = -c w        dry friction   M_i = -F tanh(w_i/width)

and of a free joint at the origin of its link F = -c v (inertial axes) and M = -c w. Source: MuJoCo,
Computation, passive forces. phi is the same for both quaternions of a rotation, of which Euler
parameters of markers take the one with q0 >= 0. Both lengths are taken with ``ROUNDING``: the
quotient is finite where one is zero.
"""

from collections.abc import Iterable

import numpy as np

from msahl.algebra.rotation_arrays import plain_vector
from msahl.algebra.vector import IDENTITY, ZERO, Matrix
from msahl.expressions.syntax import parse, quoted
from msahl.importers.made import Ball, Made
from msahl.importers.robot import Axis
from msahl.model import ConcentratedLoad, Marker, Signal

ROUNDING = 1e-16
"""Added to squares of lengths: that of half an angle of 2e-8 rad, which is round-off beside one."""


def add_ball_loads(ball: Ball, width: float, made: Made) -> None:
    """Add spring, damper and dry friction of the ``width`` [rad/s] about each axis of a ball."""
    axis = ball.axis
    for number, direction in enumerate(np.eye(3)):
        terms = []
        if axis.stiffness:
            terms.append(f"-{axis.stiffness!r}*{rotation_of(ball, made)[number]}")
        if axis.damping:
            terms.append(f"-{axis.damping!r}*{rates_of(ball, made)[number]}")
        if axis.friction:
            terms.append(f"-{axis.friction!r}*tanh({rates_of(ball, made)[number]}/{width!r})")
        if terms:
            add_moment(ball, f"{axis.name} {'xyz'[number]}", direction, " + ".join(terms), made)


def add_moment(ball: Ball, name: str, direction: np.ndarray, expression: str, made: Made) -> None:
    """Add a moment along a direction of the link times an expression, and its opposite."""
    ends = [(ball.child, name, 1.0)]
    if ball.parent != made.ground:
        ends.append((ball.parent, f"{name} on {ball.parent}", -1.0))
    for body, label, sign in ends:
        moment = plain_vector(sign * direction)
        load = (made.names.unique(label), body, ZERO, ZERO, body, moment, ball.child)
        made.loads.append(ConcentratedLoad(*load, expression=parse(expression)))


def add_free_damping(axis: Axis, body: str, made: Made) -> None:
    """Add the damper of a free joint at the origin of its body."""
    marker = _marker(f"{axis.name} origin", body, IDENTITY, made)
    for letter, direction in zip("xyz", np.eye(3), strict=True):
        unit = plain_vector(direction)
        for rate, force, moment in (("v", unit, ZERO), ("w", ZERO, unit)):
            name = made.names.unique(f"{axis.name} damping {rate}{letter}")
            load = (name, body, ZERO, force, made.ground, moment, body)
            text = f"-{axis.damping!r}*{quoted(f'{marker}.{rate}{letter}')}"
            made.loads.append(ConcentratedLoad(*load, expression=parse(text)))


def rates_of(ball: Ball, made: Made) -> list[str]:
    """Return the texts of the components of w."""
    link = [quoted(f"{_link(ball, made)}.w{letter}") for letter in "xyz"]
    if ball.parent == made.ground:
        return link
    if "rate" not in ball.found:
        of_parent = [quoted(f"{_parent(ball, made)}.w{letter}") for letter in "xyz"]
        texts = []
        for w, row in zip(link, _rows(*_quaternion(ball, made)), strict=True):
            carried = (f"{r}*{p}" for r, p in zip(row, of_parent, strict=True))
            texts.append(f"{w} - ({' + '.join(carried)})")
        _signals(ball, "rate", dict(zip("xyz", texts, strict=True)), made)
    return ball.found["rate"]


def rotation_of(ball: Ball, made: Made) -> list[str]:
    """Return the texts of the components of phi."""
    if "rotation" not in ball.found:
        s, *e = _quaternion(ball, made)
        square = " + ".join(f"{x}^2" for x in e)
        n, a = (f"sqrt({text} + {ROUNDING!r})" for text in (square, f"{s}^2"))
        (factor,) = _signals(ball, "factor", {"": f"2*atan2({n}, {a})/({n}*{a})*{s}"}, made)
        texts = [f"{factor}*{x}" for x in e]
        _signals(ball, "rotation", dict(zip("xyz", texts, strict=True)), made)
    return ball.found["rotation"]


def _quaternion(ball: Ball, made: Made) -> list[str]:
    """Return the texts of s and the components of e: of the product of the conjugate of the
    parent's quaternion with the link's."""
    if "quaternion" not in ball.found:
        p, c = (
            [quoted(f"{marker}.q{number}") for number in range(4)]
            for marker in (_parent(ball, made), _link(ball, made))
        )
        texts = {"s": " + ".join(f"{a}*{b}" for a, b in zip(p, c, strict=True))}
        for i, j, k in ((1, 2, 3), (2, 3, 1), (3, 1, 2)):
            cross = f"({p[j]}*{c[k]} - {p[k]}*{c[j]})"
            texts["xyz"[i - 1]] = f"{p[0]}*{c[i]} - {c[0]}*{p[i]} - {cross}"
        _signals(ball, "quaternion", texts, made)
    return ball.found["quaternion"]


def _rows(s: str, x: str, y: str, z: str) -> Iterable[tuple[str, str, str]]:
    """Return the rows of R^T: those that carry directions of the parent into the link's axes."""
    yield f"(1 - 2*({y}^2 + {z}^2))", f"2*({x}*{y} + {s}*{z})", f"2*({x}*{z} - {s}*{y})"
    yield f"2*({x}*{y} - {s}*{z})", f"(1 - 2*({x}^2 + {z}^2))", f"2*({y}*{z} + {s}*{x})"
    yield f"2*({x}*{z} + {s}*{y})", f"2*({y}*{z} - {s}*{x})", f"(1 - 2*({x}^2 + {y}^2))"


def _signals(ball: Ball, of: str, texts: dict[str, str], made: Made) -> list[str]:
    """Add signals with these texts by the endings of their names, and return their names as
    expressions have them."""
    names = [made.names.unique(f"{ball.axis.name} {of} {ending}") for ending in texts]
    for name, text in zip(names, texts.values(), strict=True):
        made.signals.append(Signal(name, parse(text)))
    ball.found[of] = [quoted(name) for name in names]
    return ball.found[of]


def _link(ball: Ball, made: Made) -> str:
    """Return the name of the marker with the axes of the link."""
    if "link" not in ball.found:
        ball.found["link"] = [_marker(f"{ball.axis.name} link", ball.child, IDENTITY, made)]
    return ball.found["link"][0]


def _parent(ball: Ball, made: Made) -> str:
    """Return the name of the marker with the axes P."""
    if "parent" not in ball.found:
        name = f"{ball.axis.name} parent"
        ball.found["parent"] = [_marker(name, ball.parent, ball.frame, made)]
    return ball.found["parent"][0]


def _marker(name: str, body: str, axes: Matrix, made: Made) -> str:
    """Add a marker at the origin of a body, and return its name."""
    name = made.body_names.unique(name)
    made.markers.append(Marker(name, body, ZERO, axes))
    return name
