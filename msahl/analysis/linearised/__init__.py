"""The equations of motion linearised at one configuration, and their reduction to minimal states.

Modes, equilibria and state-space models are made of them.
"""
