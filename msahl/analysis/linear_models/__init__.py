"""Linear models with named inputs, outputs and states."""
