"""Records of elastic bodies in a floating frame, in SI units.

The body that the record is named after is the floating frame. Others follow it: a point x of the
body is at x + sum_j phi_j a_j in the axes of the frame, with an amplitude a_j for each mode.

    n_i . (P_k - P_0)                = x_ki + sum_j phi_kij a_j    i = x, y, z: place of follower k
    (d_j . e_i - d_i . e_j)/2        = sum_j theta_kij a_j         its rotation, to first order

The first followers carry the amplitudes: three to a body, as its displacements along x, y and z of
the frame. With geometric stiffening, the next ones carry squares likewise, which are numbered
behind the amplitudes in the sums above, and behind them are the sums of amplitudes to be squared:

    s_l = c_l b_l^2      b_l an amplitude, or a displacement of a follower behind those of squares

All followers are rigid bodies of the model, so joints, loads and markers attach to them.
"""

from msahl.algebra.vector import Vector
from msahl.records import record

Rows = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
AXES = 3
"""Amplitudes that one body carries at most."""


@record
class Follower:
    """A rigid body that follows a frame: ``place`` x of its point B from the frame's [m], in the
    axes of the frame; ``shape`` phi [m/m] and ``rotation`` theta [1/m], rows x, y, z by amplitudes
    and squares. A node of the interface is one ``is_node``; others do not rotate in the frame.
    """

    body: str
    place: Vector
    shape: Rows
    rotation: Rows
    is_node: bool = False


@record
class Square:
    """A square: of the amplitude ``argument``, from 0, or behind these of that displacement of the
    followers behind those of squares; times a ``factor`` c [1/m], as it is a displacement [m]."""

    argument: int
    factor: float


@record
class ElasticBody:
    """The modes of the body ``name``: ``stiffness`` [N/m] and ``damping`` [N s/m] of each
    amplitude, whose elastic energy is stiffness a^2/2; ``squares`` with geometric stiffening.
    ``file`` is that of msahl reduce, from the folder of the deck, which has what views draw.
    Tables and views show the frame and the nodes of the interface, or ``shows_all`` bodies.
    """

    name: str
    followers: tuple[Follower, ...]
    stiffness: tuple[float, ...]
    damping: tuple[float, ...]
    squares: tuple[Square, ...] = ()
    shows_all: bool = False
    file: str = ""

    @property
    def hidden(self) -> tuple[Follower, ...]:
        """The followers that tables and views do not show: those that carry amplitudes and mass."""
        return () if self.shows_all else tuple(f for f in self.followers if not f.is_node)

    @property
    def carriers(self) -> int:
        """Number of followers that carry amplitudes."""
        return -(-len(self.stiffness) // AXES)

    @property
    def square_carriers(self) -> int:
        """Number of followers behind these that carry squares."""
        return -(-len(self.squares) // AXES)

    @property
    def bodies(self) -> tuple[str, ...]:
        """Names of the frame and of all that follows it."""
        return (self.name, *(follower.body for follower in self.followers))

    @property
    def amplitudes(self) -> tuple[tuple[str, int], ...]:
        """The body that carries each amplitude, and the axis of the frame along which it moves."""
        places = self.carried(0, len(self.stiffness))
        return tuple((self.followers[k].body, axis) for k, axis in places)

    @property
    def squared(self) -> tuple[tuple[int, int], ...]:
        """The follower that carries each square, by its number, and the axis likewise."""
        return self.carried(self.carriers, len(self.squares))

    def carried(self, first: int, count: int) -> tuple[tuple[int, int], ...]:
        """Return where so many numbers are, from the ``first`` follower on: follower and axis."""
        return tuple((first + j // AXES, j % AXES) for j in range(count))


def node_places(body: ElasticBody) -> list[Vector]:
    """Return where the nodes of the interface are in the frame [m]."""
    return [one.place for one in body.followers if one.is_node]


def least_followers(amplitudes: int, squares: tuple[Square, ...]) -> int:
    """Return how many followers carry so many amplitudes, the squares, and what is squared."""
    last = max([amplitudes - 1, *(one.argument for one in squares)]) - amplitudes  # of the sums
    return -(-amplitudes // AXES) - (-len(squares) // AXES) + last // AXES + 1
