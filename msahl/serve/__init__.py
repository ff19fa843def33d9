"""A server that keeps the program in memory, so that short commands start in milliseconds.

``client`` hands a command over, ``server`` takes it, ``request`` is what passes between them, and
``child`` carries it out in a process of its own, which has taken the place of the one that asked.
"""
