"""Tests of msahl.analysis.equilibria."""
