"""Mechanisms with all kinds of joints: models for msahl and its peers, and their cost."""
