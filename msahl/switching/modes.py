"""Which joints, couplings and motions of a subsystem are engaged, and the events of the deck.

A release leaves positions and velocities as they are; accelerations and reactions are those without
the element. An element that is engaged must fit the positions; an impulse L closes the jump of the
velocities, with those of all other constraints and without contacts, whose impacts follow:

    [ M  -G^T ] [ dv ]   [   0  ]            G of all that is engaged, G v+ = rates of motions
    [ G    0  ] [ L  ] = [ -G v ]

It takes the energy -sum L (G v+ + G v-)/2, which is the work of the event with its sign reversed.
What an event sets and pushes is in ``switching.actions``.

The condition of an event waits to become true; then the event happens, and one that repeats waits
for its condition to become false.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from msahl.contact.events import ENGAGES, HAPPENS, RELEASES, ContactEvent
from msahl.contact.modes import ContactModes, ContactsUnsolved
from msahl.elements.constraints import scalar
from msahl.formulations.absolute.frames import first_multiplier
from msahl.model import Model
from msahl.model.events import Event
from msahl.ports import forces
from msahl.start.redundancy import is_regular
from msahl.start.velocities import add_to_velocities, solve_accelerations, solve_at_rest
from msahl.switching.actions import Actions, Done, NoVelocity
from msahl.system import evaluate, switches
from msahl.system.arrays import State, System, node_count
from msahl.system.state import work_of_events
from msahl.system.switches import FALLS, NEVER, RISES, Conditions, Switches
from msahl.system.unknowns import Unknowns, choose
from msahl.system.work_arrays import PlainFirst, energy, new_work_arrays, rigid_at_rest

FITS = 1e-6
"""What is left of a constraint when it is engaged, over the size of the model, that is kept."""
ROUND_OFF = 1e-12
"""Margin of a condition, over its largest value so far, that is zero."""
MOST_MESSAGES = 100
"""Messages kept for the summary of a run; events.csv has all."""
MOST_AT_ONCE = 200
"""Most events at one time."""


class EventImpossible(ContactsUnsolved):
    """An event cannot be carried out; the message says where and why."""


class Switching:
    """The events of the subsystem of a ``model``, of which ``unknowns`` are those at t = 0 without
    contacts.
    """

    def __init__(
        self,
        model: Model,
        switched: Switches | None,
        conditions: Conditions,
        contacts: ContactModes | None,
        system: System,
        state: State,
        unknowns: Unknowns,
    ) -> None:
        self.deck, self.column = model.events, work_of_events(model)
        self.switches, self.conditions, self.contacts = switched, conditions, contacts
        self.sides = np.array([side.of for side in model.contact_sides], dtype=object)
        self.system, self.state, self.before = system, state, unknowns
        rises = {name: np.zeros_like(state.v_rise) for name in ("v_rise", "w_rise")}
        still = state._replace(**rises)
        self.work_arrays = new_work_arrays(system, still)._replace(call=PlainFirst(system))
        self.actions = Actions(model, conditions, system, state, self.work_arrays)
        self.chosen: dict[bytes, Unknowns] = {}
        self.size = np.zeros(len(self.deck))  # largest margin of each condition so far
        self.events: list[ContactEvent] = []  # those not yet published
        self.published = 0
        self.happened = np.zeros(len(self.deck), dtype=np.int64)
        self.messages: list[dict[str, Any]] = []  # the first ones
        self.last_time, self.repeated = np.nan, 0  # of the last event, and how often at that time

    @property
    def key(self) -> bytes:
        """What differs from mode to mode."""
        engaged = b"" if self.switches is None else self.switches.engaged.tobytes()
        return engaged + self.actions.key

    @property
    def unknowns(self) -> Unknowns:
        """The unknowns of steps without contacts: the multipliers of what is engaged as well."""
        if self.switches is None:
            return self.before
        if self.key not in self.chosen:
            own = switches.multipliers(self.system, self.switches, engaged=False)
            now = switches.multipliers(self.system, self.switches, engaged=True)
            free = np.union1d(np.setdiff1d(self.before.free, own), now)
            self.chosen[self.key] = choose(self.system, free)
        return self.chosen[self.key]

    def begin(self) -> None:
        """Let conditions that are true at t = 0 wait to become false."""
        call, start = self.work_arrays.call, self.work_arrays.start
        call(evaluate.prepare, self.system, self.state, start)
        signals = self.system.forces.signals
        forces.set_expressions(signals, start.forces, self.system.scalar)
        places = self.conditions.place.tolist()
        margins = np.array([forces.expression_at(signals, start.forces, k) for k in places])
        self._grow(np.abs(margins))
        self.conditions.awaits[margins > 0.0] = FALLS

    def _grow(self, size: np.ndarray) -> None:
        self.size = np.maximum(self.size, size)
        self.conditions.near[:] = ROUND_OFF * self.size

    def note_size(self, k: int, size: float) -> None:
        """Count a ``size`` of the margin of condition ``k``."""
        sizes = self.size.copy()
        sizes[k] = max(sizes[k], size)
        self._grow(sizes)

    def next_due(self, margins: np.ndarray) -> int | None:
        """Return the first event whose condition has become true, by its ``margins`` (e,), as
        velocities have jumped; None if there is none. Those that have become false wait for true.
        """
        awaits, near = self.conditions.awaits, self.conditions.near
        awaits[(awaits == FALLS) & (margins < -near)] = RISES
        due = (awaits == RISES) & (margins > near)
        return int(np.argmax(due)) if due.any() else None

    def reach(self, k: int) -> bool:
        """Let the condition of event ``k`` be what it waited for; return whether anything has
        changed. Raises ``EventImpossible``.
        """
        self._count(k)
        event, awaits = self.deck[k], self.conditions.awaits
        if awaits[k] == FALLS:
            awaits[k] = RISES
            return False
        before, contacts = self.counters, self.contacts.counters if self.contacts else {}
        moving = self.state.v, self.state.w, self.state.auxiliary, self.state.work
        saved = [array.copy() for array in moving]
        try:
            self._happen(event, k)
        except EventImpossible:
            self.restore(before)
            for array, old in zip(moving, saved, strict=True):
                array[:] = old
            if self.contacts is not None:
                self.contacts.restore(contacts)
            raise
        awaits[k] = FALLS if event.repeats else NEVER
        self.happened[k] += 1
        return event.acts

    def _count(self, k: int) -> None:
        """Raise ``EventImpossible`` if events follow each other without an end at one time."""
        t = float(self.state.time[0])
        self.repeated = self.repeated + 1 if t == self.last_time else 0
        self.last_time = t
        if self.repeated > MOST_AT_ONCE:
            raise EventImpossible(
                f"at t = {t:.9g} s event '{self.deck[k].name}' happens again and again without an "
                "end; let it happen once, or make its condition false by what it does"
            )

    def _happen(self, event: Event, k: int) -> None:
        """Release, engage, set and push what the ``event`` of number ``k`` says."""
        values = self.actions.values(k, self._unknowns_of_steps)
        if not np.isfinite(values).all():
            t = float(self.state.time[0])
            raise EventImpossible(
                f"at t = {t:.9g} s event '{event.name}' has a value that is not a finite number: "
                f"{', '.join(f'{value:g}' for value in values)}; look at its <set> and <impulse>"
            )
        for name in event.releases:
            self._switch(event, name, engage=False)
        before, engaged = energy(self.system, self.state, self.work_arrays), []
        for name in event.engages:
            engaged += [name] if self._switch(event, name, engage=True) else []
        closed = self._close_jump(event, engaged)
        change = energy(self.system, self.state, self.work_arrays) - before if engaged else 0.0
        self.state.work[self.column + k] += change
        done = self._act(event, k, values)
        self._settle()
        self._note(event, engaged, closed, 0.0 - change, done)

    def _act(self, event: Event, k: int, values: list[float]) -> list[Done]:
        """Set and push what the ``event`` of number ``k`` says by its ``values``."""
        done = []
        try:
            for one in self.actions.carry_out(event, values, self.unknowns):
                self.state.work[self.column + k] += one.work
                done.append(one)
        except NoVelocity as error:
            raise EventImpossible(
                f"at t = {float(self.state.time[0]):.9g} s event '{event.name}' cannot change the "
                f"velocity of '{error}', which joints and motions prescribe; release one of them, "
                "or give the <size> of the impulse"
            ) from error
        return done

    @property
    def _unknowns_of_steps(self) -> Unknowns:
        """The unknowns with those of contacts that are closed."""
        return self.unknowns if self.contacts is None else self.contacts.held.unknowns

    def _switch(self, event: Event, name: str, engage: bool) -> bool:
        """Release or engage the element ``name``; return whether an impulse may be needed."""
        if self.contacts is not None and name in self.sides:
            depth = self.contacts.switch(self.sides == name, engage)
            if depth > 0.0:
                raise self._impossible(event, name, f"it overlaps by {depth:.4g} (m or rad)")
            return False
        if self.switches is None or name not in self.switches.names:
            raise self._impossible(event, name, "it has no constraint equations")
        k = self.switches.names.index(name)
        if engage == self.switches.engaged[k]:
            return False
        if engage:
            self._engage(event, k)
        else:
            switches.release(self.system, self.switches, k)
        return engage

    def _engage(self, event: Event, k: int) -> None:
        """Engage element ``k`` at the present positions, which it must fit."""
        own, system = self.switches, self.system
        assert own is not None
        assert system.scalar is not None
        self.work_arrays.call(evaluate.prepare, system, self.state, self.work_arrays.start)
        start, of = self.work_arrays.start.scalar.coordinates, own.element == k
        now = switches.left_sides(system, own, k, start, float(self.state.time[0]))
        scale = system.scalar.equations.scale[own.row[of]]
        off = np.where(own.given[of], np.abs(now - own.offset[of]), 0.0)
        size = max(float(system.frames.length.max()), float(np.abs(self.state.x).max()))
        if (scale * off).max(initial=0.0) > FITS * size:
            worst = int(np.argmax(scale * off))
            node = system.scalar.equations.place[own.row[of][worst], 0]
            unit = "rad" if system.multipliers.rotational[node] else "m"
            reason = f"its sides are {off[worst]:.4g} {unit} apart"
            raise self._impossible(event, own.names[k], reason)
        holonomic = system.scalar.equations.holonomic[own.row[of]]
        switches.engage(system, own, k, np.where(holonomic, now, own.offset[of]))

    def _impossible(self, event: Event, name: str, reason: str) -> EventImpossible:
        return EventImpossible(
            f"at t = {float(self.state.time[0]):.9g} s event '{event.name}' cannot engage "
            f"'{name}': {reason}; let the event happen where it fits"
        )

    def _close_jump(
        self, event: Event, engaged: Sequence[str]
    ) -> dict[str, tuple[float, float, float]]:
        """Change the velocities by the impulse that ``engaged`` elements need; return their speeds
        before and after it, and their impulses, by name.
        """
        if not engaged:
            return {}
        system, state, unknowns = self.system, self.state, self.unknowns
        rate = self._rates()
        rows = np.zeros((node_count(system), 3))
        first = first_multiplier(system.frames)
        R = self.work_arrays.start.frames.R.copy()
        values = rigid_at_rest(system, state, self.work_arrays)
        if not system.relaxation and not is_regular(system, state, unknowns, values):
            raise self._impossible(
                event, engaged[0], "others constrain the same already, so that it is redundant"
            )
        rows[first:] = -rate
        change = solve_at_rest(system, state, rows, unknowns, values)
        add_to_velocities(system, state, change, R)
        impulse, left = change[first:] * system.unit, self._rates()
        return {name: self._size_of(name, rate, left, impulse) for name in engaged}

    def _rates(self) -> np.ndarray:
        """(k, 3) rates of violations [m/s], radians times a length; prepares the work arrays."""
        system, call, start = self.system, self.work_arrays.call, self.work_arrays.start
        call(evaluate.prepare, system, self.state, start)
        violation, rate = np.zeros((2, *self.state.violation.shape))
        call(evaluate.observe, system, self.state, start, violation, rate)
        scalar.in_metres(system.scalar, violation, rate)
        return rate

    def _size_of(
        self, name: str, before: np.ndarray, after: np.ndarray, impulse: np.ndarray
    ) -> tuple[float, float, float]:
        """Return speeds and impulse of an element: along its coordinate, or of a joint's points."""
        own, system = self.switches, self.system
        assert own is not None
        assert system.scalar is not None
        rows = own.row[own.element == own.names.index(name)]
        if rows.size == 1:
            scale, (node, slot) = (
                system.scalar.equations.scale[rows[0]],
                system.scalar.equations.place[rows[0]],
            )
            return (
                float(before[node, slot] / scale),
                float(after[node, slot] / scale),
                float(impulse[node, slot]),
            )
        nodes, slots = system.scalar.equations.place[rows].T
        points = ~system.multipliers.rotational[nodes]
        nodes, slots = nodes[points], slots[points]
        found = (float(np.linalg.norm(of[nodes, slots])) for of in (before, after, impulse))
        return next(found), next(found), next(found)

    def _settle(self) -> None:
        """Set accelerations and reactions to those of what is engaged now; contacts come after."""
        state = self.state
        if self.contacts is not None:
            self.contacts.held.without = self.unknowns
        unknowns = self._unknowns_of_steps
        if self.switches is not None and self.system.scalar is not None:
            place = self.system.scalar.equations.place[self.switches.row]
            state.violation[place[:, 0], place[:, 1]] = 0.0
        solve_accelerations(self.system, state, unknowns, None, self.work_arrays)
        for trend in (state.a_trend, state.alpha_trend, state.force_trend):
            trend[:] = 0.0

    def _note(
        self,
        event: Event,
        engaged: Sequence[str],
        closed: dict[str, tuple[float, float, float]],
        lost: float,
        done: Sequence[Done],
    ) -> None:
        """Add the rows of an ``event``; the energy that engaging took stands beside the first
        element that is engaged.
        """
        t = float(self.state.time[0])
        numbers: dict[str, Any] = dict.fromkeys(ContactEvent._fields, 0.0)
        row = ContactEvent(**numbers)._replace(time=t, event=event.name, message=event.message)
        rows = [row._replace(kind=RELEASES, element=name) for name in event.releases]
        for name in event.engages:
            before, after, impulse = closed.get(name, (0.0, 0.0, 0.0))
            rows.append(
                row._replace(
                    kind=ENGAGES,
                    element=name,
                    speed_before=before,
                    speed_after=after,
                    impulse=impulse,
                    energy_lost=lost if engaged[:1] == [name] else 0.0,
                )
            )
        for kind, name, before, after, impulse, work in done:
            row = row._replace(kind=kind, element=name, speed_before=before, speed_after=after)
            rows.append(row._replace(impulse=impulse, energy_lost=0.0 - work))
        self.events += rows or [row._replace(kind=HAPPENS, element="")]
        if event.message and len(self.messages) < MOST_MESSAGES:
            self.messages.append({"time": t, "event": event.name, "message": event.message})

    def counts(self) -> dict[str, int]:
        """How often each event has happened, by name."""
        names = (event.name for event in self.deck)
        return dict(zip(names, self.happened.tolist(), strict=True))

    def states(self) -> list[tuple[str, bool]]:
        """Names of all that events release or engage, and whether it is engaged."""
        own = self.switches
        found = [] if own is None else list(zip(own.names, own.engaged.tolist(), strict=True))
        if self.contacts is not None:
            named = {name for event in self.deck for name in event.elements}
            acts = dict(
                zip(self.sides.tolist(), self.contacts.held.contacts.acts.tolist(), strict=True)
            )
            found += [(name, on) for name, on in acts.items() if name in named]
        return found

    def energy_lost(self) -> float:
        """Return the energy that events have taken so far [J]."""
        own = slice(self.column, self.column + len(self.deck))
        return 0.0 - float(self.state.work[own].sum())

    def forget_events(self) -> None:
        """Let the events so far count as published."""
        self.published += len(self.events)
        self.events = []

    @property
    def counters(self) -> dict[str, Any]:
        """What later steps depend on, as JSON can hold it."""
        own = self.switches
        rows = None if self.system.scalar is None else self.system.scalar.equations
        return {
            "engaged": [] if own is None else own.engaged.tolist(),
            "offset": [] if own is None or rows is None else rows.offset[own.row].tolist(),
            "awaits": self.conditions.awaits.tolist(),
            "size": self.size.tolist(),
            "happened": self.happened.tolist(),
            "parameters": self.actions.counters,
            "messages": [*self.messages],
            "events": [self.published, len(self.events)],
        }

    def restore(self, counters: dict[str, Any]) -> None:
        """Restore what ``counters`` returned; events after it are forgotten."""
        self._restore_elements(counters)
        self.actions.restore(counters["parameters"])
        self.conditions.awaits[:] = counters["awaits"]
        self.size = np.array(counters["size"])
        self._grow(self.size)
        self.happened[:] = counters["happened"]
        self.messages = [*counters["messages"]]
        published, pending = counters["events"]
        if published == self.published:
            del self.events[pending:]
        else:  # of a run that is resumed, which had published all
            self.published, self.events = published, []

    def _restore_elements(self, counters: dict[str, Any]) -> None:
        own, offset = self.switches, np.array(counters["offset"])
        if own is None:
            return
        for k, engaged in enumerate(counters["engaged"]):
            if engaged:
                switches.engage(self.system, own, k, offset[own.element == k])
            else:
                switches.release(self.system, own, k)
        if self.contacts is not None:
            self.contacts.held.without = self.unknowns
