"""Computes nodes and weights of the collocation schemes gauss and radau of degree s.

``gauss``: positions over a step are polynomials of degree s through the Lobatto nodes t_0 = 0 ...
t_s = 1 (fractions of the step), with the Lagrange polynomials phi_k. Forces and inertia are summed
at the s Gauss nodes c_i with weights b_i, constraint forces at the Lobatto nodes with weights B_k.
The variation by the position at node k,

    delta_k0 p0 + sum_i b_i (h phi_k(c_i) F_i + phi_k'(c_i) P_i) + h B_k G_k^T lam_k = 0 ,  k < s ,

multiplied by the inverse of N_kj = sum_i b_i phi_k'(c_i) phi_j'(c_i), so that a mass m of momentum
m u_dot has the displacement z_j itself on the left:

    m z_j = h t_j p0 - h^2 sum_i alpha_ji F_i - h^2 sum_k chi_jk G_k^T lam_k
    alpha = N^-1 b phi ,   chi = N^-1 B ,   beta = N^-1 b phi'  for momenta that are not m u_dot

(the first column of N^-1 is -t_j).

``radau``: velocities and momenta may jump at the start of a step, and are collocated at the Radau
nodes t_1 ... t_s = 1, with A_ji the integral from 0 to t_j of the Lagrange polynomial of node i.
Forces, inertia, constraint forces and constraints are all evaluated there, and

    m z_j = h t_j p0 + h^2 sum_i (A^2)_ji (F_i + G_i^T lam_i) :   alpha = chi = -A^2 ,   beta = A

with momenta m u_dot = p0 + h A (F + G^T lam) at the nodes; the last ones are those of the end.

Source: L. O. Jay, Specialized partitioned additive Runge-Kutta methods for systems of
overdetermined DAEs with holonomic constraints, SIAM J. Numer. Anal. 45 (2007), for the method in
its Runge-Kutta form; J. E. Marsden and M. West, Discrete mechanics and variational integrators,
Acta Numerica 10 (2001), for the variational one; E. Hairer, G. Wanner, Solving Ordinary
Differential Equations II (1996), chapters IV and VII, for Radau's.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.polynomial import legendre, polynomial

from msahl.elements.signals.group import StateNodes
from msahl.model.scheme import COLLOCATION


class Tableau(NamedTuple):
    """Nodes and weights of one scheme of degree s; times are fractions of the step.

    A step is evaluated at m time nodes, one after the other: some with constraints and constraint
    forces, some with forces and inertia.
    """

    force_time: np.ndarray  # (s,) c_i, times of forces and inertia
    force_weight: np.ndarray  # (s,) b_i
    constraint_time: (
        np.ndarray
    )  # (s,) t_j, j = 1..s, times of the constraints and of the unknowns z_j
    multiplier_weight: np.ndarray  # (s,) B_k of the constraint forces
    basis: np.ndarray  # (s, s) phi_j(c_i), j = 1..s
    basis_rate: np.ndarray  # (s, s) phi_j'(c_i), j = 1..s
    alpha: np.ndarray  # (s, s) alpha_ji of forces at c_i in the equation of z_j
    beta: np.ndarray  # (s, s) beta_ji of momenta
    chi: np.ndarray  # (s, s) chi_jk of constraint forces
    from_moments: np.ndarray  # (s, s) from the moments of a law of time to factors at c_i
    integral: np.ndarray  # (s, s) from 0 to t_j of the Lagrange polynomials through c_i
    multiplier_time: np.ndarray  # (s,) times of the constraint forces
    last_inner: int  # index i of the last c_i before the end, -1 if there is none
    is_variational: bool  # whether rotations are balanced by variations of their parameters
    decays: bool
    node_time: np.ndarray  # (m,)
    constraint_stage: np.ndarray  # (m,) j - 1 if constraints hold there at t_j, else -1
    multiplier_stage: np.ndarray  # (m,) k if constraint forces k act there, else -1
    force_stage: np.ndarray  # (m,) i if forces act there at c_i, else -1
    node_basis: np.ndarray  # (m, s) phi_j there
    node_basis_rate: np.ndarray  # (m, s) phi_j' there; zero where it is not used


@cache
def new_tableau(scheme: str, s: int) -> Tableau:
    """Return the tableau of a collocation ``scheme`` of degree ``s`` >= 1; all steps share it."""
    return {"gauss": _gauss, "radau": _radau}[scheme](s)


def _gauss(s: int) -> Tableau:
    """Return the tableau of ``gauss``: forces at Gauss nodes, constraints at Lobatto nodes."""
    x, b = legendre.leggauss(s)
    gauss, weight = 0.5 * (x + 1.0), 0.5 * b
    ends = legendre.Legendre.basis(s)
    x = np.concatenate([[-1.0], np.sort(ends.deriv().roots().real), [1.0]])
    lobatto, node_weight = 0.5 * (x + 1.0), 1.0 / (s * (s + 1.0) * ends(x) ** 2)
    value, slope = lagrange(lobatto, gauss), lagrange(lobatto, gauss, 1)
    inverse = np.linalg.inv((weight[:, None] * slope[:, :s]).T @ slope[:, 1:])
    none = np.full(s, -1)
    return Tableau(
        force_time=gauss,
        force_weight=weight,
        constraint_time=lobatto[1:],
        multiplier_weight=node_weight[:s],
        basis=value[:, 1:].copy(),
        basis_rate=slope[:, 1:].copy(),
        alpha=inverse @ (weight[:, None] * value[:, :s]).T,
        beta=inverse @ (weight[:, None] * slope[:, :s]).T,
        chi=inverse * node_weight[:s],
        from_moments=_from_moments(gauss, weight),
        integral=lagrange(gauss, lobatto[1:], -1),
        multiplier_time=lobatto[:s],
        last_inner=s - 1,
        is_variational=True,
        decays=COLLOCATION["gauss"].decays,
        node_time=np.concatenate([lobatto, gauss]),
        constraint_stage=np.concatenate([np.arange(s + 1) - 1, none]),
        multiplier_stage=np.concatenate([np.arange(s), [-1], none]),
        force_stage=np.concatenate([[-1], none, np.arange(s)]),
        node_basis=np.concatenate([np.eye(s + 1)[:, 1:], value[:, 1:]]),
        node_basis_rate=np.concatenate([np.zeros((s + 1, s)), slope[:, 1:]]),
    )


def radau_nodes(s: int) -> np.ndarray:
    """(s,) Radau's nodes on [0, 1], the last of which is 1."""
    basis = legendre.Legendre.basis
    nodes: np.ndarray = 0.5 * (np.sort((basis(s) - basis(s - 1)).roots().real) + 1.0)
    nodes[-1] = 1.0
    return nodes


def _radau(s: int) -> Tableau:
    """Return the tableau of ``radau``: everything at Radau nodes, the last of which is the end."""
    nodes = radau_nodes(s)
    integral, slope = lagrange(nodes, nodes, -1), lagrange(np.append(0.0, nodes), nodes, 1)[:, 1:]
    twice, weight = -integral @ integral, integral[-1].copy()
    one, none = np.arange(s), np.full(s, -1)
    return Tableau(
        force_time=nodes,
        force_weight=weight,
        constraint_time=nodes,
        multiplier_weight=weight,
        basis=np.eye(s),
        basis_rate=slope.copy(),
        alpha=twice,
        beta=integral,
        chi=twice,
        from_moments=_from_moments(nodes, weight),
        integral=integral,
        multiplier_time=nodes,
        last_inner=s - 2,
        is_variational=False,
        decays=COLLOCATION["radau"].decays,
        # At each node the constraints come first, then the forces.
        node_time=np.repeat(nodes, 2),
        constraint_stage=np.stack([one, none], axis=1).ravel(),
        multiplier_stage=np.stack([one, none], axis=1).ravel(),
        force_stage=np.stack([none, one], axis=1).ravel(),
        node_basis=np.repeat(np.eye(s), 2, axis=0),
        node_basis_rate=np.repeat(slope, 2, axis=0),
    )


def state_nodes(tableau: Tableau) -> StateNodes:
    """Where auxiliary states are collocated: at Radau's nodes, which damp what is faster than the
    step; one more than a scheme of order 2s has force nodes, so that the order is kept.
    """
    s = tableau.force_time.size
    return at_radau_nodes(s) if tableau.decays else _at_more_nodes(s)


@cache
def _at_more_nodes(s: int) -> StateNodes:
    """For the s force nodes of ``gauss``."""
    forces, nodes = new_tableau("gauss", s).force_time, radau_nodes(s + 1)
    spread, mean = lagrange(np.append(0.0, forces), nodes), lagrange(nodes, forces)
    return StateNodes(lagrange(nodes, nodes, -1), spread, mean)


class Halves(NamedTuple):
    """From the polynomials of the halves of a step to its own: node i lies in ``half`` i of it."""

    rate_half: np.ndarray  # (s,) of the velocities at c_i
    rates: np.ndarray  # (s, s + 1) factors of those at the half's c_j, then at its start
    multiplier_half: np.ndarray  # (s,)
    multipliers: np.ndarray  # (s, s)


@cache
def halves_of(scheme: str, s: int) -> Halves:
    """How the unknowns of a step follow from those of its halves; all steps share it."""
    tableau = new_tableau(scheme, s)
    forces, multipliers = tableau.force_time, tableau.multiplier_time
    in_second, after = forces >= 0.5, multipliers >= 0.5
    # Velocities jump at the start of a step of a scheme that decays.
    known = forces if tableau.decays else np.append(forces, 0.0)
    rates = np.zeros((s, s + 1))
    rates[:, : known.size] = lagrange(known, 2.0 * forces - in_second)
    return Halves(
        in_second.astype(np.int64),
        rates,
        after.astype(np.int64),
        # Multipliers have the square of the step as a factor.
        4.0 * lagrange(multipliers, 2.0 * multipliers - after),
    )


@cache
def at_radau_nodes(s: int) -> StateNodes:
    """For s force nodes that are Radau's themselves."""
    nodes, one = radau_nodes(s), np.eye(s)
    return StateNodes(lagrange(nodes, nodes, -1), np.eye(s, s + 1, 1), one)


def _from_moments(nodes: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """(s, s) matrix from moments of a function to values at the ``nodes``: the inverse of the
    moments with Legendre polynomials that a quadrature with these ``weights`` gives.
    """
    return np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, len(nodes) - 1).T * weight)


def lagrange(nodes: np.ndarray, places: np.ndarray, derivative: int = 0) -> np.ndarray:
    """(m, n) values at m ``places`` of the Lagrange polynomials of n ``nodes``, of their first
    ``derivative``, or, if that is -1, of their integrals from 0.
    """
    # Powers about the middle of the step give the best conditioned matrix.
    powers = np.linalg.inv(np.vander(2.0 * nodes - 1.0, increasing=True))
    if derivative == 1:
        powers = 2.0 * polynomial.polyder(powers)
    if derivative == -1:
        powers = 0.5 * polynomial.polyint(powers, lbnd=-1.0)
    return np.ascontiguousarray(polynomial.polyval(2.0 * places - 1.0, powers).T)
