"""Beams by their centre line, section and material: nodes, compliances, reference strains."""
