"""Tests of msahl.analysis.inverse."""
