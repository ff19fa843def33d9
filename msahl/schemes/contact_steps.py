"""Steps of a subsystem with contacts or events of the deck: a ``StepMethod`` for each mode.

A mode is a set of closed contacts and engaged elements. All methods advance the same state; they
differ in the unknowns, and so in factors and stages.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from msahl.contact.modes import ContactModes, ContactsUnsolved
from msahl.events.search import Event
from msahl.linalg.elimination import new_factor
from msahl.schemes.common.workspace import Workspace
from msahl.system import evaluate
from msahl.system.work_arrays import PlainFirst

if TYPE_CHECKING:
    from msahl.switching.modes import Switching

MOST_EVENTS = 20_000
"""Most events of contacts within one step: a series of rebounds with e = 0.999 has 15,000."""


class ContactSteps:
    """The methods by the ``modes`` of contacts and by the ``switching`` of events, each made by
    ``make`` from a ``workspace`` of its own.
    """

    def __init__(
        self,
        modes: ContactModes | None,
        switching: "Switching | None",
        workspace: Workspace,
        make: Callable[[Workspace], Any],
    ) -> None:
        self.modes, self.switching = modes, switching
        self.make, self.workspace = make, workspace
        self._call = PlainFirst(workspace.system)
        self.methods: dict[bytes, Any] = {}
        self.most_events = MOST_EVENTS
        self.trouble = ""  # why contacts ended the steps

    @property
    def method(self) -> Any:
        """The method for the contacts that are closed and the elements that are engaged now."""
        key = self.modes.held.key if self.modes else b""
        key += self.switching.key if self.switching else b""
        if key not in self.methods:
            self.methods[key] = self.make(self._own_workspace())
        return self.methods[key]

    def _own_workspace(self) -> Workspace:
        found = self.modes.held if self.modes else self.switching
        assert found is not None
        unknowns = found.unknowns
        return self.workspace._replace(
            unknowns=unknowns,
            factor=new_factor(unknowns.elimination),
            y=np.zeros(unknowns.free.size),
        )

    def change(self, method: Any, event: Event | None) -> Any:
        """Let contacts open and close, and events of the deck happen, at an ``event`` at the end of
        steps by a ``method``; return that of the steps to follow. Raises ``ContactsUnsolved``.
        """
        contact = condition = None
        if event is not None:
            contact = method.detection.contact_of(event)
            condition = method.detection.condition_of(event)
            if contact is None and condition is None:
                return method
        if condition is None:
            method = self._resolve(method, contact)
            condition = self._next_condition(method)
        elif self.switching:
            size = method.detection.condition_size(condition)
            self.switching.note_size(condition, size)
        while condition is not None and self.switching:
            switches = self.switching.reach(condition)
            method = self._resolve(method, None, True) if switches else self.enter(method)
            condition = self._next_condition(method)
        return method

    def change_where_stuck(self, method: Any) -> Any:
        """Return the method of the steps to follow where none can be taken by ``method``, None if
        it is the same: gaps that begin to curve part at once from contacts that stay closed in it.
        """
        if self.modes is None:
            return None
        before = self.counters
        try:
            new = self._resolve(method, None)
        except ContactsUnsolved:
            return None
        if new is not method:
            return new
        self.restore(before)
        return None

    def only_begins(self, method: Any, event: Event) -> bool:
        """Whether the ``event`` was sought as the end of a slip, and its beginning was found: a
        smaller step is to be taken.
        """
        contact = method.detection.contact_of(event)
        return bool(self.modes and contact is not None and self.modes.begins_to_slip(contact))

    def _resolve(self, method: Any, contact: int | None, jumped: bool = False) -> Any:
        if self.modes:
            self.modes.resolve(contact, jumped)
        return self.enter(method)

    def _next_condition(self, method: Any) -> int | None:
        """Return the event of the deck whose condition has changed with the velocities, or None."""
        if self.switching is None:
            return None
        due = self.switching.next_due(method.detection.condition_values())
        method.detection.set_conditions()
        return due

    def enter(self, method: Any) -> Any:
        """Return the method for what is closed and engaged, which goes on where a ``method``
        stood.
        """
        new = self.method
        if new is not method:
            new.begin_again(method)
        new.detection.follow(method.detection)
        self.prepare()
        new.reset_prediction()
        return new

    def prepare(self) -> None:
        """Prepare the state, as is done for each step that is tried up to an event."""
        given = self.workspace
        self._call(evaluate.prepare, given.system, given.state, given.start)

    @property
    def counters(self) -> dict[str, Any]:
        """As ``Stepper.counters``."""
        return {
            "contacts": self.modes.counters if self.modes else {},
            "switching": self.switching.counters if self.switching else {},
        }

    def restore(self, counters: dict[str, Any]) -> None:
        """As ``Stepper.restore``."""
        if self.switching:
            self.switching.restore(counters["switching"])
        if self.modes:
            self.modes.restore(counters["contacts"])

    def time_left(self) -> float:
        """Time [s] to shortly after the next rebound that is expected, infinite without one."""
        if self.modes is None:
            return math.inf
        left = self.modes.next_touch - float(self.workspace.state.time[0])
        return left if left > 0.0 else math.inf

    def give_up(self, parts: int) -> None:
        """Note that one step became so many ``parts``."""
        t = float(self.workspace.state.time[0])
        self.trouble = (
            f"one step became {parts} parts before t = {t:.9g} s: slips of contacts there are too "
            "hard to resolve; reduce --dt, or the friction of contacts with light bodies"
        )

    def fail(self, error: ContactsUnsolved | None) -> None:
        """Note why the steps end: an ``error``, or too many events."""
        t = float(self.workspace.state.time[0])
        self.trouble = (
            f"more than {MOST_EVENTS} events in one step before t = {t:.9g} s; give contacts a "
            "smaller restitution, let events of the deck happen once, or reduce --dt"
            if error is None
            else str(error)
        )
