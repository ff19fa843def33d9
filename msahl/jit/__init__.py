"""Compilation of the kernels by numba."""
