"""The drives of an inverse problem: loads that are unknown, in place of laws that the deck gives.

A drive is an actuator of the deck, a prescribed motion of the deck, or an ideal motor at a
coordinate of a joint. Each becomes an actuator whose law is zero; its load is found from the
motion. Prescribed motions that are not among the drives remain constraints.
"""

from collections.abc import Sequence
from dataclasses import replace

from msahl.expressions.syntax import Number, nearest
from msahl.joints.coordinates import is_angle
from msahl.joints.registry import KINDS
from msahl.model import ConcentratedLoad, JointActuator, MarkerActuator, Model
from msahl.model.loads import Load
from msahl.model.motions import JointMotion, PointMotion
from msahl.records import record

NONE = Number(0.0)
"""The law of a load that is not known."""


class InverseError(ValueError):
    """A question without an answer: wrong names or tables, or a motion that does not determine
    all bodies; the message names the remedy."""


@record
class Drive:
    """A load that is unknown; ``kind`` is "actuator", "motion" or "joint"."""

    name: str
    kind: str
    rotates: bool  # whether the load is a moment [N m], not a force [N]

    @property
    def unit(self) -> str:
        """The unit of the load."""
        return "N m" if self.rotates else "N"


def with_drives(
    model: Model, names: Sequence[str] = (), given: Sequence[str] = ()
) -> tuple[Model, tuple[Drive, ...]]:
    """Return the model whose drives have no law, and the drives; by default all actuators and
    prescribed motions of the deck, or, if it has none, motors at the ``given`` coordinates. Raises
    ``InverseError``.
    """
    known = _known(model)
    chosen = list(names) or [
        *(load.name for load in model.actuators),
        *(motion.name for motion in model.motions),
    ]
    chosen = chosen or list(given)
    if not chosen:
        raise InverseError(
            "the deck has neither actuators nor prescribed motions, and the table no coordinate of "
            "a joint; name coordinates of joints with --loads, "
            f"such as {next(iter(known), 'Joint.angle')}"
        )
    for name in chosen:
        if name not in known:
            raise InverseError(_unknown(name, list(known)))
    drives, loads = list[Drive](), list(model.loads)
    for name in chosen:
        drive, load = known[name]
        if drive in drives:
            raise InverseError(f"the drive '{name}' is named twice; name each once")
        drives.append(drive)
        if drive.kind == "actuator":
            loads[[each.name for each in loads].index(name)] = load
        else:
            loads.append(load)
    motions = tuple(motion for motion in model.motions if motion.name not in chosen)
    return replace(model, loads=tuple(loads), motions=motions), tuple(drives)


def results_of(model: Model, drives: Sequence[Drive]) -> list[int]:
    """Return the number of each drive among the results of the signals: actuators, then other
    loads by expressions, in the order of the deck.
    """
    order = [load.name for load in (*model.actuators, *model.controlled)]
    return [order.index(drive.name) for drive in drives]


def _known(model: Model) -> dict[str, tuple[Drive, Load]]:
    """Return all drives that the model can have, each with its load, by name."""
    found: dict[str, tuple[Drive, Load]] = {}
    for joint in model.joints:
        has = KINDS[joint.kind].coordinates
        for coordinate in has:
            name = f"{joint.name}.{coordinate}"
            drive = Drive(name, "joint", is_angle(coordinate))
            found[name] = drive, JointActuator(name, joint.name, coordinate, NONE)
            if len(has) == 1:
                found[joint.name] = found[name]
    for motion in model.motions:
        found[motion.name] = _of_motion(model, motion)
    for load in model.loads:
        if isinstance(load, JointActuator):
            drive = Drive(load.name, "actuator", is_angle(load.coordinate))
            found[load.name] = drive, replace(load, expression=NONE)
        elif isinstance(load, MarkerActuator):
            drive = Drive(load.name, "actuator", rotates=False)
            found[load.name] = drive, replace(load, expression=NONE)
    return found


def _of_motion(model: Model, motion: JointMotion | PointMotion) -> tuple[Drive, Load]:
    """Return the drive in place of a prescribed motion."""
    if isinstance(motion, JointMotion):
        load: Load = JointActuator(motion.name, motion.joint, motion.coordinate, NONE)
        return Drive(motion.name, "motion", is_angle(motion.coordinate)), load
    if not model.grounds:
        raise InverseError(f"the load of motion '{motion.name}' needs a <ground> in the deck")
    basis = model.grounds[0].name
    load = ConcentratedLoad(
        motion.name,
        motion.body,
        motion.point,
        force=motion.direction,
        force_basis=basis,
        moment=(0.0, 0.0, 0.0),
        moment_basis=basis,
        expression=NONE,
    )
    return Drive(motion.name, "motion", rotates=False), load


def _unknown(name: str, known: list[str]) -> str:
    """Return the message on a drive that does not exist."""
    return (
        f"no actuator, prescribed motion or coordinate of a joint is named '{name}'"
        f"{nearest(name, known)}"
    )
