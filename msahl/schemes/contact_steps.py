"""Steps of a subsystem with contacts: a ``StepMethod`` for each set of closed contacts.

All of them advance the same state; they differ in the unknowns, and so in factors and stages.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from msahl.contact.modes import ContactModes, ContactsUnsolved
from msahl.events.search import Event
from msahl.linalg.elimination import new_factor
from msahl.schemes.common.workspace import Workspace
from msahl.system import evaluate

MOST_EVENTS = 20_000
"""Most events of contacts within one step: a series of rebounds with e = 0.999 has 15,000."""


class ContactSteps:
    """The methods by the ``modes``, each made by ``make`` from a ``workspace`` of its own."""

    def __init__(
        self, modes: ContactModes, workspace: Workspace, make: Callable[[Workspace], Any]
    ) -> None:
        self.modes, self.make, self.workspace = modes, make, workspace
        self.methods: dict[bytes, Any] = {}
        self.most_events = MOST_EVENTS
        self.trouble = ""  # why contacts ended the steps

    @property
    def method(self) -> Any:
        """The method for the contacts that are closed now."""
        key = self.modes.key
        if key not in self.methods:
            self.methods[key] = self.make(self._own_workspace())
        return self.methods[key]

    def _own_workspace(self) -> Workspace:
        unknowns = self.modes.unknowns
        return self.workspace._replace(
            unknowns=unknowns,
            factor=new_factor(unknowns.elimination),
            y=np.zeros(unknowns.free.size),
        )

    def change(self, method: Any, event: Event | None) -> Any:
        """Let contacts open and close at an ``event`` at the end of steps by a ``method``; return
        that of the steps to follow. Raises ``ContactsUnsolved``.
        """
        contact = None if event is None else method.detection.contact_of(event)
        if event is not None and contact is None:
            return method
        self.modes.resolve(contact)
        return self.enter(method)

    def enter(self, method: Any) -> Any:
        """Return the method for the closed contacts, which goes on where a ``method`` stood."""
        new = self.method
        if new is not method:
            new.begin_again(method)
            new.detection.follow(method.detection)
        workspace = self.workspace
        evaluate.prepare(workspace.system, workspace.state, workspace.start)
        new.reset_prediction()
        return new

    def time_left(self) -> float:
        """Time [s] to shortly after the next rebound that is expected, infinite without one."""
        left = self.modes.next_touch - float(self.workspace.state.time[0])
        return left if left > 0.0 else math.inf

    def fail(self, error: ContactsUnsolved | None) -> None:
        """Note why the steps end: an ``error``, or too many events."""
        t = float(self.workspace.state.time[0])
        self.trouble = (
            f"more than {MOST_EVENTS} contact events in one step before t = {t:.9g} s; give the "
            "contacts a smaller restitution, or reduce --dt"
            if error is None
            else str(error)
        )
