"""Analyses of a model at one configuration: linearisation, modes, equilibrium."""
