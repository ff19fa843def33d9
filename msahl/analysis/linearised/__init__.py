"""The equations of motion linearised at one configuration; their reduction to minimal states."""
