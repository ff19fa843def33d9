"""Forces: one module a kind of load, its law, derivative and work side by side."""
