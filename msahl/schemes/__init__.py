"""The time integration schemes."""
