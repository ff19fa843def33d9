"""Tests of msahl.analysis.state_space."""
