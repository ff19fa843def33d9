"""Screw joint: a cylindrical joint whose slide follows its angle.

    cylindrical, slide - pitch angle/(2 pi) = const     5 equations, degrees of freedom: 1 (angle)

``pitch`` [m] is the advance of one revolution, positive for a right-handed thread.
"""

import math

from msahl.joints import cylindrical
from msahl.joints.joint import Equation, Equations, Kind, angle, slide
from msahl.model.joints import Joint


def equations(joint: Joint) -> Equations:
    """Those of the cylindrical joint and the thread's."""
    lead = joint.parameter("pitch") / (2.0 * math.pi)
    thread = Equation(slide(joint), None, angle(joint), -lead)
    return [*cylindrical.equations(joint), thread]


KIND = Kind(
    "screw",
    equations,
    axes=1,
    parameters=(("pitch", "length", None, -math.inf),),
    coordinates=("angle", "slide"),
    pose=("angle", "slide"),
    glyph="thread",
)
