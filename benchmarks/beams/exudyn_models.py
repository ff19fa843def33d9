"""Beams by Exudyn: geometrically exact ones of two nodes, and cables of ANCF in the plane."""

import itertools
import math
import os
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np

# The build without range checks, which Exudyn recommends for speed; to be chosen before import.
os.environ.setdefault("EXUDYN_MODULE", "fast")

import exudyn as exu
import exudyn.itemInterface
from exudyn.rigidBodyUtilities import (
    RotationMatrix2EulerParameters,
    RotationMatrix2RotationVector,
    RotationMatrix2RotXYZ,
)

from benchmarks.beams.problems import (
    ALONG,
    ANGLE,
    FORCE,
    GRAVITY,
    HANGING,
    RADIUS,
    ROPE,
    SPAN,
    START,
    THROW,
    TWIST,
    Problem,
    Section,
    first_guess,
    load_factor,
)
from benchmarks.beams.setting import FailedRunError, Outcome, Setting

NAME = "Exudyn"
VERSION = exu.__version__
SPARSE_FROM = 16
"""Elements from which the sparse solver is the faster one (measured: 8 no, 16 yes)."""
NODES: dict[str, tuple[Any, Callable[[np.ndarray], Any]]] = {
    "Euler parameters": (exu.itemInterface.NodeRigidBodyEP, RotationMatrix2EulerParameters),
    "Tait-Bryan angles": (exu.itemInterface.NodeRigidBodyRxyz, RotationMatrix2RotXYZ),
    "rotation vector": (exu.itemInterface.NodeRigidBodyRotVecLG, RotationMatrix2RotationVector),
}
ELEMENTS = {
    "bend": (4, 6, 8, 12, 16, 24, 32, 48, 64, 128, 256),
    "rod": (16, 24, 32, 48, 64, 96),
    "hanging": (2, 4, 8, 16, 32),
    "swinging": (2, 4, 6, 8, 12, 16, 24, 32),
}
PARTS = {
    "rod": (6, 8, 10, 14, 20, 28, 40, 80),
    "swinging": (4, 6, 8, 12, 16, 24, 32, 48, 64, 128, 256),
}
"""Steps in an interval of output times."""


class _Variant(NamedTuple):
    build: Callable[..., Any]
    node: str  # of geometrically exact beams
    solver: Any = None  # None: static
    radius: float = 1.0  # spectral radius of GeneralizedAlpha
    tolerance: float = 1e-8
    load_steps: int = 1
    integration: int = 0  # of cables: order of quadrature


def settings(problem: Problem) -> Iterator[Setting]:
    """Yield all runs that are tried, coarse ones first."""
    for family in VARIANTS[problem.name]:
        for elements in ELEMENTS[problem.name]:
            if not problem.end:
                yield Setting(family, elements)
                continue
            for part in PARTS[problem.name]:
                yield Setting(family, elements, problem.interval / part)


def solve(problem: Problem, setting: Setting) -> Outcome:
    """Make one run."""
    return run(problem, VARIANTS[problem.name][setting.family], setting.elements, setting.step)


def run(problem: Problem, variant: _Variant, elements: int, step: float | None) -> Outcome:
    """Build the model and let the solver of the variant run."""
    began = time.process_time()
    mbs, sensors = variant.build(problem, variant, elements)
    mbs.Assemble()
    settings = _settings(problem, variant, elements, step)
    built = time.process_time()
    try:
        # Exudyn's own timer counts seconds of the wall.
        if variant.solver is None:
            mbs.SolveStatic(settings)
        else:
            mbs.SolveDynamic(settings, solverType=variant.solver)
    except Exception as failure:  # Exudyn raises SystemError, ValueError and others
        raise FailedRunError(str(failure).strip().split("\n")[0][:80]) from failure
    ended = time.process_time()
    stored = [np.atleast_2d(mbs.GetSensorStoredData(s))[:, 1:] for s in sensors]
    points = np.stack(stored, axis=1)[-problem.outputs - 1 :]
    if problem.section is ROPE:  # in the plane of x and y
        points = points[..., [0, 2, 1]]
    if len(points) != problem.outputs + 1:
        raise FailedRunError("it did not reach the end")
    name = "staticSolver" if variant.solver is None else "dynamicSolver"
    iterations = int(mbs.sys[name].it.newtonStepsCount)
    return Outcome(points, ended - built, built - began, iterations)


def _settings(problem: Problem, variant: _Variant, elements: int, step: float | None) -> Any:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    if elements >= SPARSE_FROM:
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    static, motion = settings.staticSolver, settings.timeIntegration
    if step is None:
        static.verboseMode = 0
        static.numberOfLoadSteps = variant.load_steps
        static.newton.relativeTolerance = variant.tolerance
        return settings
    settings.solution.sensors.writePeriod = problem.interval
    motion.numberOfSteps = round(problem.end / step)
    motion.endTime = problem.end
    motion.adaptiveStep = False
    motion.generalizedAlpha.spectralRadius = variant.radius
    motion.newton.relativeTolerance = variant.tolerance
    return settings


def build_bend(problem: Problem, variant: _Variant, elements: int) -> tuple[Any, list[int]]:
    angles = np.linspace(0.0, ANGLE, elements + 1)
    points = RADIUS * np.stack([np.sin(angles), 1.0 - np.cos(angles), 0.0 * angles], axis=-1)
    axes = [_about_z(angle) for angle in angles]
    mbs, nodes = _beam(problem, variant.node, points, axes)
    ground = mbs.AddMarker(
        exu.itemInterface.MarkerBodyRigid(
            bodyNumber=mbs.AddObject(exu.itemInterface.ObjectGround())
        )
    )
    first = mbs.AddMarker(exu.itemInterface.MarkerNodeRigid(nodeNumber=nodes[0]))
    mbs.AddObject(
        exu.itemInterface.GenericJoint(markerNumbers=[ground, first], constrainedAxes=[1] * 6)
    )
    last = mbs.AddMarker(exu.itemInterface.MarkerNodeRigid(nodeNumber=nodes[-1]))
    mbs.AddLoad(exu.itemInterface.Force(markerNumber=last, loadVector=[0.0, 0.0, FORCE]))
    return mbs, [_sensor(mbs, nodes[-1])]


def build_rod(problem: Problem, variant: _Variant, elements: int) -> tuple[Any, list[int]]:
    shares = np.linspace(0.0, 1.0, elements + 1)
    across = np.array([-ALONG[1], ALONG[0], 0.0])
    axes = np.stack([ALONG, across, np.cross(ALONG, across)], axis=-1)
    points = START + problem.length * shares[:, None] * ALONG
    mbs, nodes = _beam(problem, variant.node, points, [axes] * (elements + 1))
    first = mbs.AddMarker(exu.itemInterface.MarkerNodeRigid(nodeNumber=nodes[0]))

    def grown(mbs: Any, t: float, load: Any) -> list[float]:
        factor = load_factor(t)
        return [factor * load[0], factor * load[1], factor * load[2]]

    for load, vector in ((exu.itemInterface.Force, THROW), (exu.itemInterface.Torque, TWIST)):
        mbs.AddLoad(load(markerNumber=first, loadVector=list(vector), loadVectorUserFunction=grown))
    return mbs, [_sensor(mbs, nodes[0]), _sensor(mbs, nodes[-1])]


def build_cable(problem: Problem, variant: _Variant, elements: int) -> tuple[Any, list[int]]:
    """Cables of ANCF: nodes with a position and a slope vector in the plane."""
    mbs = exu.SystemContainer().AddSystem()
    shares = np.linspace(0.0, 1.0, elements + 1)
    start = [np.zeros(4)] * (elements + 1)
    if problem is HANGING:
        (points, slopes), rest = first_guess(shares), problem.length * shares
        start = [
            np.array([x - s, z, math.cos(a) - 1.0, math.sin(a)])
            for (x, z), a, s in zip(points, slopes, rest, strict=True)
        ]
    nodes = [
        mbs.AddNode(
            exu.itemInterface.NodePoint2DSlope1(
                referenceCoordinates=[problem.length * s, 0.0, 1.0, 0.0],
                initialCoordinates=list(first),
            )
        )
        for s, first in zip(shares, start, strict=True)
    ]
    for pair in itertools.pairwise(nodes):
        cable = mbs.AddObject(
            exu.itemInterface.ObjectANCFCable2D(
                nodeNumbers=list(pair),
                length=problem.length / elements,
                massPerLength=problem.section.mass,
                axialStiffness=problem.section.stretch,
                bendingStiffness=problem.section.bending,
                useReducedOrderIntegration=variant.integration,
            )
        )
        mass = mbs.AddMarker(exu.itemInterface.MarkerBodyMass(bodyNumber=cable))
        mbs.AddLoad(exu.itemInterface.Gravity(markerNumber=mass, loadVector=[0.0, -GRAVITY, 0.0]))
    _hold(mbs, nodes[0], 0.0)
    if problem is HANGING:
        _hold(mbs, nodes[-1], SPAN - problem.length)
    return mbs, [_sensor(mbs, nodes[round(share * elements)]) for share in problem.points]


def _hold(mbs: Any, node: int, x: float) -> None:
    """Hold a node of a cable at a displacement along x."""
    ground = mbs.AddNode(exu.itemInterface.NodePointGround())
    fixed = mbs.AddMarker(exu.itemInterface.MarkerNodeCoordinate(nodeNumber=ground, coordinate=0))
    for coordinate, offset in enumerate((x, 0.0)):
        own = mbs.AddMarker(
            exu.itemInterface.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate)
        )
        mbs.AddObject(
            exu.itemInterface.CoordinateConstraint(markerNumbers=[fixed, own], offset=offset)
        )


def _beam(
    problem: Problem, node: str, points: np.ndarray, axes: list[np.ndarray]
) -> tuple[Any, list[int]]:
    mbs = exu.SystemContainer().AddSystem()
    kind, coordinates = NODES[node]
    nodes = [
        mbs.AddNode(kind(referenceCoordinates=[*x, *coordinates(R)]))
        for x, R in zip(points, axes, strict=True)
    ]
    section = _section(problem.section)
    length = problem.length / (len(points) - 1)
    for pair in itertools.pairwise(nodes):
        mbs.AddObject(
            exu.itemInterface.ObjectBeamGeometricallyExact(
                nodeNumbers=list(pair), length=length, sectionData=section
            )
        )
    return mbs, nodes


def _section(given: Section) -> Any:
    section = exu.BeamSection()
    section.massPerLength = given.mass
    section.inertia = np.diag(given.inertia).tolist()
    forces, moments = [given.stretch, given.shear, given.shear], [given.torsion, given.bending]
    section.stiffnessMatrix = np.diag([*forces, *moments, given.bending]).tolist()
    return section


def _sensor(mbs: Any, node: int) -> int:
    return mbs.AddSensor(
        exu.itemInterface.SensorNode(
            nodeNumber=node, storeInternal=True, outputVariableType=exu.OutputVariableType.Position
        )
    )


def _about_z(angle: float) -> np.ndarray:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _variants() -> dict[str, dict[str, _Variant]]:
    """The settings that were the best of those tried, by problem and family. Explicit solvers
    (RK44, RK67), modified Newton for bodies at rest, and other tolerances took longer or failed.
    """
    bend = {
        f"{node}, {steps} load steps": _Variant(build_bend, node, None, 1.0, 1e-5, steps)
        for node in ("Euler parameters", "Tait-Bryan angles")
        for steps in (1, 2, 4)
    }
    alpha, index2 = exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2
    rod = {
        "generalised alpha, Tait-Bryan angles": _Variant(
            build_rod, "Tait-Bryan angles", alpha, 0.9, 1e-4
        ),
        "generalised alpha, rotation vector": _Variant(
            build_rod, "rotation vector", alpha, 0.9, 1e-4
        ),
    }
    hanging = {
        f"ANCF, quadrature {k}": _Variant(build_cable, "", None, integration=k) for k in (0, 2)
    }
    swinging = {
        "ANCF, generalised alpha": _Variant(build_cable, "", alpha, 0.9, 1e-4, integration=2),
        "ANCF, trapezoidal": _Variant(build_cable, "", index2, 1.0, 1e-4, integration=2),
        "ANCF, quadrature 0, trapezoidal": _Variant(build_cable, "", index2, 1.0, 1e-4),
    }
    return {"bend": bend, "rod": rod, "hanging": hanging, "swinging": swinging}


VARIANTS = _variants()
