"""Kinds of joints: one module each, which lists the joint's constraint equations."""
