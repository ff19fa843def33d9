"""Formulations of the equations of motion: what coordinates, forces and constraints mean in them.

``absolute`` serves all models and schemes: coordinates of every frame, and a multiplier for each
constraint equation. It owes the rest of the program:

1. Unknowns: where those of a frame, and of a constraint, stand, and in which scale; so that every
   unknown and every equation is a length [m] whatever the model.
2. Kinematics: position and orientation of every frame, velocity and angular velocity; the arm,
   direction and velocity of a point fixed in one; the same over a step.
3. Push: a force and a moment about a frame's origin, in inertial axes and SI units, enter its
   equations.
4. Slope: the derivatives of that force and moment by the motion of a frame enter the Jacobian.
5. Retract: an increment of the unknowns moves the configuration on its manifold. With absolute
   coordinates this is a sum, and ``compose`` of the rotation of an increment
   (``msahl.algebra.rotation``), wherever a configuration is moved.
6. Inertia: the balance of momentum of a body, with its derivatives, its energy and its free
   acceleration.

Laws of forces (``msahl.laws``) use none of these, ports (``msahl.ports``) 2 to 4. Whatever writes
equations uses all: constraints, beams, schemes and the linearised equations number frames and nodes
as ``absolute`` does.

``tree`` serves steps of gauss: the joints' own displacements within a step. It begins
each step from a state of the frames and ends in one, so what reads states does not depend on it. It
owes the step (``schemes.collocation.tree``), for several nodes at once:

1. Start: places, axes, rates and momenta of the coordinates, from the state.
2. Kinematics: places, rotations and twists of all bodies, by coordinates and their rates.
3. Momenta and their rates, by the loads on the bodies as wrenches: those of the ports of the
   absolute form, at the poses and velocities of 2.
4. The mass matrix, factored, which takes residuals of momenta to corrections of the rates.

A kind of joint has its axes in its registry entry (``Kind`` in ``joints.joint``).
"""
