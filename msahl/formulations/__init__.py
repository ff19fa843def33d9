"""Formulations of the equations of motion: what coordinates, forces and constraints mean in them.

A formulation owes the rest of the program:

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
as ``absolute`` does, and a second formulation has to begin with them.
"""
