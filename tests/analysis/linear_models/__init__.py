"""Tests of msahl.analysis.linear_models."""
