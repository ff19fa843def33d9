"""Centre lines of beams by arc length, and the section's axes along them.

    r(s)   point of the line        d_1 = r'(s)        0 <= s <= length

d_2 is a reference direction made perpendicular to d_1. Without one, d_3 is the normal of the line's
plane (of a straight line: z) made perpendicular to d_1. A twist rotates d_2 and d_3 about d_1
in proportion to s.
"""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from msahl.algebra.vector import Vector
from msahl.records import record

PARALLEL = 1e-3
"""Sine of the angle between two directions below which they count as parallel."""

CONVERGED = 1e-14
"""Error of an arc length, relative to the line's, at which its inversion ends."""


class LineError(ValueError):
    """A centre line or orientation that is not possible; ``part`` is the deck's element."""

    def __init__(self, part: str, message: str) -> None:
        super().__init__(message)
        self.part = part


class CentreLine(Protocol):
    """What a centre line offers: points and unit tangents (n, 3) at arc lengths (n,) [m]."""

    @property
    def length(self) -> float:
        """Arc length [m]."""

    @property
    def normal(self) -> np.ndarray:
        """Normal of the plane of the line (3,)."""

    def points(self, s: np.ndarray) -> np.ndarray:
        """Return r (n, 3) [m]."""

    def tangents(self, s: np.ndarray) -> np.ndarray:
        """Return d_1 (n, 3)."""


@record(slots=False)
class Straight:
    """From ``start`` to ``end`` [m]."""

    start: np.ndarray
    end: np.ndarray

    def __post_init__(self) -> None:
        if not self.length > 0.0:
            raise LineError("end", "<start> and <end> are one point; give two")

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(np.linalg.norm(self.end - self.start))

    @property
    def normal(self) -> np.ndarray:
        """Normal of the plane of the line (3,)."""
        return upward(self.end - self.start)

    def points(self, s: np.ndarray) -> np.ndarray:
        """Return r (n, 3) [m]."""
        share = (s / self.length)[:, None]
        return (1.0 - share) * self.start + share * self.end

    def tangents(self, s: np.ndarray) -> np.ndarray:
        """Return d_1 (n, 3)."""
        return np.tile((self.end - self.start) / self.length, (s.size, 1))


def upward(along: np.ndarray) -> np.ndarray:
    """Return z, or -x for a direction that is nearly z."""
    across = math.hypot(along[0], along[1])
    vertical = across < PARALLEL * np.linalg.norm(along)
    return np.array([-1.0, 0.0, 0.0]) if vertical else np.array([0.0, 0.0, 1.0])


@record(slots=False)
class Arc:
    """From ``start`` about the ``axis`` (3,) through ``centre`` by ``angle`` [rad]."""

    start: np.ndarray
    centre: np.ndarray
    axis: np.ndarray
    angle: float

    def __post_init__(self) -> None:
        radius = np.linalg.norm(self.start - self.centre)
        if not radius > 0.0:
            raise LineError("centre", "<start> and <centre> are one point; give two")
        if abs(self.unit @ (self.start - self.centre)) > 1e-9 * radius:
            message = "the axis is not perpendicular to the radius from <centre> to <start>"
            raise LineError("axis", f"{message}; correct one of the three")
        if self.angle == 0.0:
            raise LineError("angle", "the angle of the arc is zero; give another")

    @property
    def unit(self) -> np.ndarray:
        """Unit vector along the axis."""
        return np.asarray(self.axis / np.linalg.norm(self.axis))

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(np.linalg.norm(self.start - self.centre)) * abs(self.angle)

    @property
    def normal(self) -> np.ndarray:
        """Normal of the plane of the line (3,)."""
        return math.copysign(1.0, self.angle) * self.unit

    def _rotated(self, s: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return ``a``, perpendicular to the axis, rotated by the angle at each arc length."""
        phi = (self.angle * s / self.length)[:, None]
        return np.asarray(np.cos(phi) * a + np.sin(phi) * np.cross(self.unit, a))

    def points(self, s: np.ndarray) -> np.ndarray:
        """Return r (n, 3) [m]."""
        return self.centre + self._rotated(s, self.start - self.centre)

    def tangents(self, s: np.ndarray) -> np.ndarray:
        """Return d_1 (n, 3)."""
        radius = self.start - self.centre
        return self._rotated(s, np.cross(self.normal, radius / np.linalg.norm(radius)))


class Spline:
    """The cubic spline through ``points`` (m, 3) [m], m >= 2, not-a-knot at its ends."""

    def __init__(self, points: Sequence[Vector]) -> None:
        from scipy.interpolate import CubicSpline

        given = np.array(points, dtype=float)
        chords = np.linalg.norm(np.diff(given, axis=0), axis=1)
        if given.shape[0] < 2 or not chords.min() > 0.0:
            raise LineError("", "two points that follow each other are one; give different ones")
        self._u = np.concatenate([[0.0], np.cumsum(chords)])
        self._r = CubicSpline(self._u, given)
        self._rate = self._r.derivative()
        self._x, self._w = np.polynomial.legendre.leggauss(16)
        parts = self._arc(self._u[:-1], self._u[1:])
        self._s = np.concatenate([[0.0], np.cumsum(parts)])
        spread = np.linalg.svd(given - given.mean(axis=0))
        flat = spread[1][1] < PARALLEL * spread[1][0] if len(spread[1]) > 1 else True
        self._normal = upward(given[-1] - given[0]) if flat else self._plane(given, spread[2][2])

    @staticmethod
    def _plane(points: np.ndarray, normal: np.ndarray) -> np.ndarray:
        """Return the normal of the plane of best fit, about which the line bends to the left."""
        chords = np.diff(points, axis=0)
        sense = np.cross(chords[:-1], chords[1:]).sum(axis=0) @ normal
        return np.asarray(math.copysign(1.0, sense) * normal)

    def _arc(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Return the arc lengths between parameters, by Gauss's formula within one interval."""
        half = 0.5 * (end - start)
        u = (0.5 * (start + end))[:, None] + half[:, None] * self._x
        return np.asarray(half * (np.linalg.norm(self._rate(u), axis=2) @ self._w))

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self._s[-1])

    @property
    def normal(self) -> np.ndarray:
        """Normal of the plane of the line (3,)."""
        return self._normal

    def _parameters(self, s: np.ndarray) -> np.ndarray:
        """Return the parameters at arc lengths, by Newton's method."""
        k = np.clip(np.searchsorted(self._s, s, side="right") - 1, 0, self._u.size - 2)
        low, high = self._u[k], self._u[k + 1]
        u = low + (high - low) * (s - self._s[k]) / (self._s[k + 1] - self._s[k])
        for _ in range(50):
            error = self._s[k] + self._arc(low, u) - s
            u = u - error / np.linalg.norm(self._rate(u), axis=1)
            if np.abs(error).max(initial=0.0) <= CONVERGED * self.length:
                break
        return np.asarray(u)

    def points(self, s: np.ndarray) -> np.ndarray:
        """Return r (n, 3) [m]."""
        return np.asarray(self._r(self._parameters(s)))

    def tangents(self, s: np.ndarray) -> np.ndarray:
        """Return d_1 (n, 3)."""
        rate = self._rate(self._parameters(s))
        return np.asarray(rate / np.linalg.norm(rate, axis=1)[:, None])


def frames(
    line: CentreLine, s: np.ndarray, reference: np.ndarray | None, twist: float
) -> np.ndarray:
    """Return R (n, 3, 3) with the columns d_1, d_2, d_3; ``twist`` [rad] is that at its end."""
    d1 = line.tangents(s)
    if reference is None:
        d3 = _across(line.normal, d1, s / line.length)
        d2 = np.cross(d3, d1)
    else:
        d2 = _across(reference, d1, s / line.length)
        d3 = np.cross(d1, d2)
    phi = (twist * s / line.length)[:, None]
    if twist:
        d2, d3 = np.cos(phi) * d2 + np.sin(phi) * d3, np.cos(phi) * d3 - np.sin(phi) * d2
    return np.stack([d1, d2, d3], axis=2)


def _across(a: np.ndarray, d1: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Return ``a`` made perpendicular to each tangent, of length one."""
    part = a - (d1 @ a)[:, None] * d1
    size = np.linalg.norm(part, axis=1)
    worst = int(size.argmin())
    if size[worst] < PARALLEL * np.linalg.norm(a):
        message = f"the reference is parallel to the line at {share[worst]:.3g} of its length"
        raise LineError("reference", f"{message}; give one that is nowhere parallel to it")
    return np.asarray(part / size[:, None])
