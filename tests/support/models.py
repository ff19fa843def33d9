"""Models built in Python, and runs of them kept in memory."""

from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from msahl.algebra.rotation import compose, from_axis_angle, matrix
from msahl.algebra.vector import ZERO, add, sub, times
from msahl.deck import read_deck
from msahl.model import (
    ConcentratedLoad,
    Ground,
    Joint,
    JointLoad,
    Model,
    Options,
    PointLoad,
    RigidBody,
    Simulation,
    resolve,
)
from msahl.model.scheme import split
from msahl.model.settings import OFF
from msahl.run.loop import Hooks, run
from msahl.run.report import Report
from msahl.run.tables import ERROR, REACTIONS, SIGNALS, STATES, TABLES, WORK, MemorySink
from msahl.system.names import reaction_columns, signal_columns, work_columns

ROOT = Path(__file__).parents[2]
THESIS = sorted((ROOT / "decks" / "thesis").glob("*.xml"))
ELASTIC = sorted((ROOT / "decks" / "elastic").glob("*.xml"))
"""Decks of beams, too large for tests that run every deck in many ways."""
DECKS = sorted(path for path in (ROOT / "decks").glob("*/*.xml") if path not in ELASTIC)
GROUND = Ground("Earth")
DOWN = (0.0, 0.0, 9.80665)
"""Gravity along +z, as in the thesis's pendulums."""


def friction(name, joint, coordinate, coefficient, radius, width):
    """Coulomb friction; the radius along a slide is 1."""
    numbers = (("coefficient", coefficient), ("radius", radius), ("width", width))
    return JointLoad(name, "friction", joint, coordinate, numbers)


def drag(name, body, point, coefficient):
    """A quadratic drag."""
    return PointLoad(name, "drag", body, point, (("coefficient", coefficient),))


def deck(name):
    """The model of the deck with this stem."""
    (path,) = [path for path in [*DECKS, *ELASTIC] if path.stem == name]
    return read_deck(path)


@dataclass
class Result:
    """A run: its report and all its rows, the time in the first column."""

    model: Model
    report: Report
    states: np.ndarray
    reactions: np.ndarray
    work: np.ndarray
    signals: np.ndarray
    errors: np.ndarray
    others: dict[str, np.ndarray]

    @property
    def time(self):
        return self.states[:, 0]

    def of(self, what, body=-1):
        """(rows, 3) position, orientation, velocity or spin of a body, by its place in the deck."""
        first = {"position": 0, "orientation": 3, "velocity": 6, "spin": 9}[what]
        bodies = self.states[:, 1:].reshape(len(self.states), len(self.model.bodies), 12)
        return bodies[:, body, first : first + 3]

    def matrices(self, body=-1):
        """(rows, 3, 3) body axes to inertial ones."""
        return np.array([matrix(tuple(p)) for p in self.of("orientation", body)])

    def column(self, name):
        """(rows,) a reaction, load, power, work or energy by its name in the tables."""
        for columns, table in (
            (reaction_columns, self.reactions),
            (work_columns, self.work),
            (signal_columns, self.signals),
        ):
            if name in columns(self.model):
                return table[:, columns(self.model).index(name)]
        raise KeyError(name)

    def reaction(self, joint, letter):
        """(rows, 3) force or moment of the parent on the child; ``letter`` is F or M."""
        name = self.model.joints[joint].name
        return np.stack([self.column(f"{name}.{letter}{axis}") for axis in "xyz"], axis=1)

    def force(self, joint=0):
        """(rows, 3) of the parent on the child."""
        return self.reaction(joint, "F")

    def moment(self, joint=0):
        """(rows, 3) of the parent on the child about the joint's point."""
        return self.reaction(joint, "M")


def run_in_memory(model, options, since=None, checked=False, **hooks):
    """Report and sink of a run; ``hooks`` as in ``Hooks``."""
    sink = MemorySink()
    return run(model, options, sink, Hooks(**hooks), since, checked), sink


def simulate(model, dt=None, t_final=None, scheme=None, damping=None, *, checked=False, **options):
    """Run ``model`` with the user's defaults, but for what is given; ``scheme`` is a choice.

    A model that counts as ``checked`` is run in spite of its faults. Steps that are given are taken
    without a second run that estimates the error, unless ``error`` asks for it.
    """
    name, degree = split(scheme) if scheme else (None, None)
    given = {"dt": dt, "t_final": t_final, "scheme": name, "degree": degree, "damping": damping}
    changes = {name: value for name, value in given.items() if value is not None}
    model = replace(model, simulation=replace(model.simulation, **changes))
    if not resolve(model.simulation).adaptive:
        options = {"error": OFF} | options
    report, sink = run_in_memory(model, Options(**options), checked=checked)
    tables = {name: sink.table(name) for name in TABLES}
    own = [tables.pop(name) for name in (STATES, REACTIONS, WORK, SIGNALS, ERROR)]
    return Result(model, report, *own, tables)


simulate_and_estimate = partial(simulate, error=None)
"""Run a model and estimate its error, as the user's defaults do."""


def build_model(
    bodies, joints=(), loads=(), gravity=ZERO, dt=0.01, t_final=1.0, grounds=(GROUND,), **others
):
    """A model of these records."""
    given = (tuple(records) for records in (grounds, bodies, joints, loads))
    return Model(gravity, *given, Simulation("", dt, t_final), **others)


def tensor(array):
    """A 3 x 3 array as a matrix of the deck's kind."""
    return tuple(tuple(float(x) for x in row) for row in array)


def body(name="Bob", mass=2.0, inertia=0.008, position=ZERO, **others):
    """A body; ``inertia`` may be a number, three, or a tensor."""
    if np.ndim(inertia) < 2:
        inertia = np.diag(np.broadcast_to(inertia, 3))
    start = {"r_BG": ZERO, "orientation": ZERO, "velocity": ZERO, "angular_velocity": ZERO}
    return RigidBody(
        name=name, mass=mass, inertia=tensor(inertia), position=position, **(start | others)
    )


def pendulum(degrees=45.0, axis=(0.0, 1.0, 0.0), arm=(0.0, 0.0, 5.0), **others):
    """The thesis's single pendulum, rotated about ``axis``, with the bob at ``arm``."""
    rotation = from_axis_angle(axis, np.radians(degrees))
    bob = body(position=times(matrix(rotation), arm), orientation=rotation)
    joint = Joint("Pivot", "spherical", GROUND.name, bob.name, ZERO, sub(ZERO, arm))
    return build_model([bob], [joint], gravity=DOWN, **others)


def frame(edges, pins, **others):
    """Links of 1 kg along ``edges`` (pairs of points), pinned by ``(i, j, point)``.

    i or j is the place of a link, or None for the ground. A link's axes are the inertial ones.
    """
    bodies = []
    for k, (a, b) in enumerate(edges):
        along = np.subtract(b, a)
        square = along @ along
        # A thin rod, and as much again in all directions so that no axis is without inertia.
        J = (square * np.eye(3) - np.outer(along, along)) / 12.0 + 0.05 * square * np.eye(3)
        middle = tuple(float(x) for x in 0.5 * np.add(a, b))
        bodies.append(body(f"Link{k}", mass=1.0, inertia=J, position=middle))
    joints = []
    for k, (i, j, point) in enumerate(pins):
        ends = [GROUND.name if e is None else bodies[e].name for e in (i, j)]
        origins = [ZERO if e is None else bodies[e].position for e in (i, j)]
        place = tuple(float(x) for x in point)
        joints.append(Joint(f"Pin{k}", "spherical", *ends, *(sub(place, o) for o in origins)))
    return build_model(bodies, joints, gravity=DOWN, **others)


def path(points, grounded=(), closed=False, **others):
    """Links from point to point; the ground holds the start of those links in ``grounded``."""
    points = [tuple(map(float, p)) for p in points]
    ends = [*points[1:], points[0]] if closed else points[1:]
    edges = list(zip(points, ends, strict=False))
    n = len(edges)
    pins = [(k, k + 1, points[k + 1]) for k in range(n - 1)]
    pins += [(n - 1, 0, points[0])] if closed else []
    pins += [(None, k, points[k]) for k in grounded]
    return frame(edges, pins, **others)


def chain(n, hung_by=0, **others):
    """``n`` links at 45 degrees, hung by the start of one of them."""
    return path([(0.7 * k, 0.0, 0.7 * k) for k in range(n + 1)], (hung_by,), **others)


def star(rays, links=1):
    """Chains of ``links`` from a hub on the ground, in all directions."""
    edges, pins = [((0.0, 0.0, -1.0), ZERO)], [(None, 0, (0.0, 0.0, -1.0))]
    for angle in 2 * np.pi * np.arange(rays) / rays:
        step = (np.cos(angle), np.sin(angle), 0.3)
        before, point = 0, ZERO
        for _ in range(links):
            end = add(point, step)
            pins.append((before, len(edges), point))
            before = len(edges)
            edges.append((point, end))
            point = end
    return frame(edges, pins)


def ring(n, grounded=()):
    """A closed, uneven polygon of ``n`` links, held by the ground in places (free if in none)."""
    angle = 2 * np.pi * np.arange(n) / n
    wave = np.stack([np.cos(angle), 0.3 * np.sin(3 * angle), np.sin(angle)], axis=1)
    return path((n * wave).tolist(), grounded, closed=True)


def ladder(n):
    """Two chains joined by ``n`` rungs: ``n - 1`` loops in a row."""
    left = [(0.0, 0.1 * k * k, float(k)) for k in range(n)]
    right = [(1.0 + 0.1 * k, 0.1 * k * k, float(k)) for k in range(n)]
    edges = list(zip(left, right, strict=True))
    pins = [(None, 0, left[0])]
    for points in (left, right):
        for k in range(n - 1):
            rail = len(edges)
            edges.append((points[k], points[k + 1]))
            pins += [(k, rail, points[k]), (rail, k + 1, points[k + 1])]
    return frame(edges, pins)


def random_vector(rng, size=1.0):
    return tuple(float(x) for x in size * rng.normal(size=3))


def random_body(rng, name):
    """Anywhere, any way up, moving anyhow; its inertia is that of a cloud of eight points."""
    mass = float(rng.uniform(0.5, 3.0))
    points = rng.normal(size=(8, 3))
    points -= points.mean(axis=0)
    J = mass / 8 * (np.sum(points**2) * np.eye(3) - points.T @ points)
    return body(
        name,
        mass,
        J,
        position=random_vector(rng),
        r_BG=random_vector(rng, 0.5),
        orientation=from_axis_angle(random_vector(rng), rng.uniform(-np.pi, np.pi)),
        velocity=random_vector(rng),
        angular_velocity=random_vector(rng),
    )


def free_bodies(rng, n=3, gravity=True):
    """Bodies that nothing holds."""
    bodies = [random_body(rng, f"B{i}") for i in range(n)]
    return build_model(bodies, gravity=random_vector(rng, 5.0) if gravity else ZERO)


def jointed(rng, n=4, gravity=True, grounded=True):
    """A tree of bodies on ball joints; the first hangs on the ground, the second holds it.

    So the ground is parent once and child once, where it is wanted at all.
    """
    free = free_bodies(rng, n, gravity)
    bodies, joints = list(free.bodies), []
    grounds = 2 if grounded else 0
    for k in range(n if grounded else n - 1):
        child = k if grounded else k + 1
        parent = None if k < grounds else int(rng.integers(child))
        point, s_child = random_vector(rng), random_vector(rng)
        base = GROUND.name if parent is None else bodies[parent].name
        place = point
        if parent is not None:
            R = matrix(bodies[parent].orientation)
            place = add(bodies[parent].position, times(R, point))
        own = bodies[child]
        at = sub(place, times(matrix(own.orientation), s_child))
        bodies[child] = replace(own, position=at)
        ends = [(base, point), (own.name, s_child)]
        if k == 1 and grounded:
            ends.reverse()
        (a, s_a), (b, s_b) = ends
        joints.append(Joint(f"J{k}", "spherical", a, b, s_a, s_b))
    return replace(free, bodies=tuple(bodies), joints=tuple(joints))


def loaded(rng, gravity=True):
    """A tree under loads in the axes of the ground, of the body itself and of another one."""
    model = jointed(rng, 4, gravity)
    names = [body.name for body in model.bodies]
    axes = [GROUND.name, names[0], names[1]]
    loads = [
        ConcentratedLoad(
            f"L{i}{j}",
            names[int(rng.integers(2))],
            random_vector(rng),
            random_vector(rng, 4.0),
            axes[i],
            random_vector(rng, 2.0),
            axes[j],
        )
        for i in range(3)
        for j in range(3)
    ]
    return replace(model, loads=tuple(loads))


def moved(model, rotation, shift):
    """The complete model, gravity included, rotated by ``rotation`` and then displaced by
    ``shift``.
    """
    A = matrix(rotation)
    grounds = {ground.name for ground in model.grounds}

    def place(point):
        return add(times(A, point), shift)

    def rotated(vector, basis):
        return times(A, vector) if basis in grounds else vector

    bodies = [
        replace(b, position=place(b.position), orientation=compose(rotation, b.orientation))
        for b in model.bodies
    ]

    def moved_ends(element):
        """An element between two bodies: its points and axes on a ground move with it."""
        changes = {}
        for side in ("parent", "child"):
            if getattr(element, side) in grounds:
                changes[f"{side}_point"] = place(getattr(element, f"{side}_point"))
                if hasattr(element, f"{side}_axes"):
                    rows = getattr(element, f"{side}_axes")
                    changes[f"{side}_axes"] = tuple(times(A, row) for row in rows)
        return replace(element, **changes)

    def moved_load(load):
        if isinstance(load, ConcentratedLoad):
            force = rotated(load.force, load.force_basis)
            return replace(load, force=force, moment=rotated(load.moment, load.moment_basis))
        return moved_ends(load) if hasattr(load, "parent") else load

    def moved_motion(motion):
        if hasattr(motion, "direction"):
            return replace(motion, direction=times(A, motion.direction))
        return motion

    return replace(
        model,
        gravity=times(A, model.gravity),
        bodies=tuple(bodies),
        joints=tuple(moved_ends(joint) for joint in model.joints),
        loads=tuple(moved_load(load) for load in model.loads),
        motions=tuple(moved_motion(motion) for motion in model.motions),
    )
