"""Implement the subcommands of ``msahl-post``; all printing of the package is done here."""
