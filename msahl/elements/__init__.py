"""Laws of bodies, constraints and forces, with their derivatives and energies."""
