"""Find which unknowns a system needs: exact reductions, from the state at t = 0.

*Ballistic*: the mass centre of a body that nothing but gravity touches moves by u = h v + h^2 g/2,
which is the time element's own answer; only its rotation is left to solve for.

*Planar*: if every mass centre, arm, force and velocity lies in one coordinate plane of the inertial
axes, if every spin, moment and one principal axis of each body is its normal, and every direction
of a joint lies in the plane or along the normal, then by mirror symmetry all stays so; three
unknowns a body are left, and those joint equations that do not hold by symmetry alone. The test
allows for the round-off of rotated vectors and for nothing else, so nothing is neglected.
(Distances between parallel planes would make moments; they do not count as planar.)

What is not solved for must not depend on itself. The components that a planar system does not have
are therefore zero, not small: every velocity and every guess passes through ``frames.restrict``.
"""

from itertools import pairwise

import numpy as np

from msahl.elements.beams.group import Beams, BeamsWorkspace, Plane
from msahl.elements.constraints import curves, sums
from msahl.elements.constraints.coincide import Coincide
from msahl.elements.constraints.coordinate_kinds import PLAIN, RADIUS, Coordinates
from msahl.elements.constraints.equations import ConstraintEquations, is_active
from msahl.elements.constraints.products import (
    DOT,
    SLIDE,
    SLIP,
    SURFACE,
    Products,
    ProductsWorkspace,
    Surfaces,
)
from msahl.elements.reactions import Reactions
from msahl.formulations.absolute.frames import first_multiplier, ground_of, moving_count
from msahl.ports import forces
from msahl.system.arrays import System, SystemWorkspace, node_count

ROUND_OFF = 16 * np.finfo(float).eps
"""Component, relative to its vector's length, that is round-off: a vector carried from one frame to
another by two matrices of rotation loses a few machine epsilons of its length."""


def plane_normal(
    system: System, start: SystemWorkspace, pushes: np.ndarray | None = None
) -> int | None:
    """Index of the inertial axis along which nothing ever happens, or None; ``start`` prepared.
    ``pushes`` (k, 3) are vectors of impulses to come that must lie in the plane, as forces must.
    """
    for axis in (1, 2, 0):
        lies = pushes is None or _is_zero(pushes[:, [axis]], pushes)
        if lies and _is_planar(system, start, axis):
            return axis
    return None


def _is_planar(system: System, start: SystemWorkspace, axis: int) -> bool:
    if system.beams is not None and plane_of_beams(system.beams, start.beams, axis) is None:
        return False
    if system.scalar is not None and system.scalar.sums is not None:
        return False  # modes move in space
    in_plane = [i for i in range(3) if i != axis]
    ground = ground_of(system.frames)
    motion, coincide, J = start.frames, start.coincide, start.bodies.J
    vectors, moments = forces.vectors(system.forces, start.forces)
    # The ground's arms are places, not levers.
    arms_a = coincide.r_a[system.coincide.a != ground]
    arms_b = coincide.r_b[system.coincide.b != ground]
    in_the_plane = (system.bodies.gravity[None], motion.v, arms_a, arms_b, *vectors)
    lies = all(_is_zero(a[:, [axis]], a) for a in in_the_plane)
    lies = lies and all(_is_zero(a[:, in_plane], a) for a in (motion.W, *moments))
    lies = lies and _is_zero(J[:, axis, in_plane], J.reshape(-1, 9))
    if system.scalar is None or not lies:
        return lies
    group, products = system.scalar.coordinates, start.scalar.coordinates.products
    if not all(_fits(group, products, ground, q, axis) for q in range(group.kind.size)):
        return False
    # Forces, contacts and prescribed motions across the plane break the symmetry.
    rows = system.scalar.equations
    moved = (rows.law >= 0) | (rows.coordinate[:, 1] >= 0) | ~is_active(rows)
    active = rows.coordinate[moved].reshape(-1)
    acting = np.concatenate([active, forces.coordinates_of(system.forces)])
    return not _held(group, products, axis)[acting[acting >= 0]].any()


def plane_of_beams(group: Beams, start: BeamsWorkspace, axis: int) -> Plane | None:
    """Return the plane across ``axis`` if all beams stay in it by symmetry, else None.

    Lines lie in the plane. Of the directors d_2 and d_3 of all nodes of an element one is the
    normal, on the same side. Unstressed beams have no strains out of the plane, and those in it no
    compliance in common with the others.
    """
    lines = (start.d[:, 0], start.arm, start.r_slope)
    if not all(_is_zero(a[:, [axis]], a) for a in lines):
        return None
    normal = _normals(group, start.d, axis)
    if normal is None:
        return None
    side = np.sign(start.d[group.node[group.first[group.element]], normal, axis])
    kept = in_plane_strains(3 - normal)
    out = ~kept
    if not _is_zero(group.reference * out, np.ones((out.shape[0], 1))):
        return None
    if (group.compliance * (kept[:, :, None] & out[:, None, :])).any():
        return None
    return Plane(
        axes=np.array([(axis + 1) % 3, (axis + 2) % 3, axis]),
        shear=3 - normal,
        bend=3 + normal,
        shear_sign=np.where(normal == 2, side, -side),
        bend_sign=side,
    )


def _normals(group: Beams, d: np.ndarray, axis: int) -> np.ndarray | None:
    """(g,) number of the director, 1 or 2, that is the normal at all nodes of the element of each
    Gauss point, of the directors ``d`` (m, 3, 3) of the nodes; None if there is none.
    """
    in_plane = [i for i in range(3) if i != axis]
    flat = np.abs(d[:, 1:, axis]) <= ROUND_OFF
    upright = (np.abs(d[:, 1:, in_plane]) <= ROUND_OFF).all(axis=2)
    number = np.select([upright[:, 0] & flat[:, 1], upright[:, 1] & flat[:, 0]], [1, 2])
    side = number * np.sign(d[np.arange(number.size), np.maximum(number, 1), axis])
    elements = [side[group.node[a:b]] for a, b in pairwise(group.first)]
    if not all(each.all() and np.ptp(each) == 0.0 for each in elements):
        return None
    return np.abs([each[0] for each in elements]).astype(np.int64)[group.element]


def in_plane_strains(shear: np.ndarray) -> np.ndarray:
    """(g, 6) which strains do not vanish in a plane; ``shear`` (g,) are the numbers of shears."""
    number, s = np.arange(6), shear[:, None]
    kept: np.ndarray = (number == 0) | (number == s) | (number == 6 - s)
    return kept


def _is_zero(part: np.ndarray, vectors: np.ndarray) -> bool:
    """Whether ``part`` (n, k) is nothing but round-off of ``vectors`` (n, m)."""
    return bool(np.all(np.abs(part) <= ROUND_OFF * np.linalg.norm(vectors, axis=1)[:, None]))


def _fits(group: Coordinates, products: ProductsWorkspace, ground: int, q: int, axis: int) -> bool:
    """Whether a coordinate is its own mirror image: its vectors along or across the normal."""
    for k in range(group.first[q], group.first[q + 1]):
        kind = group.products.kind[k]
        if kind not in (DOT, SLIDE, SLIP):
            return False
        n_along = _along(products.n[k], axis)
        if n_along is None:
            return False
        if kind == DOT:
            e_along = _along(products.e[k], axis)
            mixed = n_along != e_along
            if e_along is None or (n_along and e_along) or (mixed and group.kind[q] != PLAIN):
                return False
        else:
            a, b = group.products.a[k], group.products.b[k]
            ends = ((a, products.r_a[k]), (b, products.r_b[k]))
            arms = [arm for body, arm in ends if body != ground]
            lengths = np.array([*arms, products.D[k]])
            if not _is_zero(lengths[:, axis][None], lengths.reshape(1, -1)):
                return False
            if n_along and group.kind[q] not in (PLAIN, RADIUS):
                return False
    return True


def _along(vector: np.ndarray, axis: int) -> bool | None:
    """True along the axis, False across it, None if neither."""
    if _is_zero(np.delete(vector, axis)[None], vector[None]):
        return True
    return False if _is_zero(vector[None, [axis]], vector[None]) else None


def symmetric_rows(system: System, start: SystemWorkspace, axis: int) -> np.ndarray:
    """(r,) equations satisfied by symmetry in a planar system, for any motion in the plane."""
    if system.scalar is None:
        return np.zeros(0, dtype=bool)
    rows = system.scalar.equations
    held = _held(system.scalar.coordinates, start.scalar.coordinates.products, axis)
    symmetric: np.ndarray = held[rows.coordinate[:, 0]] & (rows.coordinate[:, 1] < 0)
    return symmetric


def _held(group: Coordinates, products: ProductsWorkspace, axis: int) -> np.ndarray:
    """(q,) coordinates that a motion in the plane cannot change."""
    held = np.zeros(group.kind.size, dtype=bool)
    for q in np.flatnonzero(group.kind == PLAIN):
        k = group.first[q]
        n_along = _along(products.n[k], axis)
        if group.products.kind[k] == DOT:
            held[q] = n_along != _along(products.e[k], axis)
        else:
            held[q] = bool(n_along)
    return held


def stay_in_plane(system: System, start: SystemWorkspace, axis: int | None) -> System:
    """Return the system with every motion out of the plane across ``axis`` set to zero, itself
    without one; ``start`` prepared.
    """
    if axis is None:
        return system
    moves = np.array([np.arange(3) != axis, np.arange(3) == axis], dtype=float)
    system = system._replace(frames=system.frames._replace(moves=moves))
    if system.beams is None:
        return system
    plane = plane_of_beams(system.beams, start.beams, axis)
    return system._replace(beams=system.beams._replace(plane=plane))


def in_space(system: System) -> System:
    """Return the system with the equations of its beams in space."""
    if system.beams is None:
        return system
    return system._replace(beams=system.beams._replace(plane=None))


def drop_rows(system: System, held: np.ndarray) -> System:
    """The system without the ``held`` rows (r,), and without the coordinates only they needed.

    Nodes and blocks stay where they are.
    """
    scalar = system.scalar
    if scalar is None or not held.any():
        return system
    rows, group = scalar.equations, scalar.coordinates
    kept = np.flatnonzero(~held)
    acting = (rows.coordinate[kept].reshape(-1), forces.coordinates_needed(system.forces))
    further = sums.coordinates_of(scalar.sums)
    numbers = np.concatenate([*acting, further])
    used = np.flatnonzero(np.bincount(numbers[numbers >= 0]))
    coords, number = coordinate_subset(group, used)
    fewer = ConstraintEquations(*(array[kept] for array in rows))
    left = np.concatenate([[0], np.cumsum(~held)])
    return system._replace(
        scalar=scalar._replace(
            coordinates=coords,
            equations=fewer._replace(coordinate=number[fewer.coordinate]),
            equation_column=scalar.equation_column[kept],
            sums=sums.fewer(scalar.sums, kept, number),
        ),
        forces=forces.renumbered(system.forces, number),
        reactions=system.reactions._replace(first_equation=left[system.reactions.first_equation]),
        shown=system.shown._replace(load_equation=left[system.shown.load_equation]),
    )


def loads_alone(system: System) -> tuple[System, np.ndarray]:
    """Return the system without joints and constraint equations, and the numbers (q,) that the
    coordinates which its forces need have in the ``system``: without equations those are all.
    """
    numbers = forces.coordinates_needed(system.forces)
    used = np.flatnonzero(np.bincount(numbers[numbers >= 0]))
    if system.scalar is not None:
        system = drop_rows(system, np.ones(system.scalar.equations.law.size, dtype=bool))
    alone = system._replace(
        coincide=Coincide(*(array[:0] for array in system.coincide)),
        reactions=Reactions(*(array[:0] for array in system.reactions)),
    )
    return alone, used


def coordinate_subset(group: Coordinates, used: np.ndarray) -> tuple[Coordinates, np.ndarray]:
    """Return the ``used`` coordinates (n,) with their products, and the new number of each old one;
    -1 for the others, and as the last entry, which serves -1.
    """
    number = np.full(group.kind.size + 1, -1)
    number[used] = np.arange(used.size)
    spans = [np.arange(group.first[q], group.first[q + 1]) for q in used]
    products = np.concatenate([*spans, np.zeros(0, dtype=np.int64)]).astype(np.int64)
    coords = Coordinates(
        products=_subset(group.products, products),
        kind=group.kind[used],
        first=np.concatenate([[0], np.cumsum([s.size for s in spans])]).astype(np.int64),
        coordinate=np.repeat(np.arange(used.size), [s.size for s in spans]),
        radius=group.radius[used],
        block=group.block[used],
        curves=curves.subset(group.curves, used),
        ends=_ends(group.ends, used),
        of_contacts=group.of_contacts[used],
        idle=group.idle[used],
    )
    return coords, number


def _ends(ends: np.ndarray | None, used: np.ndarray) -> np.ndarray | None:
    """Return the half lengths of the ``used`` coordinates (n,); None if these have none."""
    return ends[used] if ends is not None and ends[used].any() else None


def _subset(group: Products, used: np.ndarray) -> Products:
    """Return the products of the numbers ``used`` (n,)."""
    surfaces = group.surfaces
    if surfaces is not None:
        some = (group.kind[used] == SURFACE).any()
        half = None if surfaces.half is None else surfaces.half[used]
        own = (surfaces.shape[used], surfaces.radius[used], surfaces.second[used])
        surfaces = Surfaces(*own, surfaces.axis[used], half) if some else None
    numbers = (group.kind[used], group.a[used], group.b[used], group.owner[used])
    vectors = (group.n[used], group.s_a[used], group.s_b[used], group.e[used])
    return Products(*numbers, *vectors, surfaces)


def all_unknowns(system: System) -> np.ndarray:
    """(f,) every flat unknown but the ground's six, and those that beams in a plane do not have."""
    return np.flatnonzero(_all(system))


def _all(system: System) -> np.ndarray:
    needed = np.zeros((node_count(system), 3), dtype=bool)
    moving, first = slice(moving_count(system.frames)), first_multiplier(system.frames)
    needed[system.frames.displacement[moving]] = True
    needed[system.frames.rotation[moving]] = True
    needed[first : first + system.coincide.a.size] = True
    if system.scalar:
        rows = system.scalar.equations
        place = rows.place[is_active(rows)]
        needed[first + place[:, 0], place[:, 1]] = True
    springs = system.forces.compliance
    if springs:
        needed[first + springs.place[:, 0], springs.place[:, 1]] = True
    if system.beams:
        needed[first + system.beams.place] = True
        needed[first + system.beams.place + 1] = True
        plane = system.beams.plane
        if plane is not None:
            needed &= _in_plane(system, int(plane.axes[2]), plane)
    return needed


def needed_unknowns(
    system: System, start: SystemWorkspace, axis: int | None, ballistic: bool = False
) -> np.ndarray:
    """(f,) the flat unknowns left to solve for; ``axis`` is the normal of a planar system. With
    ``ballistic`` bodies that nothing touches are solved for as well, as tables of accelerations
    need it: what is no unknown has the acceleration zero."""
    needed = _all(system)
    if not ballistic:
        needed[system.frames.displacement[system.frames.ballistic]] = False
    if axis is not None:
        needed &= in_plane(system, start, axis)
    return np.flatnonzero(needed)


def in_plane(system: System, start: SystemWorkspace, axis: int) -> np.ndarray:
    """(nodes, 3) which unknowns, and equations, a system has in the plane across ``axis``; the
    others vanish by symmetry.
    """
    plane = system.beams and plane_of_beams(system.beams, start.beams, axis)
    kept = _in_plane(system, axis, plane)
    if system.scalar:
        place = system.scalar.equations.place[symmetric_rows(system, start, axis)]
        kept[first_multiplier(system.frames) + place[:, 0], place[:, 1]] = False
    return kept


def _in_plane(system: System, axis: int, plane: Plane | None) -> np.ndarray:
    """(nodes, 3) likewise, with all scalar equations; ``plane`` is that of beams."""
    frames, k = system.frames, int(system.coincide.a.size)
    first, normal = first_multiplier(frames), np.arange(3) == axis
    kept = np.ones((node_count(system), 3), dtype=bool)
    kept[frames.rotation] = normal
    kept[frames.displacement] = ~normal
    kept[first : first + k] = ~normal
    if system.beams and plane:
        strains, place = in_plane_strains(plane.shear), first + system.beams.place
        kept[place], kept[place + 1] = strains[:, :3], strains[:, 3:]
    return kept
