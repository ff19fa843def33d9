"""Tests of msahl.analysis.linearised."""
