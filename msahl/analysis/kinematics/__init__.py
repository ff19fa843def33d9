"""Motions that are prescribed completely."""
