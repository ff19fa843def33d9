"""Nodes and weights of the higher-order time element of degree s.

Positions over a step are polynomials of degree s through the Lobatto nodes t_0 = 0 ... t_s = 1 (in
parts of the step), phi_k their Lagrange polynomials. Forces and inertia are summed at the s Gauss
nodes c_i with weights b_i, joint forces at the Lobatto nodes with weights B_k. The variation by the
position at node k,

    delta_k0 p0 + sum_i b_i (h phi_k(c_i) F_i + phi_k'(c_i) P_i) + h B_k G_k^T lam_k = 0 ,  k < s ,

multiplied by the inverse of N_kj = sum_i b_i phi_k'(c_i) phi_j'(c_i), so that a mass m of momentum
m u_dot has the displacement z_j itself on the left:

    m z_j = h t_j p0 - h^2 sum_i alpha_ji F_i - h^2 sum_k chi_jk G_k^T lam_k
    alpha = N^-1 b phi ,   chi = N^-1 B ,   beta = N^-1 b phi'  for momenta that are not m u_dot

(the first column of N^-1 is -t_j).
Source: L. O. Jay, Specialized partitioned additive Runge-Kutta methods for systems of
overdetermined DAEs with holonomic constraints, SIAM J. Numer. Anal. 45 (2007), for the method in
its Runge-Kutta form; J. E. Marsden and M. West, Discrete mechanics and variational integrators,
Acta Numerica 10 (2001), for the variational one.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial


class Rule(NamedTuple):
    """The numbers of one degree s; times in parts of the step."""

    gauss: np.ndarray  # (s,) c_i
    weight: np.ndarray  # (s,) b_i
    lobatto: np.ndarray  # (s + 1,) t_k
    node_weight: np.ndarray  # (s + 1,) B_k
    at_node: np.ndarray  # (s + 1, s) phi_j(t_k), j = 1..s
    value: np.ndarray  # (s, s) phi_j(c_i), j = 1..s
    slope: np.ndarray  # (s, s) phi_j'(c_i), j = 1..s
    alpha: np.ndarray  # (s, s) of forces at c_i in the equation of z_j
    beta: np.ndarray  # (s, s) of momenta
    chi: np.ndarray  # (s, s) of joint forces at t_k, k = 0..s - 1
    integral: np.ndarray  # (s, s) from 0 to t_j of the Lagrange polynomials through c_i
    ahead: np.ndarray  # (s, s + 1) last step's values at its c_i, and that at its end, at ours
    ahead_nodes: np.ndarray  # (s, s) last step's values at its t_k, k < s, at ours


def new_rule(s: int) -> Rule:
    """The rule of degree ``s`` >= 1."""
    x, b = legendre.leggauss(s)
    gauss, weight = 0.5 * (x + 1.0), 0.5 * b
    ends = legendre.Legendre.basis(s)
    x = np.concatenate([[-1.0], np.sort(ends.deriv().roots().real), [1.0]])
    lobatto, node_weight = 0.5 * (x + 1.0), 1.0 / (s * (s + 1.0) * ends(x) ** 2)
    value, slope = lagrange(lobatto, gauss), lagrange(lobatto, gauss, 1)
    inverse = np.linalg.inv((weight[:, None] * slope[:, :s]).T @ slope[:, 1:])
    return Rule(
        gauss=gauss,
        weight=weight,
        lobatto=lobatto,
        node_weight=node_weight,
        at_node=np.eye(s + 1)[:, 1:].copy(),
        value=value[:, 1:].copy(),
        slope=slope[:, 1:].copy(),
        alpha=inverse @ (weight[:, None] * value[:, :s]).T,
        beta=inverse @ (weight[:, None] * slope[:, :s]).T,
        chi=inverse * node_weight[:s],
        integral=lagrange(gauss, lobatto[1:], -1),
        ahead=lagrange(np.append(gauss - 1.0, 0.0), gauss),
        ahead_nodes=lagrange(lobatto[:s] - 1.0, lobatto[:s]),
    )


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
