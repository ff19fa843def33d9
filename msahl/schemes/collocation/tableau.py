"""Nodes and weights of the higher-order time elements of degree s.

``gauss``: positions over a step are polynomials of degree s through the Lobatto nodes t_0 = 0 ...
t_s = 1 (in parts of the step), phi_k their Lagrange polynomials. Forces and inertia are summed at
the s Gauss nodes c_i with weights b_i, joint forces at the Lobatto nodes with weights B_k. The
variation by the position at node k,

    delta_k0 p0 + sum_i b_i (h phi_k(c_i) F_i + phi_k'(c_i) P_i) + h B_k G_k^T lam_k = 0 ,  k < s ,

multiplied by the inverse of N_kj = sum_i b_i phi_k'(c_i) phi_j'(c_i), so that a mass m of momentum
m u_dot has the displacement z_j itself on the left:

    m z_j = h t_j p0 - h^2 sum_i alpha_ji F_i - h^2 sum_k chi_jk G_k^T lam_k
    alpha = N^-1 b phi ,   chi = N^-1 B ,   beta = N^-1 b phi'  for momenta that are not m u_dot

(the first column of N^-1 is -t_j).

``radau``: velocities and momenta may jump where a step begins, and are collocated at Radau's nodes
t_1 ... t_s = 1, with A_ji the integral from 0 to t_j of the Lagrange polynomial of node i among
them. Forces, inertia and joint forces are all there, joints closed there, and

    m z_j = h t_j p0 + h^2 sum_i (A^2)_ji (F_i + G_i^T lam_i) :   alpha = chi = -A^2 ,   beta = A

with momenta m u_dot = p0 + h A (F + G^T lam) at the nodes, of which the last are those of the end.

Source: L. O. Jay, Specialized partitioned additive Runge-Kutta methods for systems of
overdetermined DAEs with holonomic constraints, SIAM J. Numer. Anal. 45 (2007), for the method in
its Runge-Kutta form; J. E. Marsden and M. West, Discrete mechanics and variational integrators,
Acta Numerica 10 (2001), for the variational one; E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II (1996), chapters IV and VII, for Radau's.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

from msahl.model.scheme import COLLOCATION


class Rule(NamedTuple):
    """The numbers of one scheme of degree s; times in parts of the step.

    ``time``, ``closes``, ``pushes`` and ``acts`` are what a step comes to, one after the other:
    places where joints close or push, and where forces act.
    """

    acting: np.ndarray  # (s,) c_i, where forces and inertia are summed
    weight: np.ndarray  # (s,) b_i
    closing: np.ndarray  # (s,) t_j, j = 1..s, where joints are closed: the places z_j
    push: np.ndarray  # (s,) B_k of the joint forces
    value: np.ndarray  # (s, s) phi_j(c_i), j = 1..s
    slope: np.ndarray  # (s, s) phi_j'(c_i), j = 1..s
    alpha: np.ndarray  # (s, s) of forces at c_i in the equation of z_j
    beta: np.ndarray  # (s, s) of momenta
    chi: np.ndarray  # (s, s) of joint forces
    from_moments: np.ndarray  # (s, s) factors of loads at c_i from their laws' moments
    integral: np.ndarray  # (s, s) from 0 to t_j of the Lagrange polynomials through c_i
    pushing: np.ndarray  # (s,) where joint forces push
    late: int  # i of the last c_i before the end, -1 if there is none
    varied: bool  # whether rows of turns are variations by their parameters, or moments
    decays: bool
    time: np.ndarray  # (m,)
    closes: np.ndarray  # (m,) j - 1 if joints close there at t_j, else -1
    pushes: np.ndarray  # (m,) k if joint forces k push there, else -1
    acts: np.ndarray  # (m,) i if forces act there at c_i, else -1
    place: np.ndarray  # (m, s) phi_j there
    rate: np.ndarray  # (m, s) phi_j' there; zero where nobody asks


def new_rule(scheme: str, s: int) -> Rule:
    """The rule of one of the ``schemes.COLLOCATION`` of degree ``s`` >= 1."""
    return {"gauss": _gauss, "radau": _radau}[scheme](s)


def _gauss(s: int) -> Rule:
    """Forces at Gauss's nodes, joints at Lobatto's."""
    x, b = legendre.leggauss(s)
    gauss, weight = 0.5 * (x + 1.0), 0.5 * b
    ends = legendre.Legendre.basis(s)
    x = np.concatenate([[-1.0], np.sort(ends.deriv().roots().real), [1.0]])
    lobatto, node_weight = 0.5 * (x + 1.0), 1.0 / (s * (s + 1.0) * ends(x) ** 2)
    value, slope = lagrange(lobatto, gauss), lagrange(lobatto, gauss, 1)
    inverse = np.linalg.inv((weight[:, None] * slope[:, :s]).T @ slope[:, 1:])
    none = np.full(s, -1)
    return Rule(
        acting=gauss,
        weight=weight,
        closing=lobatto[1:],
        push=node_weight[:s],
        value=value[:, 1:].copy(),
        slope=slope[:, 1:].copy(),
        alpha=inverse @ (weight[:, None] * value[:, :s]).T,
        beta=inverse @ (weight[:, None] * slope[:, :s]).T,
        chi=inverse * node_weight[:s],
        from_moments=_from_moments(gauss, weight),
        integral=lagrange(gauss, lobatto[1:], -1),
        pushing=lobatto[:s],
        late=s - 1,
        varied=True,
        decays=COLLOCATION["gauss"].decays,
        time=np.concatenate([lobatto, gauss]),
        closes=np.concatenate([np.arange(s + 1) - 1, none]),
        pushes=np.concatenate([np.arange(s), [-1], none]),
        acts=np.concatenate([[-1], none, np.arange(s)]),
        place=np.concatenate([np.eye(s + 1)[:, 1:], value[:, 1:]]),
        rate=np.concatenate([np.zeros((s + 1, s)), slope[:, 1:]]),
    )


def _radau(s: int) -> Rule:
    """All at Radau's nodes, the last of them the end."""
    basis = legendre.Legendre.basis
    nodes = 0.5 * (np.sort((basis(s) - basis(s - 1)).roots().real) + 1.0)
    nodes[-1] = 1.0
    integral, slope = lagrange(nodes, nodes, -1), lagrange(np.append(0.0, nodes), nodes, 1)[:, 1:]
    twice, weight = -integral @ integral, integral[-1].copy()
    one, none = np.arange(s), np.full(s, -1)
    return Rule(
        acting=nodes,
        weight=weight,
        closing=nodes,
        push=weight,
        value=np.eye(s),
        slope=slope.copy(),
        alpha=twice,
        beta=integral,
        chi=twice,
        from_moments=_from_moments(nodes, weight),
        integral=integral,
        pushing=nodes,
        late=s - 2,
        varied=False,
        decays=COLLOCATION["radau"].decays,
        # Of each node the joints, then the forces.
        time=np.repeat(nodes, 2),
        closes=np.stack([one, none], axis=1).ravel(),
        pushes=np.stack([one, none], axis=1).ravel(),
        acts=np.stack([none, one], axis=1).ravel(),
        place=np.repeat(np.eye(s), 2, axis=0),
        rate=np.repeat(slope, 2, axis=0),
    )


def _from_moments(nodes: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(s, s) inverse of the moments, against Legendre's polynomials, that the rule with these nodes
    and weights finds of values at the nodes.
    """
    return np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, len(nodes) - 1).T * weight)


def lagrange(nodes: np.ndarray, places: np.ndarray, derivative: int = 0) -> np.ndarray:
    """(m, n) values at m ``places`` of the Lagrange polynomials of n ``nodes``, of their first
    ``derivative``, or, if that is -1, of their integrals from 0.
    """
    # About the middle of the step powers are told apart best.
    powers = np.linalg.inv(np.vander(2.0 * nodes - 1.0, increasing=True))
    if derivative == 1:
        powers = 2.0 * polynomial.polyder(powers)
    if derivative == -1:
        powers = 0.5 * polynomial.polyint(powers, lbnd=-1.0)
    return np.ascontiguousarray(polynomial.polyval(2.0 * places - 1.0, powers).T)
