"""Models x' = A x + B w, y = C x + D w about a point, with inputs, outputs and states by name."""
