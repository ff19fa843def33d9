"""By what the elastic equations of beams are divided over a step."""

from msahl.elements.beams.group import Beams
from msahl.elements.beams.rows import own_compliance
from msahl.jit.kernel import kernel

AT_ONCE = 1e-150
"""A dt2 [s^2] below this is no step: the equations are those of one configuration."""


@kernel
def strain_share(group: Beams, g: int, i: int, h: float, decay: float) -> float:
    """Return the derivative of an elastic equation ``i``, over w J, by the change of its strain."""
    return 0.5 + group.damping[g, i] / h + decay


@kernel
def divisor(group: Beams, g: int, i: int, step: tuple[float, float, float]) -> float:
    """Return what an elastic equation ``i``, times dt2, is divided by [s^2]."""
    h, dt2, decay = step
    return 2.0 * dt2 * strain_share(group, g, i, h, decay) + own_compliance(group, g, i, i)


@kernel
def stage_divisor(group: Beams, g: int, i: int, h: float) -> float:
    """Return what the equation of elastic strain ``i`` of a stage is divided by [s^2]."""
    return h * (0.5 * h + group.damping[g, i]) + own_compliance(group, g, i, i)
