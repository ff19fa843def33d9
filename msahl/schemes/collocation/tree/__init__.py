"""Steps of gauss in joint coordinates."""
