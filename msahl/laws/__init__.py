"""Laws of forces, apart from where these act: at one configuration, in SI units."""
