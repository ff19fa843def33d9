"""Tests of msahl.analysis.modes."""
