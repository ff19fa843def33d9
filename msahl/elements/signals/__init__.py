"""Signals: scalars that laws of the motion are made of, auxiliary states, and their derivatives.

An expression u(y, s) has inputs y and auxiliary states s, which follow s_dot = f(y, s). Inputs are

    TIME         t                                                              [s]
    COORDINATE   coordinate of a joint: an angle or a displacement              [rad or m]
    RATE         its rate                                                       [rad/s or m/s]
    POSITION     of a marker: component of x + R r, inertial axes               [m]
    VELOCITY     its rate                                                       [m/s]
    QUATERNION   of a marker: component of its Euler parameters, q0 >= 0
    SPIN         of a marker: angular velocity along one of its own axes        [rad/s]
    REACTION     component of a joint's reaction in the accepted step before    [N or N m]

**At one configuration** the inputs are those of the configuration, the states those of the
``State``.

**Over a step h of the midpoint element** they are means over the step:

    value (y0 + y1)/2 ,  rate (y1 - y0)/h ,  spin axis . Q/h ,  t = t0 + h/2

**Over a step with s force nodes** c_i the states are collocated at Radau's m nodes r_j, so that
those which change faster than the steps are damped in all schemes:

    Y_j = E_j0 y(0) + sum_i E_ji y(c_i) ,  S_j = s0 + h sum_l A_jl f(Y_l, S_l) ,  s1 = S_m     (1)
    s(c_i) = sum_j M_ij S_j ,   u_i = u(y(c_i), s(c_i))

with A_jl the integral from 0 to r_j of the Lagrange polynomial of r_l, E the polynomials through 0
and the c_i, M those through the r_j, without the start, from which a fast state jumps. In radau the
r_j are the c_i, and E = M = 1. In gauss m = s + 1: the error of both is orthogonal to
polynomials of degree s - 1, so the order stays 2s. The midpoint element is the case s = 1, c = 1/2.

(1) is solved here, by Newton's method to round-off, so the states are no unknowns of the step. The
derivative of a result contains them, by the implicit function theorem:

    du_i/dy_n = delta_in u_y + u_s [M (1 - h A f_s)^-1 h A f_y E]_in

All expressions of a system are one tape (``expressions.tape``): a model compiles nothing for them.

``group`` has the arrays, ``inputs`` y, ``states`` s over a step, ``results`` u and what they add to
the equations of motion.
"""
