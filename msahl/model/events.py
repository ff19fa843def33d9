"""Records of events: what is released and engaged when conditions of the motion become true.

A released joint, coupling, motion or contact does not act: the system has no constraint equations
of it until an event engages it.
"""

from msahl.expressions.syntax import Tree
from msahl.records import record


@record
class Event:
    """When ``expression`` becomes positive, the margin of a ``condition`` in words
    (``expressions.conditions``), the elements ``releases`` are released, then ``engages`` are
    engaged, and the ``message`` is given. It happens once, unless it ``repeats``: then each time
    after the condition was false.
    """

    name: str
    condition: str
    expression: Tree
    releases: tuple[str, ...] = ()
    engages: tuple[str, ...] = ()
    message: str = ""
    repeats: bool = False

    @property
    def elements(self) -> tuple[str, ...]:
        """Names of all that it releases or engages."""
        return (*self.releases, *self.engages)
