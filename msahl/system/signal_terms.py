"""Sizes of the terms that expressions of a system add up; rounding errors are relative to these."""

from typing import Any, NamedTuple

import numpy as np

from msahl.elements.constraints.coordinate_kinds import ANGLE
from msahl.elements.signals import group as kinds
from msahl.expressions.tape import magnitudes
from msahl.ports import forces
from msahl.system.arrays import State, System, SystemWorkspace

LARGE = 1e60
"""Size of states in which their slopes are all that counts of a rate's terms."""


class Scales(NamedTuple):
    """What a model's motion is measured by."""

    length: float  # [m]
    speed: float  # [m/s]
    energy: float  # [J]
    time: float = 0.0  # [s] of a run; 0: tables have the slopes that they have now


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
        given = np.append(_inputs(group, system.scalar, scales), states)
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


def _inputs(group: kinds.Signals, scalar: Any, scales: Scales) -> np.ndarray:
    """(y,) sizes of the inputs by the ``scales``."""
    per_second = scales.speed / scales.length
    by_kind = {
        kinds.POSITION: scales.length,
        kinds.VELOCITY: scales.speed,
        kinds.SPIN: per_second,
        kinds.QUATERNION: 1.0,
        kinds.REACTION: scales.energy / min(scales.length, 1.0),
        kinds.TIME: scales.time,
    }
    sizes = []
    for kind, item in zip(group.kind, group.item, strict=True):
        size = by_kind.get(int(kind))
        if size is None:
            length = 1.0 if scalar.coordinates.kind[item] == ANGLE else scales.length
            size = length * (per_second if kind == kinds.RATE else 1.0)
        sizes.append(size)
    return np.array(sizes)
