"""What all schemes share: work arrays, criteria, accelerations at one time, tangents of steps.

What a scheme must provide is numbered in ``docs/adding-a-scheme.md``.
"""
