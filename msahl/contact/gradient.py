"""Approximate solutions of contact problems with friction by an accelerated projected gradient.

With the cone K of Coulomb's friction and its dual K*, the problem of ``friction`` is

    g = w + mu |w_t| n in K*,    z in K,    g . z = 0           z = the nearest in K to z - r g

of which each step takes z from an extrapolated place along -g, and projects it. The extrapolation
begins again where it leads uphill. A step costs one product with W, whatever the number of contacts
is and however redundant they are; some hundreds of them come near enough for Newton's method.
Sources: G. de Saxce, Z.-Q. Feng, The bipotential method, Math. Comput. Modelling 28 (1998), for g;
H. Mazhar, T. Heyn, D. Negrut, A. Tasora, Using Nesterov's method to accelerate multibody dynamics
with friction and contact, ACM Trans. Graph. 34 (2015).
"""

import math
from collections.abc import Iterator

import numpy as np

from msahl.contact.cones import Cones

BLOCKS = (100, 200, 400, 800, 1600)
"""Steps after which the place reached is tried."""
DIVERGES = 1e4
"""Growth of the solution beyond what the right side explains at which there is none."""


def approach(W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray) -> Iterator[np.ndarray]:
    """Yield places (m,) ever nearer to a solution, from ``z``."""
    steps = _Steps(W, q, cones, z)
    for count in BLOCKS:
        for _ in range(count):
            steps.take()
        yield steps.z.copy()


class _Steps:
    """The steps from ``z``; ``begin_again`` is where the extrapolation does."""

    def __init__(self, W: np.ndarray, q: np.ndarray, cones: Cones, z: np.ndarray) -> None:
        self.W, self.q, self.cones = W, q, cones
        self.size = 1.0 / max(float(np.linalg.norm(W, 2)), 1e-300)
        self.z, self.ahead, self.weight = z.copy(), z.copy(), 1.0
        self.rough = cones.tangent[:, 0] >= 0
        self.tangent = cones.tangent[self.rough]

    def take(self) -> None:
        """Take one step."""
        w = self.W @ self.ahead + self.q
        slip, n = w[self.tangent], self.cones.normal[self.rough]
        w[n] += self.cones.friction[self.rough] * np.hypot(slip[:, 0], slip[:, 1])
        new = project(self.ahead - self.size * w, self.cones)
        change = new - self.z
        if float(w @ change) > 0.0:
            self.weight, self.ahead = 1.0, new
        else:
            after = 0.5 * (1.0 + math.sqrt(1.0 + 4.0 * self.weight**2))
            self.ahead, self.weight = new + (self.weight - 1.0) / after * change, after
        self.z = new


def project(z: np.ndarray, cones: Cones) -> np.ndarray:
    """Return the nearest to ``z`` (m,) in the cones, with the normal parts that are at least the
    least; the tangential part of a contact that slips in a given direction follows from its normal
    part.
    """
    found, rough = z.copy(), cones.tangent[:, 0] >= 0
    found[cones.normal] = np.maximum(z[cones.normal], cones.least)
    n, t, mu = cones.normal[rough], cones.tangent[rough], cones.friction[rough]
    given = ~np.isnan(cones.toward[rough, 0])
    length = np.hypot(z[t[:, 0]], z[t[:, 1]])
    along = np.where(given, z[n], (z[n] + mu * length) / (1.0 + mu * mu))
    along = np.where(given | (length > mu * z[n]), along, z[n])
    found[n] = np.maximum(along, cones.least[rough])
    radius = mu * found[n]
    share = np.where(length > radius, radius / np.where(length > 0.0, length, 1.0), 1.0)
    found[t] *= share[:, None]
    found[t[given]] = -radius[given, None] * cones.toward[rough][given]
    return found
