"""Solving: the nonlinear equations of a step, and many steps of an island."""
