"""The beams that are compared, two at rest and two in motion, and their decks.

All numbers are in SI. Every program gets the same stiffnesses and masses per length, the shear
factor and the torsion constant being part of them.
"""

import math
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from msahl.beams.mesh import Mesh

DECKS = Path(__file__).parents[2] / "decks" / "elastic"


class Section(NamedTuple):
    stretch: float  # EA [N]
    shear: float  # GA2 = GA3 [N]
    torsion: float  # GJ [N m^2]
    bending: float  # EI2 = EI3 [N m^2]
    mass: float  # [kg/m]
    inertia: tuple[float, float, float] = (0.0, 0.0, 0.0)  # of the section, per length [kg m]


class Problem(NamedTuple):
    """``points`` are the shares of the arc length whose positions are compared."""

    name: str
    title: str
    section: Section
    length: float  # [m]
    points: tuple[float, ...]
    end: float = 0.0  # time [s]; zero: a configuration at rest
    interval: float = 0.0  # between output times [s]

    @property
    def outputs(self) -> int:
        """Number of output times after the start."""
        return round(self.end / self.interval) if self.end else 0


RADIUS, ANGLE, FORCE = 100.0, math.pi / 4.0, 600.0
"""Of the bend."""
START, ALONG = np.array([6.0, 0.0, 0.0]), np.array([-0.6, 0.8, 0.0])
"""Of the rod: its lower end, and the direction to the other one."""
THROW, TWIST = (20.0, 0.0, 0.0), (0.0, 100.0, -200.0)
"""Largest force [N] and moment [N m] on the lower end of the rod, ..."""
PEAK, CEASED = 2.5, 5.0
"""... the time [s] at which they have this size, and from which on they are zero."""
GRAVITY = 9.81
SPAN = 8.0
"""Distance of the supports of the cable [m]."""

ROPE = Section(1e5, 0.0, 100.0, 100.0, 1.0)
BEND = Problem(
    "bend",
    "45 degree bend",
    Section(1e7, 5.0 / 12.0 * 1e7, 1e7 / 12.0, 1e7 / 12.0, 1.0, (1.0 / 6.0, 1 / 12.0, 1 / 12.0)),
    RADIUS * ANGLE,
    (1.0,),
)
ROD = Problem(
    "rod",
    "flying spaghetti",
    Section(1e4, 1e4, 500.0, 500.0, 1.0, (20.0, 10.0, 10.0)),
    10.0,
    (0.0, 1.0),
    10.0,
    0.5,
)
HANGING = Problem("hanging", "hanging cable", ROPE, 10.0, (0.5,))
SWINGING = Problem("swinging", "swinging cable", ROPE, 10.0, (0.5, 1.0), 4.0, 0.2)
PROBLEMS = {problem.name: problem for problem in (BEND, ROD, HANGING, SWINGING)}


def load_factor(t: float) -> float:
    """Share of the loads that acts on the rod at a time."""
    return max(0.0, t / PEAK if t < PEAK else (CEASED - t) / (CEASED - PEAK))


def first_guess(shares: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the points (n, 2) of an arc that sags between the supports, x and z, and its slopes
    (n,) [rad], at shares of its length: where each program begins to look for the equilibrium.
    """
    half = 1.0
    for _ in range(50):  # sin(a)/a = SPAN/length has one root below pi
        slope = math.cos(half) / half - math.sin(half) / half**2
        half -= (math.sin(half) / half - SPAN / HANGING.length) / slope
    radius, angle = HANGING.length / (2.0 * half), half * (2.0 * shares - 1.0)
    x = radius * (math.sin(half) + np.sin(angle))
    return np.stack([x, radius * (math.cos(half) - np.cos(angle))], axis=-1), angle


def deck(problem: Problem, elements: int, degree: int) -> bytes | str:
    """Return the deck of a problem with so many elements of a degree."""
    if problem is BEND or problem is ROD:
        path = DECKS / ("bend45.xml" if problem is BEND else "spaghetti.xml")
        text = path.read_text()
        for tag, value in (("elements", elements), ("degree", degree)):
            text = re.sub(f"<{tag}>.*</{tag}>", f"<{tag}>{value}</{tag}>", text)
        return text.encode()
    nodes = _nodes(elements, degree) if problem is HANGING else ""
    joints = _SUPPORT if problem is HANGING else ""
    text = (Path(__file__).parent / "cable.xml").read_text()
    for word, value in (("elements", elements), ("degree", degree)):
        text = text.replace(f"@{word}@", str(value))
    return text.replace("@nodes@", nodes).replace("@joints@", joints)


def _nodes(elements: int, degree: int) -> str:
    """Return where the nodes of the hanging cable begin, at rest."""
    ends = tuple(e / elements for e in range(elements + 1))
    points, slopes = first_guess(Mesh(degree, ends).stations)
    # A slope is a rotation about -y; the parameters are 4 tan(angle/4) along the axis.
    rows = [
        f"{x:.17g} 0 {z:.17g} 0 {-4.0 * math.tan(slope / 4.0):.17g} 0 0 0 0 0 0 0"
        for (x, z), slope in zip(points, slopes, strict=True)
    ]
    return "<nodes>{}</nodes>".format("\n".join(rows))


_SUPPORT = f"""<spherical>
  <name>Support</name>
  <parent><name>Base</name><position><x>{SPAN}</x></position></parent>
  <child><name node="last">Cable</name></child>
</spherical>"""
"""Without the equation of a second hinge that the first one makes redundant."""
