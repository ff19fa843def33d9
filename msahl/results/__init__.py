"""Results: tables and run.json on disk, written and read back."""
