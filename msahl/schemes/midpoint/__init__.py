"""The schemes of order 2: energy-preserving and decaying."""
