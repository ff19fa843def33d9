"""The command msahl: one module for each subcommand."""
