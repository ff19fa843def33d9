"""The equations of motion linearised at one configuration, and their reduction to minimal states:
what modes, equilibria and state-space models are made of."""
