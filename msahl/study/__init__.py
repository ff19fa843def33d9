"""Convergence studies: errors of a deck's results against reference values, and the time they take.

    deck -> reference (independent solution, stored run, or runs at small steps)
         -> runs over step sizes and schemes -> errors -> orders, the fastest run -> report

Runs are made in this process by the time loop of ``run``; a study is a user of it like any other.
"""
