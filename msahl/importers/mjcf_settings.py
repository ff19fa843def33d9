"""Settings of MJCF: ``<compiler>``, classes of ``<default>``, and how frames are given."""

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field

import numpy as np

from msahl.algebra.rotation_arrays import matrices
from msahl.deck.faults import Element, attribute
from msahl.importers.joints import about
from msahl.importers.reading import Log, floats, numbers
from msahl.importers.robot import Pose

MAIN = "main"
"""The class of elements that name none."""
ACTUATORS = (
    "general", "motor", "position", "velocity", "intvelocity", "damper", "cylinder", "muscle",
    "adhesion", "plugin", "dcmotor",
)  # fmt: skip
ORIENTATIONS = ("quat", "axisangle", "xyaxes", "zaxis", "euler")
SHARED = ("gear", "ctrlrange", "ctrllimited", "forcerange", "forcelimited")
"""Attributes of actuators whose defaults are those of actuators of any kind."""


@dataclass
class Settings:
    """Attributes of ``<compiler>``, and those of classes: class -> tag -> attributes."""

    compiler: dict[str, str] = field(default_factory=dict)
    classes: dict[str, dict[str, dict[str, str]]] = field(default_factory=lambda: {MAIN: {}})

    @property
    def degree(self) -> float:
        """Radians of the unit of angles."""
        return 1.0 if self.compiler.get("angle") == "radian" else math.pi / 180.0

    def is_limited(self, element: Element, name: str) -> bool:
        """Return whether a range counts: ``name`` is "" of joints and tendons, "ctrl", "force" or
        "act".
        """
        word = element.get(f"{name}limited", "auto")
        automatic = self.compiler.get("autolimits", "true") == "true"
        return word == "true" or (word == "auto" and automatic and f"{name}range" in element.attrib)


def note_unread(element: Element, read: Collection[str], log: Log) -> None:
    """Note the attributes of an element that are not ``read``."""
    for name in map(str, element.attrib):
        if name not in read:
            log.lost(element, f"its {name}")


def read_settings(root: Element, log: Log) -> Settings:
    """Return the settings of a ``<mujoco>``."""
    settings = Settings()
    for compiler in root.iterfind("compiler"):
        settings.compiler.update(_attributes(compiler))
    if settings.compiler.get("coordinate", "local") != "local":
        log.fault(root, "coordinate='global' is no longer MJCF; save the file by a newer MuJoCo")
    for default in root.iterfind("default"):
        for element, parent in _nested(default, MAIN):
            top = parent == MAIN and element is default
            name = MAIN if top else attribute(element, "class")
            if not name:
                log.fault(element, "this default has no class; give one")
            _add_class(settings, name, MAIN if top else parent, element)
    return settings


def _nested(default: Element, parent: str) -> Iterator[tuple[Element, str]]:
    """Yield a ``<default>`` and all within it, each with the class of the one around it."""
    waiting = [(default, parent)]
    first = True
    while waiting:
        element, around = waiting.pop()
        yield element, around
        own = MAIN if first else attribute(element, "class")
        waiting += [(child, own) for child in element.iterfind("default")]
        first = False


def _add_class(settings: Settings, name: str, parent: str, element: Element) -> None:
    """Add a class with the attributes of the one around it and its own."""
    tags = {tag: dict(given) for tag, given in settings.classes.get(parent, {}).items()}
    if name == parent:
        tags = settings.classes[name]
    for child in element:
        if child.tag != "default":
            tags.setdefault(str(child.tag), {}).update(_attributes(child))
            if child.tag in ACTUATORS:
                shared = {k: v for k, v in _attributes(child).items() if k in SHARED}
                tags.setdefault("actuator", {}).update(shared)
    settings.classes[name] = tags


def _attributes(element: Element) -> dict[str, str]:
    return {str(key): str(value) for key, value in element.attrib.items()}


def resolved(element: Element, settings: Settings, log: Log, childclass: str = MAIN) -> Element:
    """Return the element with the attributes of its class added to its own, in place; the class of
    an element that names none is the ``childclass`` of the bodies around it."""
    name = attribute(element, "class") or childclass
    if name not in settings.classes:
        log.fault(element, f"there is no default class '{name}'")
        return element
    tags = settings.classes[name]
    given = dict(tags.get("actuator", {})) if element.tag in ACTUATORS else {}
    given |= tags.get(str(element.tag), {})
    if any(word in element.attrib for word in ORIENTATIONS):  # one of them replaces any other
        given = {key: word for key, word in given.items() if key not in ORIENTATIONS}
    for key, word in given.items():
        if key not in element.attrib and key != "class":
            element.set(key, word)
    return element


def pose(element: Element, settings: Settings, log: Log) -> Pose:
    """Return the frame that ``pos`` and an orientation give."""
    return Pose(orientation(element, settings, log), np.array(numbers(element, "pos", log)))


def orientation(element: Element, settings: Settings, log: Log) -> np.ndarray:
    """Return the rotation (3, 3) that an element gives in one of five ways."""
    given = [name for name in ORIENTATIONS if name in element.attrib]
    if len(given) > 1:
        log.fault(element, f"it gives {' and '.join(given)}; give one of them")
    for name in given[:1]:
        found = _BY_NAME[name](element, settings, log)
        if not np.isfinite(found).all():
            log.fault(element, f"{name} gives no direction; its vectors must not be zero")
            return np.eye(3)
        return found
    return np.eye(3)


def rotation_of(quaternion: np.ndarray) -> np.ndarray:
    """Return the rotation of a quaternion (4,), scalar first, of any length but zero."""
    return matrices(quaternion / np.sqrt(quaternion @ quaternion))


def _quat(element: Element, settings: Settings, log: Log) -> np.ndarray:
    return rotation_of(np.array(numbers(element, "quat", log, (1.0, 0.0, 0.0, 0.0), 4)))


def _axis_angle(element: Element, settings: Settings, log: Log) -> np.ndarray:
    *axis, angle = numbers(element, "axisangle", log, (0.0, 0.0, 1.0, 0.0), 4)
    return about(_unit(np.array(axis)), angle * settings.degree)


def _xy_axes(element: Element, settings: Settings, log: Log) -> np.ndarray:
    x, y = np.array(numbers(element, "xyaxes", log, (1.0, 0, 0, 0, 1.0, 0), 6)).reshape(2, 3)
    x = _unit(x)
    y = _unit(y - (x @ y) * x)
    return np.array([x, y, np.cross(x, y)]).T


def _z_axis(element: Element, settings: Settings, log: Log) -> np.ndarray:
    return smallest_to(_unit(np.array(numbers(element, "zaxis", log, (0.0, 0.0, 1.0)))))


def _euler(element: Element, settings: Settings, log: Log) -> np.ndarray:
    """Lower-case letters rotate about axes that rotate along, upper-case ones about fixed axes."""
    R = np.eye(3)
    sequence = settings.compiler.get("eulerseq", "xyz")
    if len(sequence) != 3 or not set(sequence) <= set("xyzXYZ"):
        log.fault(element, f"eulerseq '{sequence[:20]}': expected three of x y z X Y Z")
        return R
    for letter, angle in zip(sequence, numbers(element, "euler", log), strict=True):
        step = about(np.eye(3)["xyz".index(letter.lower())], angle * settings.degree)
        R = R @ step if letter.islower() else step @ R
    return R


_BY_NAME = {
    "quat": _quat,
    "axisangle": _axis_angle,
    "xyaxes": _xy_axes,
    "zaxis": _z_axis,
    "euler": _euler,
}


def smallest_to(z: np.ndarray) -> np.ndarray:
    """Return the smallest rotation (3, 3) that takes the z axis to the unit vector ``z``."""
    axis = np.cross([0.0, 0.0, 1.0], z)
    sine = np.sqrt(axis @ axis)
    if sine < 1e-12:
        return np.eye(3) if z[2] > 0.0 else about(np.array([1.0, 0.0, 0.0]), math.pi)
    return about(axis / sine, math.atan2(sine, z[2]))


def _unit(a: np.ndarray) -> np.ndarray:
    return np.asarray(a / np.sqrt(a @ a))


def several(element: Element, name: str, log: Log, most: int) -> list[float]:
    """Return the numbers of an attribute that may have fewer than ``most``; [] without it."""
    text = element.get(name)
    if text is None:
        return []
    values = floats(text)
    if values is None or len(values) > most:
        log.fault(element, f'{name}="{text[:60]}": expected up to {most} finite numbers')
        return []
    return values
