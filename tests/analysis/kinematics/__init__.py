"""Tests of msahl.analysis.kinematics."""
