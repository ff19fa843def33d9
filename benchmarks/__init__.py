"""Speed, error and memory of msahl beside its peers, measured in one run on one machine."""
