"""The Python API: models, runs and results as objects. ``import msahl`` offers all of it."""
