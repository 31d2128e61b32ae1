"""Models beside published measurements: what sources found, what is predicted, how far apart."""
