"""Random models of bodies that touch, and their gaps by an independent computation.

Every shape is a box, of none to three sizes, rounded by a radius: a sphere, a capsule, a box.
"""

from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear
from scipy.spatial.transform import Rotation

from msahl.algebra.rotation import from_axis_angle, matrix

RADII = {"sphere": (0.1, 0.2), "capsule": (0.05, 0.1), "box": (0.01, 0.03)}
"""Ranges [m]."""
LATTICE = 0.8
"""Distance of the places of bodies [m]: no two shapes reach each other from there."""
LEVEL = (0.0, 0.0, 0.0)


class Solid(NamedTuple):
    """A body: its shape, and the start in inertial axes, velocities in those of the body."""

    name: str
    kind: str
    half: tuple[float, float, float]  # [m] between the middles of the corners
    radius: float  # [m]
    mass: float  # [kg]
    inertia: tuple[float, float, float]
    position: tuple[float, float, float]
    orientation: tuple[float, float, float]  # rotation vector
    velocity: tuple[float, float, float]
    spin: tuple[float, float, float]


class Scene(NamedTuple):
    """A model of solids above a floor z = 0."""

    solids: list[Solid]
    contacts: str
    joints: str
    law: str

    def deck(self, t_final: float) -> str:
        """Return the text of the deck."""
        bodies = "".join(map(_body, self.solids))
        joints = f"<joints>{self.joints}</joints>" if self.joints else ""
        return (
            "<data><unitSystem>SI</unitSystem><system><gravity><g3>-9.81</g3></gravity>"
            f"<bodies><ground><name>Earth</name></ground>{bodies}</bodies>{joints}"
            f"<contacts>{self.contacts}</contacts></system>"
            f'<simulation impactLaw="{self.law}"><deltaT>0.01</deltaT>'
            f"<tFinal>{t_final}</tFinal></simulation></data>"
        )


def scene(seed: int) -> Scene:
    """Return the model of a ``seed``."""
    random = np.random.default_rng(seed)
    count = int(random.integers(1, 6))
    stacked = random.random() < 0.4
    solids, top = [], 0.0
    for k in range(count):
        solid = _solid(random, f"B{k}", stacked)
        if stacked:  # in touch with what is below, or nearly
            reach = solid.half[2] + solid.radius
            place = (float(random.uniform(-0.03, 0.03)), 0.0, top + reach)
            top += 2.0 * reach + float(random.choice([0.0, 0.0, 0.02]))
        else:
            place = (LATTICE * (k % 2), 0.1 * float(random.random()), 0.6 + LATTICE * (k // 2))
        solids.append(solid._replace(position=place))
    friction = float(random.choice([0.0, 0.2, 0.5, 0.9]))
    grip = f"<staticFriction>{1.3 * friction}</staticFriction>" if random.random() < 0.2 else ""
    law = f"<restitution>{random.choice([0.0, 0.3, 0.7, 1.0])}</restitution>"
    law += f"<friction>{friction}</friction>{grip}" if friction else ""
    contacts = _set(solids, law)
    joints = "" if stacked or random.random() < 0.6 else _joint(random, solids)
    if random.random() < 0.2 and count > 1:
        contacts += _rope(random, solids)
    name = str(random.choice(["poisson", "poisson", "poisson", "newton"]))
    return Scene(solids, contacts, joints, name)


def _solid(random, name: str, level: bool) -> Solid:
    kind = str(random.choice(["sphere", "capsule", "box", "box"]))
    sizes = {"sphere": (0, 0, 0), "capsule": (0, 0, 1), "box": (1, 1, 1)}[kind]
    half = tuple(float(s * random.choice([0.08, 0.1, random.uniform(0.05, 0.2)])) for s in sizes)
    radius = float(random.uniform(*RADII[kind]))
    mass = float(random.choice([0.5, 1.0, 2.0, 20.0]))
    a, b, c = (2.0 * (h + radius) for h in half)
    inertia = tuple(mass / 12.0 * s for s in (b * b + c * c, a * a + c * c, a * a + b * b))
    axis = random.normal(size=3)
    tilted = tuple(axis / np.linalg.norm(axis))
    angle = float(random.choice([0.0, np.pi / 4, random.uniform(0.0, 3.0)]))
    orientation = from_axis_angle((0.0, 0.0, 1.0) if level else tilted, angle)
    speed = 0.0 if level and random.random() < 0.7 else 1.0
    velocity = tuple((speed * random.normal(size=3) * (1.0, 1.0, 0.0 if level else 1.0)).tolist())
    spin = tuple((0.0 if level else 1.0) * random.normal(size=3) * 3.0)
    return Solid(name, kind, half, radius, mass, inertia, LEVEL, orientation, velocity, spin)


def _numbers(tags, values) -> str:
    return "".join(f"<{tag}>{float(v)!r}</{tag}>" for tag, v in zip(tags, values, strict=True))


def _xyz(values) -> str:
    return _numbers("xyz", values)


def _body(solid: Solid) -> str:
    angle = float(np.linalg.norm(rotation_vector(solid.orientation)))
    axis = rotation_vector(solid.orientation) / angle if angle else np.array([0.0, 0.0, 1.0])
    R = np.array(matrix(solid.orientation))
    rotated = f'<phi units="rad">{angle!r}</phi>{_numbers(("u1", "u2", "u3"), axis)}'
    moved = _numbers(("v1", "v2", "v3"), R @ solid.velocity)
    return (
        f"<rigidBody><name>{solid.name}</name><mass>{solid.mass}</mass>"
        f"<moi>{_numbers(('Ixx', 'Iyy', 'Izz'), solid.inertia)}</moi><initialConditions>"
        f'<position basis="Earth">{_xyz(solid.position)}</position>'
        f"<orientation><eulerRotation>{rotated}</eulerRotation></orientation>"
        f'<velocity basis="Earth">{moved}</velocity>'
        f"<angularVelocity>{_numbers(('omega1', 'omega2', 'omega3'), solid.spin)}</angularVelocity>"
        "</initialConditions></rigidBody>"
    )


def rotation_vector(p) -> np.ndarray:
    """Return the rotation vector (3,) of the parameters ``p`` of an orientation."""
    return Rotation.from_matrix(np.array(matrix(tuple(p)))).as_rotvec()


def _set(solids, law: str) -> str:
    shapes = {"sphere": "", "capsule": "", "box": ""}
    for one in solids:
        size = {
            "sphere": "",
            "capsule": f"<axis><z>1</z></axis><radius>{one.radius!r}</radius>"
            f"<length>{2.0 * one.half[2]!r}</length>",
            "box": _xyz(2.0 * np.array(one.half)),
        }[one.kind]
        radius = "" if one.kind == "capsule" else f"<radius>{one.radius!r}</radius>"
        shapes[one.kind] += f"<{one.kind}><name>{one.name}</name>{size}{radius}</{one.kind}>"
    plane = "<plane><name>Earth</name><normal><z>1</z></normal></plane>"
    return f"<contactSet><name>All</name>{''.join(shapes.values())}{plane}{law}</contactSet>"


def _joint(random, solids) -> str:
    one = solids[int(random.integers(len(solids)))]
    arm = random.uniform(-0.3, 0.3, 3)
    own = np.array(matrix(one.orientation)).T @ arm
    place = np.array(one.position) + arm
    # The velocity of the start is made to fit by the start solution.
    return (
        "<spherical><name>Pin</name>"
        f"<parent><name>Earth</name><position>{_xyz(place)}</position></parent>"
        f"<child><name>{one.name}</name><position>{_xyz(own)}</position></child></spherical>"
    )


def _rope(random, solids) -> str:
    one, two = solids[0], solids[1]
    apart = float(np.linalg.norm(np.subtract(one.position, two.position)))
    slack = float(random.choice([0.0, 0.3]))
    return (
        f"<distanceLimit><name>Rope</name><parent><name>{one.name}</name></parent>"
        f"<child><name>{two.name}</name></child><upper>{apart + slack!r}</upper>"
        "<restitution>0.3</restitution></distanceLimit>"
    )


def least_gap(solids, row: np.ndarray) -> float:
    """Return the least gap [m] of all solids at a row of states, without its time (12 n,)."""
    found, placed = np.inf, []
    for k, one in enumerate(solids):
        x, R = row[12 * k : 12 * k + 3], np.array(matrix(tuple(row[12 * k + 3 : 12 * k + 6])))
        found = min(found, x[2] - np.abs(R[2]) @ one.half - one.radius)
        placed.append((x, R, np.array(one.half), one.radius))
    for k, a in enumerate(placed):
        for b in placed[:k]:
            if np.linalg.norm(a[0] - b[0]) < 1.0:
                found = min(found, _distance(a, b) - a[3] - b[3])
    return float(found)


def _distance(a, b) -> float:
    """Return the distance of two boxes, as the least squares of a point of each."""
    given = [(R[:, half > 0.0], half[half > 0.0]) for _, R, half, _ in (a, b)]
    A = np.hstack([given[0][0], -given[1][0]])
    bound = np.concatenate([given[0][1], given[1][1]])
    if not bound.size:
        return float(np.linalg.norm(a[0] - b[0]))
    found = lsq_linear(A, b[0] - a[0], (-bound, bound), method="bvls", tol=1e-15)
    return float(np.linalg.norm(A @ found.x - b[0] + a[0]))
