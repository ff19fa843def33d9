"""Development tools: regression, sweep table, validation pages, documentation pages, word check."""
