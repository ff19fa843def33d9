"""Forces along a tree's coordinates that are left to accelerate them, in lanes.

With the notation of ``recursion``, A the rate of change of a body's twist at constant rates u, and
a_c the acceleration of its mass centre then:

    A = sum u_k dS_k/dt      over the coordinates between the ground and the body
    B = (c x (f - m a_c) + M - J A_w - w x J w, f - m a_c)       load less inertia
    M du/dt = S_k . (sum of B over the body of q_k and all beyond it)

Source: R. Featherstone, Rigid Body Dynamics Algorithms (2008), section 5.3.
"""

from msahl.algebra.lanes import (
    LaneVector,
    accumulate_vector,
    cross,
    difference,
    dot,
    matrix_at,
    multiple,
    put_vector,
    spread_vector,
    sum_of,
    times,
    transposed_times,
    vector_at,
)
from msahl.algebra.vector import ZERO, scale
from msahl.algebra.vector import matrix_at as plain_matrix
from msahl.formulations.tree.table import Tree, TreeMotion
from msahl.jit.kernel import kernel, unit
from msahl.jit.lanes import load, store


@unit
def set_forces(tree: Tree, motion: TreeMotion) -> None:
    """Set ``motion.y`` to the forces, by the loads ``motion.load``, after ``set_twists``;
    ``motion.momenta`` receives the rates A.
    """
    _set_twist_rates(tree, motion)
    for b in range(1, tree.frame.size):
        _set_wrench(tree, motion, b)
    for b in range(tree.frame.size - 1, 0, -1):
        M, F = vector_at(motion.wrench, 6 * b), vector_at(motion.wrench, 6 * b + 3)
        for k in range(tree.first[b], tree.first[b + 1]):
            a, s = vector_at(motion.screw, 6 * k), vector_at(motion.screw, 6 * k + 3)
            store(motion.y, k, dot(a, M) + dot(s, F))
        if tree.parent[b] > 0:
            place = 6 * tree.parent[b]
            accumulate_vector(motion.wrench, place, M)
            accumulate_vector(motion.wrench, place + 3, F)


@kernel
def _set_twist_rates(tree: Tree, motion: TreeMotion) -> None:
    """Set the rates of all twists at constant rates of the coordinates."""
    put_vector(motion.momenta, 0, spread_vector(ZERO))
    put_vector(motion.momenta, 3, spread_vector(ZERO))
    for b in range(1, tree.frame.size):
        before = 6 * tree.parent[b]
        w, v = vector_at(motion.momenta, before), vector_at(motion.momenta, before + 3)
        for k in range(tree.first[b], tree.first[b + 1]):
            u = load(motion.u, k)
            w = sum_of(w, multiple(u, vector_at(motion.screw_rate, 6 * k)))
            v = sum_of(v, multiple(u, vector_at(motion.screw_rate, 6 * k + 3)))
        put_vector(motion.momenta, 6 * b, w)
        put_vector(motion.momenta, 6 * b + 3, v)


@kernel
def _set_wrench(tree: Tree, motion: TreeMotion, b: int) -> None:
    """Set what is left of the load on body ``b``."""
    w, w_rate = vector_at(motion.twist, 6 * b), vector_at(motion.momenta, 6 * b)
    c, D = vector_at(motion.place, 3 * b), matrix_at(motion.rotation, 9 * b)
    J = plain_matrix(motion.inertia, b)
    weight = scale(tree.mass[b], (tree.gravity[0], tree.gravity[1], tree.gravity[2]))
    force = sum_of(vector_at(motion.load, 6 * b + 3), spread_vector(weight))
    force = difference(force, multiple(tree.mass[b], acceleration(motion, b)))
    own = times(D, times(J, transposed_times(D, w_rate)))
    own = sum_of(own, cross(w, times(D, times(J, transposed_times(D, w)))))
    moment = difference(vector_at(motion.load, 6 * b), own)
    put_vector(motion.wrench, 6 * b, sum_of(moment, cross(c, force)))
    put_vector(motion.wrench, 6 * b + 3, force)


@kernel
def acceleration(motion: TreeMotion, b: int) -> LaneVector:
    """Acceleration of the mass centre of body ``b`` at constant rates of the coordinates."""
    w, v = vector_at(motion.twist, 6 * b), vector_at(motion.twist, 6 * b + 3)
    w_rate, v_rate = vector_at(motion.momenta, 6 * b), vector_at(motion.momenta, 6 * b + 3)
    c = vector_at(motion.place, 3 * b)
    return sum_of(sum_of(v_rate, cross(w_rate, c)), cross(w, sum_of(v, cross(w, c))))
