"""Explicit Runge-Kutta schemes in joint coordinates."""
