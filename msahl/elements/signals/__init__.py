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

    value (y0 + y1)/2 ,  rate (y1 - y0)/h ,  spin axis . Q/h ,  t = t0 + h/2 ,  s_m = (s0 + s1)/2
    s_m = s0 + h/2 f(y, s_m) ,  s1 = s0 + h f(y, s_m)                                          (1)

(1) is solved here, by Newton's method to round-off, so the states are no unknowns of the step. The
derivative of a result contains them, by the implicit function theorem:

    du/dy = u_y + u_s (1 - h/2 f_s)^-1 h/2 f_y

**Over a collocation step** with force nodes c_i, A_il the integral from 0 to c_i of the Lagrange
polynomial of c_l, and b_i that from 0 to 1:

    S_i = s0 + h sum_l A_il f(y_l, S_l) ,   s1 = s0 + h sum_l b_l f(y_l, S_l)                  (2)
    du_i/dy_j = delta_ij u_y + u_s [(1 - h A f_s)^-1 h A f_y]_ij

(1) is (2) for one node with A = 1/2 and b = 1. All expressions of a system are one tape
(``expressions.tape``): a model compiles nothing for them.

``group`` has the arrays, ``inputs`` y, ``states`` s over a step, ``results`` u and what they add to
the equations of motion.
"""
