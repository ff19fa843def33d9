"""Actuators of MJCF: expressions of a length l, its rate v and a control u.

The length is that of a joint (l = gear q; of a ball the gear has three numbers, and q is its
rotation vector in the link's axes) or of a fixed tendon, and f loads every coordinate by its share:

    f = (g0 + g1 l + g2 l_dot) u + b0 + b1 l + b2 l_dot

    motor       f = u                       position    f = kp (u - l) - kv l_dot
    velocity    f = kv (u - l_dot)          damper      f = -kv l_dot u

    cylinder    f = A u + b0 + b1 l + b2 l_dot

A site has the length zero: it is pushed along and about its own axes by six numbers of gear. Of
actuators with g0 = -b1 a positive b2 is a damping ratio. With activation dynamics a state takes the
place of u: a_dot = (u - a)/T, or a_dot = u of an integrator.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.mjcf_inertia import ReferenceInertia, damping_of
from msahl.importers.mjcf_settings import Settings, note_unread, resolved, several
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import Axis, Control, Drive, Pose, Terms, Thrust

Law = tuple[list[float], list[float]]
"""g and b, three numbers each."""
READ = (
    "name", "class", "joint", "jointinparent", "tendon", "site", "gear", "ctrlrange", "ctrllimited",
    "forcerange", "forcelimited", "kp", "kv", "dampratio", "inheritrange", "gainprm", "biasprm",
    "gaintype", "biastype", "dyntype", "dynprm", "timeconst", "area", "diameter", "bias", "actdim",
    "actearly", "actlimited", "actrange", "group", "user",
)  # fmt: skip
FILTERS = ("filter", "filterexact")
SHORTEST = 1e-15
"""Shortest time constant [s], as in MuJoCo."""
TRANSMISSIONS = ("joint", "jointinparent", "tendon", "site")


@dataclass
class Targets:
    """What actuators act on: joints, fixed tendons, and sites with their links, by name; and the
    mass matrix that damping ratios refer to."""

    settings: Settings
    axes: Mapping[str, Axis]
    tendons: Mapping[str, Terms]
    unread: set[str]
    """Names of tendons that are not carried over."""
    sites: Mapping[str, tuple[str, Pose]]
    inertia: ReferenceInertia


def read_actuators(root: Element, targets: Targets, log: Log) -> list[Drive | Thrust | None]:
    """Return the actuators in the order of the file; None for those that are noted."""
    found = []
    for element in root.iterfind("actuator/*"):
        resolved(element, targets.settings, log)
        found.append(_actuator(element, targets, log))
    return found


def _actuator(element: Element, targets: Targets, log: Log) -> Drive | Thrust | None:
    terms = _terms(element, targets, log)
    if terms is None:
        return None
    reason = _reason(element, targets.settings)
    if reason:
        log.lost(element, reason)
        return None
    note_unread(element, READ, log)
    g, b = _damped(element, _LAWS[str(element.tag)](element, log), terms, targets, log)
    u = _input(element, targets, log)
    control = Control(rate=_rate(element, u, log))
    force = _force(g, b, "{a}" if control.rate else u)
    force = _clamped(element, force, targets.settings, log)
    on = next(attribute(element, name) for name in TRANSMISSIONS if name in element.attrib)
    name = attribute(element, "name") or f"{on} actuator"
    if "site" not in element.attrib:
        return Drive(name, terms, force, control, element)
    if any((*g[1:], *b[1:])):
        log.lost(element, "at a site msahl has no actuator but one whose force follows its control")
        return None
    link, place = targets.sites[on]
    gear = np.array([*_gear(element, log), *[0.0] * 6][:6])
    return Thrust(name, link, place, gear[:3], gear[3:], force, control, element)


def _terms(element: Element, targets: Targets, log: Log) -> Terms | None:
    """Return the length of an actuator, [] at a site; None with a fault or a note."""
    kind = next((name for name in TRANSMISSIONS if name in element.attrib), None)
    if kind is None:
        log.lost(element, "msahl has no actuators but those at joints, fixed tendons and sites")
        return None
    gear, on = _gear(element, log), attribute(element, kind)
    known = {"tendon": {*targets.tendons, *targets.unread}, "site": targets.sites}
    if on not in known.get(kind, targets.axes):
        log.fault(element, f"'{on}' is no {kind.removesuffix('inparent')}")
        return None
    if kind == "tendon":
        if on in targets.unread:
            log.lost(element, "its tendon is not carried over")
            return None
        return [(name, (gear[0] * c,)) for name, (c,) in targets.tendons[on]]
    if kind == "site":
        if "refsite" in element.attrib:
            log.lost(element, "an actuator with a refsite")
            return None
        return []
    axis = targets.axes[on]
    if axis.kind == "free" or (axis.kind == "ball" and kind == "jointinparent"):
        where = "in the axes of the parent" if axis.kind == "ball" else "at a free joint"
        log.lost(element, f"msahl has no actuator {where}")
        return None
    if axis.kind == "ball":
        return [(on, tuple([*gear, 0.0, 0.0][:3]))]
    return [(on, (gear[0],))]


def _gear(element: Element, log: Log) -> list[float]:
    return several(element, "gear", log, 6) or [1.0]


def _reason(element: Element, settings: Settings) -> str:
    """Return why an actuator cannot be carried over; "" if it can."""
    if element.tag not in _LAWS:
        return f"msahl has no {element.tag} actuator"
    dynamics = element.get("dyntype", "none")
    if dynamics not in ("none", "integrator", *FILTERS):
        return f"an actuator with dyntype {dynamics}"
    if has_activation(element) and settings.is_limited(element, "act"):
        return "an actuator whose activation has limits"
    types = element.get("gaintype", "fixed"), element.get("biastype", "none")
    if types[0] not in ("fixed", "affine") or types[1] not in ("none", "affine"):
        return f"an actuator with gaintype {types[0]} and biastype {types[1]}"
    return ""


def has_activation(element: Element) -> bool:
    """Return whether an actuator has a state."""
    if element.tag in ("muscle", "intvelocity", "cylinder"):
        return True
    constant = element.get("timeconst", "0").strip()
    return element.get("dyntype", "none") != "none" or constant.strip("0.") != ""


def _rate(element: Element, u: str, log: Log) -> str:
    """Return the rate of the state of an actuator with the input ``u``; "" if it has none."""
    if not has_activation(element):
        return ""
    if element.get("dyntype") == "integrator":
        return u
    T = number(element, "timeconst", log, (several(element, "dynprm", log, 10) or [1.0])[0])
    return f"({u} - {{a}})/{max(T, SHORTEST)!r}"


def _damped(element: Element, law: Law, terms: Terms, targets: Targets, log: Log) -> Law:
    """Return the law with the damping that a ratio gives."""
    g, b = law
    ratio = number(element, "dampratio", log)
    if ratio and b[2]:
        log.fault(element, "it gives kv and dampratio; give one of them")
        return law
    if not ratio and g[0] == -b[1]:
        ratio = b[2]
    if ratio <= 0.0:
        return law
    return g, [b[0], b[1], -damping_of(ratio, g[0], terms, targets.inertia)]


def _input(element: Element, targets: Targets, log: Log) -> str:
    """Return the expression of a control: within its range, if it has one."""
    low, high = 0.0, 0.0
    if "ctrlrange" in element.attrib and targets.settings.is_limited(element, "ctrl"):
        low, high = numbers(element, "ctrlrange", log, count=2)
    elif number(element, "inheritrange", log):
        low, high = _inherited(element, targets, log)
    return f"min(max({{u}}, {low!r}), {high!r})" if low < high else "{u}"


def _inherited(element: Element, targets: Targets, log: Log) -> tuple[float, float]:
    """Return the range of the joint of an actuator, about its middle by the share that it gives."""
    share = number(element, "inheritrange", log)
    axis = targets.axes.get(attribute(element, "joint"))
    if axis is None or axis.lower is None or axis.upper is None:
        log.lost(element, "its inheritrange: nothing bounds its control")
        return 0.0, 0.0
    middle, half = 0.5 * (axis.upper + axis.lower), 0.5 * share * (axis.upper - axis.lower)
    return middle - half, middle + half


def _force(g: list[float], b: list[float], u: str) -> str:
    """Return the expression of f."""
    scales = ("", "*{l}", "*{v}")
    gains = [f"{k!r}{s}" for k, s in zip(g, scales, strict=True) if k]
    terms = [f"({' + '.join(gains)})*{u}"] if gains else []
    if g[1:] == [0.0, 0.0] and g[0]:
        terms = [u if g[0] == 1.0 else f"{g[0]!r}*{u}"]
    terms += [f"{k!r}{s}" for k, s in zip(b, scales, strict=True) if k]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _clamped(element: Element, force: str, settings: Settings, log: Log) -> str:
    """Return the expression of a force within its range, if it has one."""
    if "forcerange" not in element.attrib or not settings.is_limited(element, "force"):
        return force
    low, high = numbers(element, "forcerange", log, count=2)
    return f"min(max({force}, {low!r}), {high!r})" if low < high else force


def _motor(element: Element, log: Log) -> Law:
    return [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]


def _position(element: Element, log: Log) -> Law:
    kp, kv = number(element, "kp", log, 1.0), number(element, "kv", log)
    return [kp, 0.0, 0.0], [0.0, -kp, -kv]


def _velocity(element: Element, log: Log) -> Law:
    kv = number(element, "kv", log, 1.0)
    return [kv, 0.0, 0.0], [0.0, 0.0, -kv]


def _damper(element: Element, log: Log) -> Law:
    return [0.0, 0.0, -number(element, "kv", log, 1.0)], [0.0, 0.0, 0.0]


def _general(element: Element, log: Log) -> Law:
    g = [*(several(element, "gainprm", log, 10) or [1.0]), 0.0, 0.0, 0.0][:3]
    b = [*several(element, "biasprm", log, 10), 0.0, 0.0, 0.0][:3]
    if element.get("gaintype", "fixed") == "fixed":
        g = [g[0], 0.0, 0.0]
    return g, b if element.get("biastype", "none") == "affine" else [0.0, 0.0, 0.0]


def _cylinder(element: Element, log: Log) -> Law:
    area = number(element, "area", log, 1.0)
    if number(element, "diameter", log) > 0.0:
        area = 0.25 * math.pi * number(element, "diameter", log) ** 2
    return [area, 0.0, 0.0], [*several(element, "bias", log, 3), 0.0, 0.0, 0.0][:3]


_LAWS = {
    "motor": _motor,
    "position": _position,
    "velocity": _velocity,
    "damper": _damper,
    "cylinder": _cylinder,
    "general": _general,
}
"""Kinds of actuators."""
