"""Sizes of the terms that expressions of a system add up; rounding errors are relative to these.
And errors of expressions that follow from those of the motion.
"""

from typing import Any, NamedTuple

import numpy as np

from msahl.elements.constraints.coordinate_kinds import ANGLE
from msahl.elements.signals import group as kinds
from msahl.expressions.tape import errors, magnitudes
from msahl.ports import forces
from msahl.system.arrays import State, System, SystemWorkspace

LARGE = 1e60
"""Size of states in which their slopes are all that counts of a rate's terms."""

LONGEST_CHAIN = 8
"""States of which each is the rate of the next, through which errors of the motion are followed."""


class Scales(NamedTuple):
    """What a model's motion is measured by."""

    length: float  # [m]
    speed: float  # [m/s]
    energy: float  # [J]
    time: float = 0.0  # [s] of a run; 0: tables have the slopes that they have now


class Sizes(NamedTuple):
    """Sizes of the inputs of expressions, or their errors, by kind."""

    position: float  # [m]
    angle: float  # [rad]
    velocity: float  # [m/s]
    spin: float  # [rad/s]
    reaction: float  # [N] or [N m]
    time: float  # [s]


def tape_terms(
    system: System, start: SystemWorkspace, states: np.ndarray, scales: Scales
) -> np.ndarray:
    """(values,) what the terms of all values of a system's tape are, at most, as it is prepared, if
    none of their inputs is smaller than the ``scales``, and no auxiliary state than in ``states``.
    """
    group = system.forces.signals
    assert group is not None, "a system with signals"
    with np.errstate(all="ignore"):
        forces.set_expressions(group, start.forces, system.scalar)
        given = np.append(_inputs(group, system.scalar, _sizes(scales)), states)
        return magnitudes(group.tape, start.forces.signals.values, given, scales.time > 0.0)


def state_terms(
    system: System, start: SystemWorkspace, state: State, terms: np.ndarray
) -> np.ndarray:
    """(states,) terms of the auxiliary states: those of their rates, of the ``terms`` (values,) of
    the tape, over the run up to ``state`` or over the state's time constant, if that is shorter.
    """
    group = system.forces.signals
    assert group is not None, "a system with signals"
    given = np.append(np.zeros(group.kind.size), np.full(group.rate.size, LARGE))
    with np.errstate(all="ignore"):
        slopes = magnitudes(group.tape, start.forces.signals.values, given)[group.rate] / LARGE
        return terms[group.rate] * np.minimum(float(state.time[0]), 1.0 / slopes)


def motion_errors(
    system: System, start: SystemWorkspace, state: State, sizes: Sizes
) -> tuple[np.ndarray, np.ndarray]:
    """(values,) errors of all values of a system's tape, and (states,) of the auxiliary states,
    that follow from those of the motion, which have these ``sizes``: those of rates over the run up
    to ``state`` or over the state's time constant, if that is shorter.
    """
    group = system.forces.signals
    assert group is not None, "a system with signals"
    of_states = np.zeros(group.rate.size)
    with np.errstate(all="ignore"):
        forces.set_expressions(group, start.forces, system.scalar)
        inputs = _inputs(group, system.scalar, sizes)
        for _ in range(min(of_states.size, LONGEST_CHAIN) + 1):
            found = errors(group.tape, start.forces.signals.values, np.append(inputs, of_states))
            of_states = state_terms(system, start, state, found)
    return found, of_states


def rate_terms(system: System, start: SystemWorkspace, state: State, t_final: float) -> np.ndarray:
    """(2, states) terms of the rates of auxiliary states: of a model that moves by the length of
    its longest body in ``t_final`` [s], those that have it from positions, per second, and those
    that have it from velocities, over ``t_final``. Times count as well, and tables by their
    steepest pieces: a rate that is zero up to an entry is there what round-off of the time makes.
    """
    group, length = system.forces.signals, float(system.frames.length[:-1].max())
    if group is None or not group.rate.size:
        return np.zeros((2, 0))
    slow, fast = (
        tape_terms(system, start, np.abs(state.auxiliary), Scales(length, speed, 0.0, t_final))[
            group.rate
        ]
        for speed in (0.0, length / t_final)
    )
    return np.stack([slow, t_final * (fast - slow)])


def _sizes(scales: Scales) -> Sizes:
    """Sizes of the inputs by the ``scales``."""
    per_second = scales.speed / scales.length
    reaction = scales.energy / min(scales.length, 1.0)
    return Sizes(scales.length, 1.0, scales.speed, per_second, reaction, scales.time)


def _inputs(group: kinds.Signals, scalar: Any, sizes: Sizes) -> np.ndarray:
    """(y,) ``sizes`` of the inputs."""
    by_kind = {
        kinds.POSITION: sizes.position,
        kinds.VELOCITY: sizes.velocity,
        kinds.SPIN: sizes.spin,
        kinds.QUATERNION: sizes.angle,
        kinds.REACTION: sizes.reaction,
        kinds.TIME: sizes.time,
    }
    given = []
    for kind, item in zip(group.kind, group.item, strict=True):
        size = by_kind.get(int(kind))
        if size is None:
            is_angle, rate = scalar.coordinates.kind[item] == ANGLE, kind == kinds.RATE
            of_angle, of_length = (
                (sizes.spin, sizes.velocity) if rate else (sizes.angle, sizes.position)
            )
            size = of_angle if is_angle else of_length
        given.append(size)
    return np.array(given)
