"""Actuators of MJCF at joints: expressions of the coordinate q, its rate v and a control u.

With the length l = gear q and its rate, a joint gets the load gear f of the actuator's force

    f = (g0 + g1 l + g2 l_dot) u + b0 + b1 l + b2 l_dot

    motor       f = u                       position    f = kp (u - l) - kv l_dot
    velocity    f = kv (u - l_dot)          damper      f = -kv l_dot u
"""

from collections.abc import Mapping

from msahl.deck.faults import Element, attribute
from msahl.importers.mjcf_settings import Settings, resolved, several
from msahl.importers.reading import Log, number, numbers
from msahl.importers.robot import Axis, Drive

Law = tuple[list[float], list[float]]
"""g and b, three numbers each."""
READ = (
    "name", "class", "joint", "gear", "ctrlrange", "ctrllimited", "forcerange", "forcelimited",
    "kp", "kv", "gainprm", "biasprm", "gaintype", "biastype", "dyntype", "group", "user",
)  # fmt: skip


def read_actuators(
    root: Element, settings: Settings, axes: Mapping[str, Axis], log: Log
) -> list[Drive]:
    """Return the actuators of joints; others are noted."""
    drives = []
    for element in root.iterfind("actuator/*"):
        resolved(element, settings, log)
        drive = _drive(element, settings, axes, log)
        if drive is not None:
            drives.append(drive)
    return drives


def _drive(
    element: Element, settings: Settings, axes: Mapping[str, Axis], log: Log
) -> Drive | None:
    joint = attribute(element, "joint")
    if not joint:
        log.lost(element, "msahl has no actuators but those at joints")
        return None
    if joint not in axes:
        log.fault(element, f"'{joint}' is no joint")
        return None
    reason = _reason(element, axes[joint], log)
    if reason:
        log.lost(element, reason)
        return None
    for name in map(str, element.attrib):
        if name not in READ:
            log.lost(element, f"its {name}")
    g, b = _LAWS[str(element.tag)](element, log)
    gear = (several(element, "gear", log, 6) or [1.0])[0]
    control, u = _control(element, settings, log)
    force = _clamped(element, _force(g, b, gear, u), settings, log)
    name = attribute(element, "name") or f"{joint} actuator"
    text = force if gear == 1.0 else f"{gear!r}*({force})"
    return Drive(name, joint, text, control, element)


def _reason(element: Element, axis: Axis, log: Log) -> str:
    """Return why an actuator cannot be carried over; "" if it can."""
    if element.tag not in _LAWS:
        return f"msahl has no {element.tag} actuator"
    if axis.kind not in ("hinge", "slide"):
        return f"msahl has no actuator at a {axis.kind} joint"
    if element.get("dyntype", "none") != "none" or number(element, "timeconst", log):
        return "an actuator with activation dynamics"
    if number(element, "dampratio", log):
        return "an actuator with a dampratio"
    types = element.get("gaintype", "fixed"), element.get("biastype", "none")
    if types[0] not in ("fixed", "affine") or types[1] not in ("none", "affine"):
        return f"an actuator with gaintype {types[0]} and biastype {types[1]}"
    return ""


def _control(element: Element, settings: Settings, log: Log) -> tuple[float, str]:
    """Return the control at rest, and the expression of it: within its range, if it has one."""
    given = {str(key): str(value) for key, value in element.attrib.items()}
    if "ctrlrange" not in given or not settings.is_limited(given, "ctrl"):
        return 0.0, "{u}"
    low, high = numbers(element, "ctrlrange", log, count=2)
    if low >= high:
        return 0.0, "{u}"
    return 0.0, f"min(max({{u}}, {low!r}), {high!r})"


def _force(g: list[float], b: list[float], gear: float, u: str) -> str:
    """Return the expression of f."""
    factor = "" if gear == 1.0 else f"*{gear!r}"
    scales = ("", f"{factor}*{{q}}", f"{factor}*{{v}}")
    gains = [f"{k!r}{s}" for k, s in zip(g, scales, strict=True) if k]
    terms = [f"({' + '.join(gains)})*{u}"] if gains else []
    if g[1:] == [0.0, 0.0] and g[0]:
        terms = [u if g[0] == 1.0 else f"{g[0]!r}*{u}"]
    terms += [f"{k!r}{s}" for k, s in zip(b, scales, strict=True) if k]
    return " + ".join(terms).replace("+ -", "- ") or "0"


def _clamped(element: Element, force: str, settings: Settings, log: Log) -> str:
    """Return the expression of a force within its range, if it has one."""
    given = {str(key): str(value) for key, value in element.attrib.items()}
    if "forcerange" not in given or not settings.is_limited(given, "force"):
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


_LAWS = {
    "motor": _motor,
    "position": _position,
    "velocity": _velocity,
    "damper": _damper,
    "general": _general,
}
"""Kinds of actuators."""
