"""The schemes of higher order: Gauss and Radau collocation."""
