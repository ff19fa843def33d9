"""Contacts and events of a run for the viewer: where contacts are and what they do, impulses.

    {
      "contacts": [{               # of those that are drawn, one for each side
        "name": str, "shape": str, # "plane", "rim", "centre", "box", "curve" or "joint"
        "parent": int, "parentPoint": [3], "child": int, "childPoint": [3],
        "axis": [3] or null,       # normal of the plane, also that of a curve; axis of the cylinder
        "rim": [3] or null, "radius": float, "half": [3] or null, "axes": [9] or null,
        "curve": [[3]] or null,    # points, as it goes; what is on its left is solid
        "sign": float,             # -1 where the child is inside
        "times": [float], "states": [int]   # from each time on: places in STATES
      }],
      "impulses": [{"time": float, "size": float, "angular": bool, "contact": int,
                    "body": int, "point": [3], "direction": [3] or null, "basis": int}],
      "marks": [{"time": float, "name": str}]     # name of an event of the deck, else ""
    }

Impulses act on the child of a contact along its normal, and elsewhere on a body. Numbers of bodies
are those of the scene, -1 the ground.
"""

from collections.abc import Mapping, Sequence
from itertools import cycle
from typing import Any

import numpy as np
import pandas as pd

from msahl.contact.events import CLOSES, IMPACT, OPENS, PUSHES, RELEASES, SLIDES, STICKS
from msahl.model import (
    BoxContact,
    CapsuleContact,
    ContactSide,
    DistanceLimit,
    JointLimit,
    Model,
    PinContact,
    PlaneContact,
    SphereContact,
)
from msahl.model.events import Impulse
from msahl.post.scene.curves import points_of
from msahl.post.scene.geometry import floats
from msahl.post.scene.glyphs import Entry, numbers
from msahl.results.sample import Sample
from msahl.run.tables import REACTIONS

STATES = ("open", "closed", "sticks", "slides")
Loads = Mapping[str, tuple[np.ndarray, np.ndarray]]
NO_LOAD = np.zeros(1), np.zeros(1)
AFTER = {CLOSES: "closed", OPENS: "open", STICKS: "sticks", SLIDES: "slides", RELEASES: "open"}
"""What a contact is after an event of a kind."""
MOST_CONTACTS, MOST_IMPULSES, MOST_MARKS = 400, 5000, 200
"""Contacts and impulses that are drawn; of a run with more events none is marked in graphs."""


def happenings(
    model: Model, events: pd.DataFrame | None, loads: Loads | None = None
) -> dict[str, Any] | None:
    """Return what the viewer shows of the contacts of a model, and of the ``events`` of its run;
    None if there is nothing. ``loads`` are those of compliant contacts, which have no events.
    """
    body, rows = numbers(model), {} if events is None else dict(list(events.groupby("element")))
    rigid = () if events is None else model.contact_sides
    seen = [side for side in rigid if side.name in rows or not side.between_edges]
    sides = (*seen, *model.compliant_sides)[:MOST_CONTACTS]
    if not sides and (events is None or not len(events)):
        return None
    contacts = []
    for side in sides:
        place = _place(side, model, body)
        if place is None:
            continue
        if side.contact.compliance is None:
            states = _states(rows.get(side.name))
        else:
            states = _states_by_load(*(loads or {}).get(side.name, NO_LOAD))
        contacts.append({"name": side.name, **place, **states})
    return {
        "contacts": contacts,
        "impulses": _impulses(model, events, [c["name"] for c in contacts], body),
        "marks": [{"time": time, "name": name} for time, name in marks(events)],
    }


def loads_of_contacts(sample: Sample) -> Loads:
    """Return the times and loads of the compliant contacts, by name of the side."""
    names = [side.name for side in sample.model.compliant_sides]
    if not names:
        return {}
    columns, values = sample.tables[REACTIONS]
    places = {name: columns.index(f"{name}.load") for name in names if f"{name}.load" in columns}
    return {name: (values[:, 0], values[:, place]) for name, place in places.items()}


def _states_by_load(time: np.ndarray, load: np.ndarray) -> dict[str, Any]:
    """Return from which output times on a compliant contact is open or closed."""
    closed = load != 0.0
    first = np.flatnonzero(np.diff(closed, prepend=not closed[0]))
    return {"times": time[first].tolist(), "states": closed[first].astype(int).tolist()}


def marks(events: pd.DataFrame | None) -> list[tuple[float, str]]:
    """Return the times of impacts, and of events of the deck with their names, each once; none if
    there are more than can be told apart.
    """
    if events is None:
        return []
    shown = events[(events.kind == IMPACT) | (events.event != "")]
    found = dict.fromkeys(zip(shown.time.tolist(), shown.event.tolist(), strict=True))
    return list(found) if len(found) <= MOST_MARKS else []


def _states(rows: pd.DataFrame | None) -> dict[str, Any]:
    """Return what a contact is from which time on."""
    times, states = [0.0], [0]
    if rows is not None:
        found = rows[rows.kind.isin(AFTER)]
        times += found.time.tolist()
        states += [STATES.index(AFTER[kind]) for kind in found.kind.tolist()]
    return {"times": times, "states": states}


def _place(side: ContactSide, model: Model, body: Mapping[str, int]) -> Entry | None:
    """Return where the point of a contact is; None of a kind that is not drawn."""
    contact = side.contact
    entry: Entry = dict.fromkeys(("axis", "rim", "half", "axes", "curve"))
    entry |= {"shape": "centre", "radius": 0.0, "sign": side.sign}
    if isinstance(contact, JointLimit):
        joint = next(joint for joint in model.joints if joint.name == contact.joint)
        axis = floats(joint.parent_axes[2])
        return entry | _ends(joint, body) | {"shape": "joint", "axis": axis}
    if isinstance(contact, PlaneContact):
        entry |= {"axis": floats(contact.normal), "radius": contact.radius, "shape": "plane"}
        if contact.axis is not None:
            entry |= {"rim": floats(contact.axis), "shape": "rim"}
    elif isinstance(contact, SphereContact):
        about = None if contact.axis is None else floats(contact.axis)
        entry |= {"radius": abs(contact.parent_radius), "axis": about}
    elif isinstance(contact, BoxContact):
        axes = [float(c) for row in contact.axes for c in row]
        entry |= {"shape": "box", "half": floats(contact.half), "axes": axes}
        entry |= {"radius": contact.parent_radius}
    elif isinstance(contact, CapsuleContact):
        entry |= {"axis": floats(contact.parent_axis), "rim": floats(contact.axis)}
        entry |= {"half": [contact.parent_half, contact.half], "shape": "capsules"}
        entry |= {"radius": contact.parent_radius}
    elif isinstance(contact, PinContact):
        entry |= {"shape": "curve", "curve": points_of(contact).tolist()}
        entry |= {"axis": floats(contact.axes[2]), "radius": contact.radius}
    elif isinstance(contact, DistanceLimit):
        entry |= {"radius": side.limit}
    else:
        return None
    return entry | _ends(contact, body)


def _ends(record: Any, body: Mapping[str, int]) -> Entry:
    """Return the bodies of a joint or contact, and its points on them."""
    return {
        "parent": body[record.parent],
        "parentPoint": floats(record.parent_point),
        "child": body[record.child],
        "childPoint": floats(record.child_point),
    }


def _impulses(
    model: Model, events: pd.DataFrame | None, contacts: Sequence[str], body: Mapping[str, int]
) -> list[Entry]:
    """Return the impulses of impacts and of events of the deck, in order of time."""
    # An event has a row for each of its impulses, in their order.
    given = {
        event.name: cycle([_impulse(model, impulse, body) for impulse in event.impulses])
        for event in model.events
    }
    place = {name: k for k, name in enumerate(contacts)}
    angular = {side.name: side.is_angle for side in model.contact_sides}
    nothing = {"body": -1, "point": [0.0, 0.0, 0.0], "direction": None, "basis": -1}
    found: list[Entry] = []
    if events is None:
        return found
    rows = events[events.kind.isin((IMPACT, PUSHES))].head(MOST_IMPULSES)
    for row in rows.to_dict("records"):
        entry: Entry = {"time": row["time"], "size": row["impulse"], "contact": -1}
        if row["kind"] == PUSHES:
            found.append(entry | next(given[row["event"]]))
        elif row["element"] in place:
            own = {"contact": place[row["element"]], "angular": angular[row["element"]]}
            found.append(entry | nothing | own)
    return found


def _impulse(model: Model, impulse: Impulse, body: Mapping[str, int]) -> Entry:
    """Return where an impulse of the deck acts, and its direction of length 1."""
    if impulse.marker:
        marker = next(marker for marker in model.markers if marker.name == impulse.marker)
        direction = np.array(impulse.direction) / np.linalg.norm(impulse.direction)
        place = {"body": body[marker.body], "point": floats(marker.point)}
        return place | {
            "direction": floats(direction),
            "basis": body[impulse.basis],
            "angular": False,
        }
    joint = next(joint for joint in model.joints if joint.name == impulse.joint)
    return {
        "body": body[joint.child],
        "point": floats(joint.child_point),
        "direction": floats(joint.parent_axes[2]),
        "basis": body[joint.parent],
        "angular": impulse.coordinate.startswith("angle"),
    }
