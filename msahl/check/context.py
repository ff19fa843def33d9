"""What the check of one element needs of the others: axes and places of bodies, kinds of joints.

Axes are taken as they stand at t = 0; those of a ground are the inertial axes.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass, field

from msahl.algebra.functions import Law
from msahl.algebra.rotation import matrix
from msahl.algebra.vector import IDENTITY, ZERO, Matrix, Vector, add, times, transpose
from msahl.joints.expression_values import MARKER_VALUES, joint_values
from msahl.model import Model, SignalTable
from msahl.model.loads import Load
from msahl.model.signals import TIME, AnySignal

INERTIAL = ""
"""Stands for the inertial axes where a frame is named; no body's name is empty."""


@dataclass(slots=True)
class Context:
    """Frames, places and kinds by name.

    ``axes`` holds R (body to inertial components at t = 0) by name of body or ground; ``origins``
    the point B in inertial axes [m] of those whose place is known; ``extent`` the distance of the
    farthest from the inertial origin [m]; ``grounds`` the names of all grounds, and ``INERTIAL`` if
    there may be others; ``kinds`` the kind of every joint by name; ``markers`` the body of every
    marker. ``values`` are the names that expressions of the motion may use, ``tables`` the numbers
    of arguments of the tables that these may call; ``switchable`` are those of what events may
    release or engage, ``states`` and ``loads`` those of what they may set, ``released`` of what is
    released at t = 0. With ``project`` joints need not fit at t = 0.
    """

    project: bool = False
    axes: dict[str, Matrix] = field(default_factory=lambda: {INERTIAL: IDENTITY})
    origins: dict[str, Vector] = field(default_factory=dict)
    extent: float = 0.0
    grounds: dict[str, None] = field(default_factory=dict)
    kinds: dict[str, str] = field(default_factory=dict)
    markers: dict[str, str] = field(default_factory=dict)
    values: dict[str, None] = field(default_factory=dict)
    tables: dict[str, int] = field(default_factory=dict)
    switchable: dict[str, None] = field(default_factory=dict)
    states: dict[str, None] = field(default_factory=dict)
    loads: dict[str, Load] = field(default_factory=dict)
    released: frozenset[str] = frozenset()

    def bodies(self) -> list[str]:
        """Names of all bodies and grounds."""
        return [name for name in self.axes if name != INERTIAL]

    def place(self, body: str, origin: Vector) -> None:
        """Put a body's point B at ``origin``, inertial axes [m]."""
        self.origins[body] = origin
        self.extent = max(self.extent, math.hypot(*origin))

    def point(self, body: str, point: Vector) -> Vector:
        """Return a point of a body from the inertial origin, inertial axes [m]."""
        return add(self.origins[body], self.rotated(point, body, INERTIAL))

    def rotated(self, a: Vector, basis: str, wanted: str) -> Vector:
        """Return the components of ``a`` in the axes of ``wanted`` from those in ``basis``."""
        if self.axes[basis] != self.axes[wanted]:
            a = times(transpose(self.axes[wanted]), times(self.axes[basis], a))
        return a


def add_values(context: Context, signals: Iterable[AnySignal]) -> None:
    """Make known what expressions may name, once joints and markers are."""
    context.values[TIME] = None
    for joint, kind in context.kinds.items():
        context.values.update((f"{joint}.{value}", None) for value in joint_values(kind))
    for marker in context.markers:
        context.values.update((f"{marker}.{value}", None) for value in MARKER_VALUES)
    for signal in signals:
        if isinstance(signal, SignalTable):
            context.tables[signal.name] = 1 if isinstance(signal.table, Law) else 2
        else:
            context.values[signal.name] = None


def context_of(model: Model) -> Context:
    """Return the context of a model's elements."""
    context = Context(project=model.position == "project", released=frozenset(model.released))
    for ground in model.grounds:
        context.axes[ground.name] = IDENTITY
        context.grounds[ground.name] = None
        context.place(ground.name, ZERO)
    for body in model.bodies:
        context.axes[body.name] = matrix(body.orientation)
        context.place(body.name, body.position)
    context.kinds.update({joint.name: joint.kind for joint in model.joints})
    context.markers.update({marker.name: marker.body for marker in model.markers})
    constrained = (*model.joints, *model.couplings, *model.motions, *model.rigid_contacts)
    context.switchable.update((element.name, None) for element in constrained)
    context.states.update((state.name, None) for state in model.states)
    context.loads.update({load.name: load for load in model.loads})
    add_values(context, model.signals)
    return context
