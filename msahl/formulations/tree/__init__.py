"""Joint coordinates of open trees of rigid bodies, by recursive dynamics in lanes."""
