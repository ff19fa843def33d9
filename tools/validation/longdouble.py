"""Run the gauss scheme in the machine's longest precision.

In double precision an error of order 10 falls from that of a too large step to rounding errors
before its slope is constant. Kernels are plain Python functions that compute in the type of their
arrays. So a model is assembled as usual, and its arrays are converted to ``LONG``. Values that were
rounded before are computed again (the quadrature rule, inverse inertias), the constraint violation
of the initial state is removed, and the steps are those of ``schemes.collocation.newton``,
uncompiled, with functions and tolerances of this precision. The numbers of the deck stay rounded to
doubles.
"""

import math
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
from numpy.polynomial import Polynomial

from msahl.algebra.rotation import compose, from_increment
from msahl.algebra.vector import add, at, put, scale
from msahl.elements.constraints import scalar
from msahl.jit.kernel import MARKED
from msahl.model import Model
from msahl.run.subsystem import SubsystemIntegrator
from msahl.schemes.collocation import newton
from msahl.schemes.collocation.newton import TARGET, CollocationWorkspace
from msahl.schemes.collocation.stepper import CollocationMethod
from msahl.schemes.collocation.tableau import Tableau, new_tableau
from msahl.schemes.common import accelerations
from msahl.schemes.fixed_stepper import FixedStepper
from msahl.schemes.outcome import TOLERANCE
from msahl.schemes.output_schedule import OutputSchedule
from msahl.system import evaluate

LONG = np.longdouble
ROUND_OFF = float(np.finfo(LONG).eps / np.finfo(float).eps)
"""That of ``LONG`` by that of doubles: 1 where a machine has nothing longer."""
POLISHINGS = 3
"""Steps of Newton's method from a number in double precision: enough for 113 bits."""

FUNCTIONS = SimpleNamespace(
    sqrt=np.sqrt,
    sin=np.sin,
    cos=np.cos,
    tanh=np.tanh,
    atan2=np.arctan2,
    floor=np.floor,
    log=np.log,
    isnan=np.isnan,
    inf=math.inf,
    nan=math.nan,
    pi=4.0 * np.arctan(LONG(1.0)),
)
"""What kernels take from ``math``, whose own functions return doubles."""


def run(model: Model, steps: int, rows: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Return states (rows, 12 n) and reactions (rows, k) of a model of one subsystem by its gauss
    scheme in ``steps`` equal steps; None if one of them does not converge.
    """
    integrator = SubsystemIntegrator(model, "newton", full=False, chunk=steps)
    assert isinstance(integrator.stepper, FixedStepper)
    method = integrator.stepper.method
    assert isinstance(method, CollocationMethod)
    assert method.scheme == "gauss"
    subsystem = widened(method.subsystem)
    inverse_inertia = inverse(subsystem.workspace.system.bodies.inertia)
    stages = subsystem.stages._replace(
        tableau=gauss(method.degree), inverse_inertia=inverse_inertia
    )
    subsystem = subsystem._replace(stages=stages)
    plan = OutputSchedule.at_ends(np.arange(1, steps + 1) % (steps // rows) == 0)
    with in_long():
        settle(subsystem)
        h: Any = LONG(model.simulation.t_final) / steps
        taken = newton.take_steps(subsystem, h, 0, steps, plan.due, plan.share)
    tables = subsystem.workspace.tables
    return (tables.states[:rows], tables.reactions[:rows]) if taken == steps else None


@contextmanager
def in_long() -> Iterator[None]:
    """Kernels, called as plain Python, compute in ``LONG`` and solve to its round-off."""
    fitting = {"math": FUNCTIONS, "TARGET": ROUND_OFF * TARGET, "TOLERANCE": ROUND_OFF * TOLERANCE}
    with ExitStack() as stack:
        # What leads to no number is seen by the solver, as in compiled code.
        stack.enter_context(np.errstate(all="ignore"))
        for module in {sys.modules[kernel.__module__] for kernel in MARKED}:
            for name in fitting.keys() & vars(module).keys():
                stack.enter_context(mock.patch.object(module, name, fitting[name]))
        yield


def widened(group: Any, known: dict[int, Any] | None = None) -> Any:
    """A group of groups with its arrays of doubles in ``LONG``; what it has twice stays one."""
    known = {} if known is None else known
    if id(group) not in known:
        wide = group
        if isinstance(group, tuple):
            wide = type(group)(*(widened(part, known) for part in group))
        elif isinstance(group, np.ndarray) and group.dtype == np.float64:
            wide = group.astype(LONG)
        known[id(group)] = wide
    return known[id(group)]


def inverse(A: np.ndarray) -> np.ndarray:
    """Inverses of the matrices (..., n, n) in ``LONG``."""
    X, one = np.linalg.inv(A.astype(float)).astype(LONG), np.eye(A.shape[-1], dtype=LONG)
    for _ in range(POLISHINGS):
        X = X + X @ (one - A @ X)
    return X


def gauss(s: int) -> Tableau:
    """The rule of degree ``s`` in ``LONG``, by the formulas of ``schemes.rule``."""
    tableau = new_tableau("gauss", s)
    # Rodrigues' formula has but powers of 1/2, which are exact.
    ends = (Polynomial([-1.0, 0.0, 1.0]) ** s).deriv(s) / (2.0**s * math.factorial(s))
    x = _roots(ends, 2.0 * tableau.force_time - 1.0)
    y = np.concatenate(
        [[-1.0], _roots(ends.deriv(), 2.0 * tableau.constraint_time[:-1] - 1.0), [1.0]]
    )
    at_forces, at_joints = _lagrange(x), _lagrange(y)
    integrals = [0.5 * p.integ(lbnd=-1.0) for p in at_forces]
    weight = np.stack([p(y[-1]) for p in integrals])
    node_weight = 1.0 / (s * (s + 1.0) * ends(y) ** 2)
    value = np.stack([p(x) for p in at_joints], axis=1)
    slope = np.stack([2.0 * p.deriv()(x) for p in at_joints], axis=1)
    N_inverse = inverse((weight[:, None] * slope[:, :s]).T @ slope[:, 1:])
    return tableau._replace(
        force_time=0.5 * (x + 1.0),
        force_weight=weight,
        constraint_time=0.5 * (y[1:] + 1.0),
        multiplier_weight=node_weight[:s],
        basis=value[:, 1:],
        basis_rate=slope[:, 1:],
        alpha=N_inverse @ (weight[:, None] * value[:, :s]).T,
        beta=N_inverse @ (weight[:, None] * slope[:, :s]).T,
        chi=N_inverse * node_weight[:s],
        integral=np.stack([p(y[1:]) for p in integrals], axis=1),
        multiplier_time=0.5 * (y[:s] + 1.0),
        node_time=0.5 * (np.concatenate([y, x]) + 1.0),
        node_basis=np.concatenate([np.eye(s + 1)[:, 1:], value[:, 1:]]),
        node_basis_rate=np.concatenate([np.zeros((s + 1, s)), slope[:, 1:]]),
    )


def _roots(p: Polynomial, near: np.ndarray) -> np.ndarray:
    x = near.astype(LONG)
    for _ in range(POLISHINGS):
        x = x - p(x) / p.deriv()(x)
    return x


def _lagrange(nodes: np.ndarray) -> list[Polynomial]:
    one = Polynomial(np.ones(1, dtype=LONG))
    return [
        math.prod((Polynomial([-x, 1.0]) / (node - x) for x in nodes if x != node), start=one)
        for node in nodes
    ]


def settle(subsystem: CollocationWorkspace) -> None:
    """Put places and velocities back on the joints, by the least change by mass."""
    workspace, instant = subsystem.workspace, subsystem.instant
    system, state, start = workspace.system, workspace.state, workspace.start
    monitor = workspace.monitor
    length = system.frames.length
    evaluate.prepare(system, state, start)
    # What a round leaves over is quadratic: nothing, after one of round-off.
    for _ in range(1 + accelerations.projection_rounds(system)):
        evaluate.observe(system, state, start, monitor.violation, monitor.rate)
        scalar.in_metres(system.scalar, monitor.violation, monitor.rate)
        accelerations.solve_projection(system, state, start, monitor.violation, instant)
        for b in range(length.size - 1):
            rotation = scale(1.0 / length[b], at(instant.solution, 2 * b + 1))
            put(state.x, b, add(at(state.x, b), at(instant.solution, 2 * b)))
            put(state.p, b, compose(from_increment(rotation), at(state.p, b)))
        evaluate.prepare(system, state, start)
    accelerations.project_velocities(system, state, start, monitor.violation, monitor.rate, instant)
