"""Numbers and words of SDF, which stand in the text of elements."""

import math
from collections.abc import Sequence

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.reading import LARGEST, Log, floats
from msahl.importers.robot import HERE, Pose
from msahl.importers.urdf import roll_pitch_yaw

UNBOUNDED = 1e16
"""Limit at and above which there is no limit: files before SDF 1.8 write 1e16 in place of inf."""
QUATERNION = "quat_xyzw"


def text_of(parent: Element | None, tag: str, given: str = "") -> str:
    """Return the text of a child; ``given`` without it."""
    element = None if parent is None else parent.find(tag)
    text = "" if element is None else (element.text or "").strip()
    return text or given


def values(
    parent: Element | None, tag: str, log: Log, given: Sequence[float], required: bool = False
) -> list[float]:
    """Return the numbers of a child, as many as are ``given``; these without it or with a fault."""
    element = None if parent is None else parent.find(tag)
    if element is None:
        if required and parent is not None:
            log.fault(parent, f"it has no <{tag}>; give one")
        return list(given)
    found = floats(element.text or "")
    if found is None or len(found) != len(given):
        expected = "a finite number" if len(given) == 1 else f"{len(given)} finite numbers"
        shown = (element.text or "").strip()[:60]
        log.fault(element, f"'{shown}': expected {expected} up to {LARGEST:g}")
        return list(given)
    return found


def value(parent: Element | None, tag: str, log: Log, given: float = 0.0) -> float:
    """Return the number of a child; ``given`` without it or with a fault."""
    return values(parent, tag, log, (given,))[0]


def bound(parent: Element, tag: str, log: Log, given: float) -> float:
    """Return a limit, infinite from ``UNBOUNDED`` on; ``given`` without it or with a fault."""
    text = text_of(parent, tag)
    try:
        number = float(text) if text and "_" not in text else given
    except ValueError:
        number = math.nan
    if math.isnan(number):
        log.fault(parent, f"its {tag} is '{text[:60]}'; expected a number")
        return given
    return math.copysign(math.inf, number) if abs(number) >= UNBOUNDED else number


def flag(parent: Element | None, tag: str, given: bool = False) -> bool:
    """Return whether a child says true; ``given`` without it."""
    text = text_of(parent, tag).lower()
    return text in ("1", "true") if text else given


def raw_pose(element: Element | None, log: Log) -> Pose:
    """Return what a ``<pose>`` says, in whatever frame it is relative to."""
    if element is None or not (element.text or "").strip():
        return HERE
    is_quaternion = attribute(element, "rotation_format") == QUATERNION
    count = 7 if is_quaternion else 6
    found = floats(element.text or "")
    if found is None or len(found) != count:
        log.fault(element, f"'{(element.text or '').strip()[:60]}': expected {count} numbers")
        return HERE
    p, rest = np.array(found[:3]), found[3:]
    if is_quaternion:
        return Pose(_of_quaternion(element, rest, log), p)
    scale = math.pi / 180.0 if attribute(element, "degrees").lower() in ("1", "true") else 1.0
    return Pose(roll_pitch_yaw(*(scale * angle for angle in rest)), p)


def _of_quaternion(element: Element, given: Sequence[float], log: Log) -> np.ndarray:
    """Return the rotation of a quaternion x, y, z, w."""
    size = math.hypot(*given)
    if not size > 0.0:
        log.fault(element, "its quaternion is zero; give a rotation")
        return HERE.R
    x, y, z, w = (part / size for part in given)
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + 2.0 * w * K + 2.0 * K @ K)
