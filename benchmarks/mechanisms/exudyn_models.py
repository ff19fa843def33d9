"""Exudyn in three formulations: bodies with joints, bodies in a plane, and a kinematic tree.

Bodies have redundant coordinates, in space (Lie group nodes with rotation vector) or, if all joints
are hinges of one direction, in their plane. The tree has one coordinate for each hinge or slider,
two of them for a universal joint; loops are closed by joints between its links, and a body that it
reaches by ball joints only is one of its own. Redundant equations are omitted: Exudyn's solver
factors a matrix that they would make singular.
"""

import os
import time
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

# The build without range checks, which Exudyn recommends for speed; to be chosen before import.
os.environ.setdefault("EXUDYN_MODULE", "fast")

import exudyn as exu
from exudyn import itemInterface as items  # noqa: N813
from exudyn.rigidBodyUtilities import RigidBodyInertia

from benchmarks.mechanisms.layout import Gear, Hinge, Layout, Mass, layout
from benchmarks.motion import Motion
from msahl.model import Model

VERSION = exu.__version__
SPARSE_FROM = 10
"""Bodies from which the sparse solver is the faster one for Exudyn."""
LARGEST_TREE = 100
"""Bodies from which the tree, whose matrices are dense, is not measured (net: 0.2 s a step)."""
BODIES, PLANE, TREE = "bodies", "plane", "tree"


class _Variant(NamedTuple):
    form: str
    solver: Any
    order: int


_ALPHA, _INDEX_2 = exu.DynamicSolverType.GeneralizedAlpha, exu.DynamicSolverType.TrapezoidalIndex2
VARIANTS = {
    "exudyn bodies index 3": _Variant(BODIES, _ALPHA, 2),
    "exudyn bodies index 2": _Variant(BODIES, _INDEX_2, 2),
    "exudyn plane index 3": _Variant(PLANE, _ALPHA, 2),
    "exudyn plane index 2": _Variant(PLANE, _INDEX_2, 2),
    "exudyn tree index 2": _Variant(TREE, _INDEX_2, 2),
    "exudyn tree RK44": _Variant(TREE, exu.DynamicSolverType.RK44, 4),
    "exudyn tree RK67": _Variant(TREE, exu.DynamicSolverType.RK67, 6),
}
ORDERS = {code: variant.order for code, variant in VARIANTS.items()}
EXPLICIT = ("exudyn tree RK44", "exudyn tree RK67")
_COMMON = (
    "fast build, modified Newton with default tolerances, one thread, dense solver below "
    f"{SPARSE_FROM} bodies, then EigenSparse"
)
SETTINGS = {
    "exudyn bodies index 3": f"bodies in space, GeneralizedAlpha, spectral radius 0.9; {_COMMON}",
    "exudyn bodies index 2": "bodies in space, TrapezoidalIndex2",
    "exudyn plane index 3": "bodies in a plane, GeneralizedAlpha",
    "exudyn plane index 2": "bodies in a plane, TrapezoidalIndex2",
    "exudyn tree index 2": "kinematic tree, loops closed by joints, TrapezoidalIndex2",
    "exudyn tree RK44": "kinematic tree without loops, explicit Runge-Kutta of order 4",
    "exudyn tree RK67": "kinematic tree without loops, explicit Runge-Kutta of order 6",
}


def cannot(model: Model, variant: str) -> str:
    """Return why Exudyn cannot take the model in this form, empty if it can."""
    given, form = layout(model), VARIANTS[variant].form
    loops = bool(given.closing or given.gears)
    loops |= any(hinge.kind == "spherical" for hinge in given.tree)
    if form == TREE and len(given.masses) >= LARGEST_TREE:
        return "a step of so large a tree takes forty times that of the bodies in a plane"
    if given.gears and form != TREE:
        return "gears relate the coordinates of a tree"
    if form == PLANE and given.normal is None:
        return "not in a plane"
    if form == BODIES and given.normal is not None:
        return "hinges of one direction are redundant in space"
    return "explicit solvers take no loops" if variant in EXPLICIT and loops else ""


def motion(model: Model, h: float, steps: int, variant: str, every: int = 1) -> Motion:
    """Run ``steps`` steps; mass centres are stored ``every`` so many."""
    built = _FORMS[VARIANTS[variant].form](layout(model))
    mbs = built.mbs
    sensors = [built.sensor(body.name) for body in model.bodies]
    mbs.Assemble()
    seconds = _solve(mbs, len(model.bodies), h, steps, variant, every)
    tables = np.stack([mbs.GetSensorStoredData(sensor) for sensor in sensors], axis=1)
    if len(tables) != steps // every + 1 or not np.isfinite(tables).all():
        raise ArithmeticError("it did not reach the end")
    none = np.zeros(0)
    iterations = int(mbs.sys["dynamicSolver"].it.newtonStepsCount)
    x = built.in_space(tables[:, :, 1:4])
    return Motion(tables[:, 0, 0], x, none, none, none, seconds, steps, iterations)


def _solve(mbs: Any, bodies: int, h: float, steps: int, variant: str, every: int) -> float:
    settings = exu.SimulationSettings()
    settings.solution.file.write = False
    settings.solution.sensors.active = True
    settings.solution.sensors.writePeriod = h * every
    settings.timeIntegration.numberOfSteps = steps
    settings.timeIntegration.endTime = steps * h
    settings.timeIntegration.adaptiveStep = False
    settings.timeIntegration.verboseMode = 0
    if bodies >= SPARSE_FROM:
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
    chosen = VARIANTS[variant]
    if variant in EXPLICIT:
        settings.timeIntegration.automaticStepSize = False
        settings.timeIntegration.explicit.computeEndOfStepAccelerations = False
    began = time.perf_counter()
    if not mbs.SolveDynamic(settings, solverType=chosen.solver):
        raise ArithmeticError("its solver gave up")
    # The solver's timer reads the clock on the wall, this one perhaps the processor's.
    return min(float(mbs.sys["dynamicSolver"].timer.total), time.perf_counter() - began)


@dataclass
class _Built:
    """A system, and how points of its bodies are found: by (kind, object, link, local axes)."""

    mbs: Any
    given: Layout
    ground: int
    objects: dict[str, int] = field(default_factory=dict)  # bodies of their own
    links: dict[str, tuple[int, int, np.ndarray, np.ndarray]] = field(default_factory=dict)
    # in a tree: object, link, axes of the link and its origin at t = 0
    plane: np.ndarray | None = None  # (3, 3) rows: two axes in the plane, then zero

    def in_space(self, x: np.ndarray) -> np.ndarray:
        """Return inertial components of the mass centres ``x`` (rows, n, 3)."""
        if self.plane is None:
            return x
        start = np.array([mass.x for mass in self.given.masses.values()])
        out_of_plane = start - start @ self.plane.T @ self.plane
        return x @ self.plane + out_of_plane

    def marker(self, name: str, point: np.ndarray) -> int:
        """Return a marker at ``point`` of a body, or of the ground."""
        if name in self.links:
            tree, link, axes, origin = self.links[name]
            place = axes.T @ (point - origin)
            return self.mbs.AddMarker(items.MarkerKinematicTreeRigid(
                objectNumber=tree, linkNumber=link, localPosition=list(place)))  # fmt: skip
        local = self.given.local(name, point)
        if self.plane is not None and name:
            local = self.plane @ local
        elif self.plane is not None:
            local = self.plane @ point
        number = self.objects.get(name, self.ground)
        return self.mbs.AddMarker(
            items.MarkerBodyRigid(bodyNumber=number, localPosition=list(local))
        )

    def axes(self, name: str) -> np.ndarray:
        """Axes of the body's marker at t = 0 (as columns)."""
        return self.links[name][2] if name in self.links else np.eye(3)

    def sensor(self, name: str) -> int:
        """Return a sensor of the body's mass centre."""
        position = exu.OutputVariableType.Position
        if name in self.links:
            tree, link, axes, origin = self.links[name]
            place = axes.T @ (self.given.place(name) - origin)
            return self.mbs.AddSensor(items.SensorKinematicTree(
                objectNumber=tree, linkNumber=link, localPosition=list(place), storeInternal=True,
                writeToFile=False, outputVariableType=position))  # fmt: skip
        return self.mbs.AddSensor(items.SensorBody(
            bodyNumber=self.objects[name], storeInternal=True, writeToFile=False,
            outputVariableType=position))  # fmt: skip


def _empty(given: Layout) -> _Built:
    mbs = exu.SystemContainer().AddSystem()
    return _Built(mbs, given, mbs.AddObject(items.ObjectGround()))


def build_bodies(given: Layout) -> _Built:
    """Return a system of bodies in space with joints."""
    built = _empty(given)
    for mass in given.masses.values():
        built.objects[mass.name] = _add_body(built, mass)
    for hinge in given.tree:
        _add_joint(built, hinge)
    for hinge in given.closing:
        _add_joint(built, hinge, redundant=hinge.kind == "revolute")
    _add_loads(built)
    return built


def _add_body(built: _Built, mass: Mass) -> int:
    number: int = built.mbs.CreateRigidBody(
        referencePosition=list(mass.x),
        initialVelocity=list(mass.v),
        initialAngularVelocity=list(mass.w),
        inertia=RigidBodyInertia(mass.mass, mass.inertia),
        gravity=list(built.given.gravity),
        nodeType=exu.NodeType.RotationRotationVector,
    )
    return number


def _add_joint(built: _Built, hinge: Hinge, redundant: bool = False) -> None:
    """The joint with all its equations; without one of a hinge's rotations if ``redundant``."""
    names = hinge.inner, hinge.outer
    markers = [built.marker(name, hinge.point) for name in names]
    rotations = [built.axes(name).T @ _frame(hinge) for name in names]
    common = {"markerNumbers": markers}
    if hinge.kind == "spherical":
        built.mbs.AddObject(items.ObjectJointSpherical(**common))
        return
    common |= {"rotationMarker0": rotations[0], "rotationMarker1": rotations[1]}
    if hinge.kind == "revolute" and not redundant:
        built.mbs.AddObject(items.ObjectJointRevoluteZ(**common))
    else:
        axes = {
            "revolute": [1, 1, 1, 0, 1, 0],
            "prismatic": [1, 1, 0, 1, 1, 1],
            "universal": [1, 1, 1, 1, 0, 0],
        }[hinge.kind]
        built.mbs.AddObject(items.ObjectJointGeneric(constrainedAxes=axes, **common))


def _frame(hinge: Hinge) -> np.ndarray:
    """Columns x, y, z of a frame: z along the axis; of a universal joint, whose y of one side and z
    of the other stay at right angles, y along the axis and z along the second.
    """
    if hinge.kind == "universal":
        y, z = hinge.axes
    else:
        z = hinge.axis
        y = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
        y /= np.linalg.norm(y)
    return np.column_stack([np.cross(y, z), y, z])


def _add_loads(built: _Built) -> None:
    """Springs, moments on bodies, and the viscous friction of hinges outside a tree."""
    mbs, given = built.mbs, built.given
    for spring in given.springs:
        ends = zip(spring.pair, spring.points, strict=True)
        mbs.AddObject(items.ObjectConnectorSpringDamper(
            markerNumbers=[built.marker(*end) for end in ends], referenceLength=spring.free,
            stiffness=spring.stiffness, damping=spring.damping))  # fmt: skip
    for name, moment in given.moments.items():
        marker = built.marker(name, given.place(name))
        vector = moment if built.plane is None else [0.0, 0.0, given.normal @ moment]
        mbs.AddLoad(items.LoadTorqueVector(markerNumber=marker, loadVector=list(vector)))
    for hinge in given.tree:
        if hinge.damping and hinge.outer not in built.links:
            names = hinge.inner, hinge.outer
            mbs.AddObject(items.ObjectConnectorTorsionalSpringDamper(
                markerNumbers=[built.marker(name, hinge.point) for name in names],
                damping=hinge.damping, rotationMarker0=_frame(hinge),
                rotationMarker1=_frame(hinge)))  # fmt: skip


def _build_plane(given: Layout) -> _Built:
    """Bodies in the plane that the hinges are normal to; its axes come first."""
    built, normal = _empty(given), given.normal
    assert normal is not None
    first = np.eye(3)[int(np.argmin(np.abs(normal)))]
    built.plane = np.array([first, np.cross(normal, first), np.zeros(3)])
    e = built.plane
    for mass in given.masses.values():
        node = built.mbs.AddNode(items.NodeRigidBody2D(
            referenceCoordinates=[*(e @ mass.x)[:2], 0.0],
            initialVelocities=[*(e @ mass.v)[:2], float(normal @ mass.w)]))  # fmt: skip
        number = built.mbs.AddObject(items.ObjectRigidBody2D(
            physicsMass=mass.mass, physicsInertia=float(normal @ mass.inertia @ normal),
            nodeNumber=node))  # fmt: skip
        built.objects[mass.name] = number
        mass_marker = built.mbs.AddMarker(items.MarkerBodyMass(bodyNumber=number))
        built.mbs.AddLoad(
            items.LoadMassProportional(markerNumber=mass_marker, loadVector=list(e @ given.gravity))
        )
    for hinge in (*given.tree, *given.closing):
        markers = [built.marker(name, hinge.point) for name in (hinge.inner, hinge.outer)]
        built.mbs.AddObject(items.ObjectJointRevolute2D(markerNumbers=markers))
    _add_loads(built)
    return built


def _build_tree(given: Layout) -> _Built:
    built = _empty(given)
    _add_tree(built)
    for mass in given.masses.values():
        if mass.name not in built.links:
            built.objects[mass.name] = _add_body(built, mass)
    for hinge in (*(h for h in given.tree if h.kind == "spherical"), *given.closing):
        if given.normal is not None:
            _close_in_plane(built, hinge)
        else:
            _add_joint(built, hinge, redundant=hinge.kind == "revolute")
    _add_loads(built)
    return built


def _close_in_plane(built: _Built, hinge: Hinge) -> None:
    """The two equations of a hinge that others do not imply."""
    names = hinge.inner, hinge.outer
    markers = [built.marker(name, hinge.point) for name in names]
    rotations = [built.axes(name).T @ _frame(hinge) for name in names]
    built.mbs.AddObject(items.ObjectJointGeneric(
        markerNumbers=markers, constrainedAxes=[1, 1, 0, 0, 0, 0], rotationMarker0=rotations[0],
        rotationMarker1=rotations[1]))  # fmt: skip


@dataclass
class _Links:
    """Lists as a kinematic tree has them, one entry for each coordinate."""

    names: dict[str, int] = field(default_factory=dict)  # of the joints: their first coordinate
    last: dict[str, int] = field(default_factory=lambda: {"": -1})  # link of each body
    frames: list[tuple[np.ndarray, np.ndarray]] = field(default_factory=list)
    columns: dict[str, list[Any]] = field(default_factory=dict)

    def add(self, **values: Any) -> None:
        for name, value in values.items():
            self.columns.setdefault(name, []).append(value)


def _add_tree(built: _Built) -> None:
    """Links of all hinges, sliders and universal joints that are reached by such joints."""
    given, links = built.given, _Links()
    rates: list[float] = []
    for hinge in given.tree:
        if hinge.kind != "spherical" and hinge.inner in links.last:
            _add_links(given, links, hinge)
            rates += given.rates(hinge).tolist()
    n, lists = len(rates), links.columns
    node = built.mbs.AddNode(items.NodeGenericODE2(
        referenceCoordinates=[0.0] * n, initialCoordinates=[0.0] * n,
        initialCoordinates_t=rates, numberOfODE2Coordinates=n))  # fmt: skip
    number = built.mbs.AddObject(items.ObjectKinematicTree(
        nodeNumber=node, gravity=list(given.gravity), jointTypes=lists["type"],
        linkParents=lists["parent"], jointTransformations=exu.Matrix3DList(lists["rotation"]),
        jointOffsets=exu.Vector3DList(lists["offset"]),
        linkInertiasCOM=exu.Matrix3DList(lists["inertia"]),
        linkCOMs=exu.Vector3DList(lists["centre"]), linkMasses=lists["mass"],
        jointPControlVector=[0.0] * n,
        jointDControlVector=lists["damping"], jointPositionOffsetVector=[0.0] * n,
        jointVelocityOffsetVector=[0.0] * n))  # fmt: skip
    for name, link in links.last.items():
        if name:
            built.links[name] = (number, link, *links.frames[link])
    for gear in given.gears:
        _add_gear(built, node, links, gear)


def _add_links(given: Layout, links: _Links, hinge: Hinge) -> None:
    """One link for each axis; the last one is the body, others have no mass."""
    prismatic = hinge.kind == "prismatic"
    parent = links.last[hinge.inner]
    links.names[hinge.name] = len(links.frames)
    for number, axis in enumerate(hinge.axes):
        axes, origin = links.frames[parent] if parent >= 0 else (np.eye(3), np.zeros(3))
        own = _along(axis)
        last = number == len(hinge.axes) - 1
        mass = given.masses[hinge.outer]
        links.frames.append((own, hinge.point))
        links.add(
            type=exu.JointType.PrismaticZ if prismatic else exu.JointType.RevoluteZ,
            parent=parent,
            rotation=axes.T @ own,
            offset=axes.T @ (hinge.point - origin),
            inertia=own.T @ mass.inertia @ own if last else np.zeros((3, 3)),
            centre=own.T @ (mass.x - hinge.point) if last else np.zeros(3),
            mass=mass.mass if last else 0.0,
            damping=hinge.damping,
        )
        parent = len(links.frames) - 1
    links.last[hinge.outer] = parent


def _along(axis: np.ndarray) -> np.ndarray:
    """Columns of a frame whose z is ``axis``."""
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(axis)))], axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def _add_gear(built: _Built, node: int, links: _Links, gear: Gear) -> None:
    markers = [
        built.mbs.AddMarker(items.MarkerNodeCoordinate(
            nodeNumber=node, coordinate=links.names[name]))
        for name in (gear.second, gear.first)
    ]  # fmt: skip
    built.mbs.AddObject(items.ObjectConnectorCoordinate(
        markerNumbers=markers, factorValue1=gear.ratio))  # fmt: skip


_FORMS = {BODIES: build_bodies, PLANE: _build_plane, TREE: _build_tree}
