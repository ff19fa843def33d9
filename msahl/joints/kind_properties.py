"""What follows from the equations of a kind of joint: how it is drawn.

The equations of a kind depend on the joint's axes and parameters. For an answer about the kind they
are stated once, for a joint of any numbers.
"""

import math

from msahl.algebra.vector import ZERO
from msahl.elements.constraints.coordinate_kinds import PLAIN
from msahl.elements.constraints.products import DOT, SLIDE
from msahl.joints.joint import CHILD, PARENT, Coincide, Equation, Equations, Kind
from msahl.model.joints import Joint

GLYPHS = {
    (3, 3): "fixed",
    (3, 2): "axis",
    (3, 1): "cross",
    (3, 0): "ball",
    (2, 3): "slide",
    (2, 2): "cylinder",
    (2, 0): "line",
    (1, 2): "plane",
}
"""What a joint is drawn as, by the numbers of displacements and of rotations that its equations
prevent; any other is ``contact``: bodies that touch."""


def glyph(kind: Kind) -> str:
    """Return what a kind is drawn as: its own word, or by what its equations prevent."""
    if kind.glyph:
        return kind.glyph
    displacements = rotations = 0
    for equation in _equations(kind):
        if isinstance(equation, Coincide):
            displacements += 3
        elif _prevents(equation, SLIDE):
            displacements += 1
        elif _prevents(equation, DOT):
            rotations += 1
        else:
            return "contact"
    return GLYPHS.get((displacements, rotations), "contact")


def _prevents(equation: Equation, product: int) -> bool:
    """Return whether an equation is of one product of a kind alone, at position level."""
    first = equation.first
    alone = equation.second is None and not equation.rate and first.kind == PLAIN
    return alone and first.products[0].kind == product


def _equations(kind: Kind) -> Equations:
    """Return the equations of a joint of a kind, with parameters that its bounds allow."""
    parameters = tuple(
        (name, 1.0 if math.isinf(bound) else bound + 1.0) for name, _, _, bound in kind.parameters
    )
    ends = ("", kind.name, PARENT, CHILD, ZERO, ZERO)
    return kind.equations(Joint(*ends, parameters=parameters))
