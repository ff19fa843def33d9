"""Exudyn: bodies in space with its contact objects, spheres against triangles or each other.

A contact is a spring that is so stiff that half a period of a body on it lasts a given number of
steps. With a coefficient of restitution it has the program's impact model 2, which is made for
every coefficient but zero; without one, a linear damper of critical damping. Corners are points on
a sphere of a million metres: a sphere of no extent would pass through a triangle.
"""

import math
import os
import time
from typing import Any, NamedTuple

import numpy as np

# The build without range checks, which Exudyn recommends for speed; to be chosen before import.
os.environ.setdefault("EXUDYN_MODULE", "fast")

import exudyn as exu
from exudyn import itemInterface as items  # noqa: N813

from benchmarks.contact.layout import Ball, Pair, Plane, damping_ratio, pairs
from benchmarks.mechanisms.exudyn_models import build_bodies
from benchmarks.mechanisms.layout import layout
from benchmarks.motion import Motion
from msahl.model import Model

VERSION = exu.__version__


class _Variant(NamedTuple):
    solver: Any
    steps: float  # that a contact lasts
    zone: float  # slip up to which friction is proportional to it [m/s]; in ``_zone``'s unit if < 0
    adaptive: bool = False


_ALPHA, _INDEX_2 = exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2
_RK44, _VERLET = exu.DynamicSolverType.RK44, exu.DynamicSolverType.VelocityVerlet
BY_STEP = -4.0
"""A zone that goes with the step, see ``_zone``: explicit solvers are stable with it."""
VARIANTS = {
    "exudyn index 3, 10": _Variant(_ALPHA, 10, 1e-3),
    "exudyn index 3, 10, adaptive": _Variant(_ALPHA, 10, 1e-3, adaptive=True),
    "exudyn index 3, 40, adaptive": _Variant(_ALPHA, 40, 1e-3, adaptive=True),
    "exudyn index 3, 40, 10 µm/s": _Variant(_ALPHA, 40, 1e-5, adaptive=True),
    "exudyn index 2, 10": _Variant(_INDEX_2, 10, 1e-3),
    "exudyn index 2, 40, adaptive": _Variant(_INDEX_2, 40, 1e-3, adaptive=True),
    "exudyn RK44, 10": _Variant(_RK44, 10, BY_STEP),
    "exudyn RK44, 40": _Variant(_RK44, 40, BY_STEP),
    "exudyn RK44, 40, 1 cm/s": _Variant(_RK44, 40, 1e-2),
    "exudyn Verlet, 40": _Variant(_VERLET, 40, BY_STEP),
}
ORDERS = dict.fromkeys(VARIANTS, 1)
_EXPLICIT = (_RK44, _VERLET)
_NAMES = {
    _ALPHA: "GeneralizedAlpha, spectral radius 0.9",
    _INDEX_2: "TrapezoidalIndex2",
    _RK44: "explicit Runge-Kutta of order 4",
    _VERLET: "VelocityVerlet, explicit",
}
_ADAPTIVE = (
    "; full Newton, tolerances 1e-7, adaptive steps down to 1/16 and those that contacts recommend"
)
SETTINGS = {
    code: f"{_NAMES[v.solver]}; contacts last {v.steps:g} steps, friction is proportional to slip "
    + (f"up to {v.zone:g} m/s" if v.zone > 0.0 else "as far as explicit steps need it")
    + (_ADAPTIVE if v.adaptive else "")
    for code, v in VARIANTS.items()
}
TOLERANCE = 1e-7
SEVERAL = 4
"""Contacts with friction from which steps are not adaptive."""
PARTS = 16
"""Smallest step of adaptive ones: the given one over this."""
EARTH = 1e6
"""Radius of the sphere that is the ground of corners [m]."""
POINT = 1e-9
"""Radius of a corner [m]: zero is refused."""
TRIANGLE = 100.0
"""Distance of the corners of the triangle that is a floor from its middle [m]."""
LEAST_FRICTION = 1e-3
"""Coefficient of friction that the proportional zone of a smooth contact is made for."""


def cannot(model: Model, variant: str) -> str:
    """Return why Exudyn cannot take the model by this solver, empty if it can."""
    chosen, rough = VARIANTS[variant], [pair for pair in pairs(model) if pair.friction]
    if model.joints and chosen.solver in _EXPLICIT:
        return "explicit solvers take no joints between bodies"
    if chosen.adaptive and len(rough) >= SEVERAL:
        return "adaptive steps become ever smaller where several contacts stick: 217 s for one run"
    if chosen.adaptive and any(pair.restitution for pair in pairs(model)):
        return "adaptive steps give up at a rebound or become ever smaller"
    return ""


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    """Run ``steps`` steps; mass centres are stored ``every`` so many."""
    built, chosen = build_bodies(layout(model)), VARIANTS[variant]
    for pair in pairs(model):
        _add_pair(built, pair, chosen, h)
    mbs = built.mbs
    sensors = [built.sensor(body.name) for body in model.bodies]
    mbs.Assemble()
    seconds = _solve(mbs, h, steps, chosen, every)
    tables = np.stack([mbs.GetSensorStoredData(sensor) for sensor in sensors], axis=1)
    if len(tables) != steps // every + 1 or not np.isfinite(tables).all():
        raise ArithmeticError("it did not reach the end")
    none = np.zeros(0)
    iterations = int(mbs.sys["dynamicSolver"].it.newtonStepsCount)
    return Motion(tables[:, 0, 0], tables[:, :, 1:4], none, none, none, seconds, steps, iterations)


def _solve(mbs: Any, h: float, steps: int, chosen: _Variant, every: int) -> float:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.active = True
    settings.solution.sensors.writePeriod = h * every
    of_time = settings.timeIntegration
    of_time.numberOfSteps, of_time.endTime, of_time.verboseMode = steps, steps * h, 0
    of_time.minimumStepSize = h / PARTS
    of_time.adaptiveStep = of_time.discontinuous.useRecommendedStepSize = chosen.adaptive
    if chosen.adaptive:
        of_time.newton.useModifiedNewton = False
        of_time.newton.relativeTolerance = of_time.newton.absoluteTolerance = TOLERANCE
    if chosen.solver in _EXPLICIT:
        of_time.automaticStepSize = False
        of_time.explicit.computeEndOfStepAccelerations = False
    began = time.perf_counter()
    if not mbs.SolveDynamic(settings, solverType=chosen.solver, showHints=False):
        raise ArithmeticError("its solver gave up")
    # The solver's timer reads the clock on the wall, this one perhaps the processor's.
    return min(float(mbs.sys["dynamicSolver"].timer.total), time.perf_counter() - began)


def _zone(built: Any, pair: Pair, chosen: _Variant, h: float) -> float:
    """Return the slip [m/s] up to which friction is proportional to it. Where it goes with the
    step, this damper, pressed by the body's weight, slows the point of contact in so many steps.
    """
    if chosen.zone > 0.0:
        return chosen.zone
    weight = built.given.masses[pair.ball.body].mass * np.linalg.norm(built.given.gravity)
    return float(-chosen.zone * h * max(pair.friction, LEAST_FRICTION) * weight / pair.mass)


def _add_pair(built: Any, pair: Pair, chosen: _Variant, h: float) -> None:
    ratio, elastic = damping_ratio(pair.restitution), pair.restitution > 0.0
    frequency = math.pi / (chosen.steps * h)
    if elastic:
        frequency /= math.sqrt(1.0 - ratio * ratio)
    node = items.NodeGenericData(initialCoordinates=[0.1, 0, 0, 0], numberOfDataCoordinates=4)
    law = {
        "nodeNumber": built.mbs.AddNode(node),
        "dynamicFriction": pair.friction,
        "frictionProportionalZone": _zone(built, pair, chosen, h),
        "contactStiffness": pair.mass * frequency**2,
        "contactDamping": 0.0 if elastic else 2.0 * frequency * pair.mass,
        "restitutionCoefficient": pair.restitution if elastic else 1.0,
        "impactModel": 2 if elastic else 0,
    }
    ball = _marker(built, pair.ball)
    if isinstance(pair.other, Ball):
        _add_spheres(built.mbs, (ball, _marker(built, pair.other)),
                     (pair.ball.radius, pair.other.radius), law)  # fmt: skip
    elif pair.ball.radius > 0.0:
        floor = built.marker("", pair.other.point)
        built.mbs.AddObject(
            items.ObjectContactSphereTriangle(
                markerNumbers=[ball, floor],
                sphereRadius=pair.ball.radius,
                trianglePoints=exu.Vector3DList(_triangle(pair.other)),
                includeEdges=0,
                **law,
            )
        )
    else:
        middle = built.marker("", pair.other.point - EARTH * pair.other.normal)
        _add_spheres(built.mbs, (ball, middle), (POINT, EARTH), law)


def _add_spheres(
    mbs: Any, markers: tuple[int, int], radii: tuple[float, float], law: dict[str, Any]
) -> None:
    mbs.AddObject(
        items.ObjectContactSphereSphere(markerNumbers=[*markers], spheresRadii=[*radii], **law)
    )


def _marker(built: Any, ball: Ball) -> int:
    number: int = built.marker(ball.body, built.given.place(ball.body) + ball.point)
    return number


def _triangle(plane: Plane) -> list[np.ndarray]:
    """Return the corners of a triangle whose front is on the side of the normal."""
    n = plane.normal
    u = np.cross(n, np.eye(3)[int(np.argmin(np.abs(n)))])
    u /= np.linalg.norm(u)
    v = np.cross(n, u)
    angles = [2.0 * math.pi * k / 3.0 for k in range(3)]
    return [TRIANGLE * (u * math.cos(a) + v * math.sin(a)) for a in angles]
