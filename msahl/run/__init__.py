"""Runs: the time loop, step schedule, error estimate and verdict."""
