"""Records of events: what happens when conditions of the motion become true.

A released joint, coupling, motion or contact does not act: the system has no constraint equations
of it until an event engages it.
"""

from msahl.algebra.vector import ZERO, Vector
from msahl.expressions.syntax import Tree
from msahl.records import record


@record
class StateChange:
    """The auxiliary ``state`` takes the value of an ``expression`` at the time of the event."""

    state: str
    expression: Tree


@record
class ParameterChange:
    """The ``parameter`` of a ``load`` (see ``model.settable``) has this ``value`` [SI] from the
    event on.
    """

    load: str
    parameter: str
    value: float


@record
class Impulse:
    """An impulse along the ``coordinate`` of a ``joint``, or at a ``marker`` in a ``direction``,
    whose components are in the axes of the body (or ground) ``basis``.

    Its size is the value of an ``expression`` at the time of the event [N s or N m s], or, if it
    ``changes_velocity``, that by which the rate along it changes [m/s or rad/s].
    """

    expression: Tree
    changes_velocity: bool = False
    joint: str = ""
    coordinate: str = ""
    marker: str = ""
    direction: Vector = ZERO
    basis: str = ""

    @property
    def element(self) -> str:
        """Name of the joint or marker."""
        return self.joint or self.marker


@record
class Event:
    """When ``expression`` becomes positive, the margin of a ``condition`` in words
    (``expressions.conditions``), the elements ``releases`` are released, then ``engages`` are
    engaged, then ``states`` and ``parameters`` are set, then ``impulses`` act, and the ``message``
    is given. It happens once, unless it ``repeats``: then each time after the condition was false.
    """

    name: str
    condition: str
    expression: Tree
    releases: tuple[str, ...] = ()
    engages: tuple[str, ...] = ()
    message: str = ""
    repeats: bool = False
    states: tuple[StateChange, ...] = ()
    parameters: tuple[ParameterChange, ...] = ()
    impulses: tuple[Impulse, ...] = ()

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of all that it releases or engages."""
        return (*self.releases, *self.engages)

    @property
    def values(self) -> tuple[Tree, ...]:
        """The expressions that are evaluated when it happens: of ``states``, then of
        ``impulses``.
        """
        states = tuple(change.expression for change in self.states)
        return (*states, *(impulse.expression for impulse in self.impulses))

    @property
    def acts(self) -> bool:
        """Whether it changes anything."""
        return bool(self.elements or self.states or self.parameters or self.impulses)
