"""Records of elastic bodies in a floating frame, in SI units.

The body that the record is named after is the floating frame. Others follow it: a point x of the
body is at x + sum_j phi_j a_j in the axes of the frame, with an amplitude a_j for each mode.

    n_i . (P_k - P_0)                = x_ki + sum_j phi_kij a_j    i = x, y, z: place of follower k
    (d_j . e_i - d_i . e_j)/2        = sum_j theta_kij a_j         its rotation, to first order

The first followers carry the amplitudes: three to a body, as its displacements along x, y and z of
the frame. All followers are rigid bodies of the model, so joints, loads and markers attach to them.
"""

from msahl.algebra.vector import Vector
from msahl.records import record

Rows = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
AXES = 3
"""Amplitudes that one body carries at most."""


@record
class Follower:
    """A rigid body that follows a frame: ``place`` x of its point B from the frame's [m], in the
    axes of the frame; ``shape`` phi [m/m] and ``rotation`` theta [1/m], rows x, y, z by amplitudes.
    """

    body: str
    place: Vector
    shape: Rows
    rotation: Rows


@record
class ElasticBody:
    """The modes of the body ``name``: ``stiffness`` [N/m] and ``damping`` [N s/m] of each
    amplitude, whose elastic energy is stiffness a^2/2.
    """

    name: str
    followers: tuple[Follower, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]

    @property
    def carriers(self) -> int:
        """Number of followers that carry amplitudes."""
        return -(-len(self.stiffness) // AXES)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the frame and of all that follows it."""
        return (self.name, *(follower.body for follower in self.followers))

    @property
    def amplitudes(self) -> tuple[tuple[str, int], ...]:
        """The body that carries each amplitude, and the axis of the frame along which it moves."""
        count = range(len(self.stiffness))
        return tuple((self.followers[j // AXES].body, j % AXES) for j in count)


def node_places(body: ElasticBody) -> list[Vector]:
    """Return where the nodes of the interface are in the frame [m]: what follows it and rotates."""
    return [one.place for one in body.followers if any(map(any, one.rotation))]
