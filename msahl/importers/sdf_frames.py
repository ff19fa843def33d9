"""Frames of SDF: links, joints, nested models and frames, each relative to another one.

A model is a scope of names. Names of nested models are reached as ``inner::name``. By default a
link and a nested model are relative to their model, a joint to its child, a frame to what it is
attached to; ``relative_to`` names another frame of the scope.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from msahl.deck.faults import Element, attribute
from msahl.importers.reading import Log
from msahl.importers.robot import HERE, Pose
from msahl.importers.sdf_values import raw_pose, text_of

MODEL, WORLD = "__model__", "world"
NEST = "::"
MOST_STEPS = 1000
"""Frames in a chain of relative ones."""
POSES_HAVE_FRAMES = (1, 7)
"""Version from which ``relative_to`` and the names of frames exist."""


@dataclass
class Frame:
    """A frame of a scope: its element, and the name of the frame that it is relative to without
    ``relative_to``; ``attached`` is the name of what it moves with, "" for a link or a model."""

    element: Element
    default: str
    attached: str = ""


@dataclass
class Scope:
    """A model, or the world: its frames by name, its nested models, and the ``prefix`` that names
    of its links have in the deck."""

    element: Element
    prefix: str
    version: tuple[int, int]
    placement: str = ""
    pose: Element | None = None
    """The ``<pose>`` of an ``<include>``, in place of the model's."""
    is_static: bool = False
    frames: dict[str, Frame] = field(default_factory=dict)
    models: dict[str, "Scope"] = field(default_factory=dict)
    known: dict[str, Pose | None] = field(default_factory=dict)
    """Poses in the scope's frame; None: being computed."""


def links_of(scope: Scope) -> Mapping[str, Element]:
    """Return the links of a scope, without those of nested models, by name."""
    return {name: one.element for name, one in scope.frames.items() if one.element.tag == "link"}


def pose_in(scope: Scope, name: str, asked: Element, log: Log) -> Pose:
    """Return the pose of a frame in the frame of its scope; ``asked`` is the element that names it,
    for a fault."""
    if name in ("", MODEL) or (name == WORLD and scope.element.tag == WORLD):
        return HERE
    if name in scope.known:
        found = scope.known[name]
        if found is None:
            log.fault(asked, f"frame '{name}' is relative to itself, through others")
            return HERE
        return found
    if len(scope.known) > MOST_STEPS + len(scope.frames) + len(scope.models):
        return HERE
    scope.known[name] = None
    found = _computed(scope, name, asked, log)
    scope.known[name] = found
    return found


def _computed(scope: Scope, name: str, asked: Element, log: Log) -> Pose:
    """Return the pose of a frame that is not known yet."""
    if name in scope.frames:
        frame = scope.frames[name]
        own = frame.element.find("pose")
        return _relative(scope, own, frame.default, log)
    head, _, rest = name.partition(NEST)
    if head in scope.models:
        return _of_model(scope, scope.models[head], log).after(
            pose_in(scope.models[head], rest, asked, log)
        )
    log.fault(asked, f"'{name}' is no frame, link, joint or model here")
    return HERE


def _of_model(scope: Scope, model: Scope, log: Log) -> Pose:
    """Return the pose of a nested model: that of its placement frame is given."""
    own = model.pose if model.pose is not None else model.element.find("pose")
    pose = _relative(scope, own, "", log)
    if not model.placement:
        return pose
    return pose.after(pose_in(model, model.placement, model.element, log).inverse())


def _relative(scope: Scope, element: Element | None, default: str, log: Log) -> Pose:
    """Return what a ``<pose>`` says, in the frame of the scope."""
    base = "" if element is None else attribute(element, "relative_to")
    if element is not None and not base and attribute(element, "frame"):
        log.lost(element, "its attribute frame, which has no meaning in these versions of SDF")
    asked = scope.element if element is None else element
    return pose_in(scope, base or default, asked, log).after(raw_pose(element, log))


def place(scope: Scope, outer: Pose, parent: Scope | None, log: Log) -> Pose:
    """Return the pose of a scope in inertial axes, in a parent that has the pose ``outer``."""
    return outer if parent is None else outer.after(_of_model(parent, scope, log))


def body_of(scope: Scope, name: str, asked: Element, log: Log) -> str | None:
    """Return the link, by its name in the deck, that a frame moves with; "" for the world, None
    with a fault."""
    for _ in range(MOST_STEPS):
        if name == WORLD:
            return ""
        if name == MODEL:
            name = canonical(scope)
        frame = scope.frames.get(name)
        if frame is not None and frame.element.tag == "link":
            return f"{scope.prefix}{name}"
        if frame is not None:
            name = frame.attached or (WORLD if scope.element.tag == WORLD else MODEL)
            continue
        head, sign, rest = name.partition(NEST)
        if head in scope.models:
            scope, name = scope.models[head], rest if sign else MODEL
            continue
        break
    log.fault(asked, f"'{name}' is no link or frame here")
    return None


def canonical(scope: Scope) -> str:
    """Return the name of the link that a model's frame moves with: by default its first one."""
    named = attribute(scope.element, "canonical_link")
    if named and named != MODEL:
        return named
    first = next(iter(links_of(scope)), "")
    if first:
        return first
    inner = next(iter(scope.models), "")
    return f"{inner}{NEST}{canonical(scope.models[inner])}" if inner else ""


def add_frames(scope: Scope, log: Log) -> None:
    """Read the links, joints and frames of a scope."""
    for element in scope.element:
        if element.tag not in ("link", "joint", "frame"):
            continue
        name = attribute(element, "name")
        reserved = name.startswith("__") or name == WORLD
        if not name or reserved:
            log.fault(element, f"the {element.tag} has no name of its own; give one")
        elif name in scope.frames or name in scope.models:
            log.fault(element, "the name is taken by another element of the model")
        else:
            scope.frames[name] = _frame(element)


def _frame(element: Element) -> Frame:
    if element.tag == "joint":
        child = text_of(element, "child")
        return Frame(element, child, child)
    attached = attribute(element, "attached_to") if element.tag == "frame" else ""
    return Frame(element, attached, attached)


def rotation_in(scope: Scope, name: str, asked: Element, log: Log) -> np.ndarray:
    """Return the axes (3, 3) of a frame in those of its scope."""
    return pose_in(scope, name, asked, log).R
