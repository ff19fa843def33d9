"""FMUs for co-simulation (FMI 2.0 and 3.0): a deck that another program advances.

An FMU holds the deck, a description of its variables, a Python module of a few lines and the
binaries of pythonfmu (FMI 2.0) or pythonfmu3 (FMI 3.0), which pass the calls of a master on to the
class in that module: a ``slave.Slave``. Steps, states and values are those of
``api.co_simulation``.
"""
